"""The paper's field (Yu and Da, arXiv 2311.16637), made solvable, for comparison (docs/method.md, 4).

x' = c + α g(c) with c = π(H_inf p), target pixels with the origin at pixel (0, 0). Its affine part moves along one
constant direction and its radial parts are free, so it leaves the epipolar lines.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..field.fade import fade_width, fading, outside_overlap
from ..field.field import FieldValues, Fit
from ..field.spline import SmoothingProblem, ThinPlateSpline, kernel
from ..field.strict import StrictField, best_smoothing
from ..field.transfer import target_points
from ..raster.arrays import Array
from ..raster.grid import Grid
from ..system.errors import DegenerateGeometry


@dataclass(frozen=True)
class PaperField:
    """g(c) = Σ (w_i, w'_i) φ(|c − c_i|) + u (m·(c, 1)), in target px, over c = π(H_inf p).

    strict: what it shares matches and planes with; radial: the first part; slope (3,): m; direction (2,): u.
    """

    strict: StrictField
    radial: ThinPlateSpline
    slope: Array
    direction: Array
    fit: Fit

    name = "paper"

    @property
    def two_view(self) -> TwoView:
        """The strict field's geometry."""
        return self.strict.two_view

    @property
    def plane(self) -> Array:
        """The strict field's plane (3,): about where the target will lie."""
        return self.strict.plane

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H_inf p) at a grid's nodes; it knows no depth, d = 0."""
        points = grid.points if ideal is None else ideal
        c, radial, affine = (part.reshape(points.shape) for part in self._parts(points.reshape(-1, 2)))
        field = self.strict
        away = outside_overlap(grid, c + radial + affine, field.size, field.target_size)
        alpha = fading(away, self.fit.fade_px)[..., None]
        shift = alpha * (radial + affine) if field.fade == "infinity" else alpha * radial + affine
        return FieldValues(np.zeros(points.shape[:2]), shift)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades."""
        c, radial, affine = self._parts(points)
        return c + radial + affine

    def refitted(self, matches: Matches) -> PaperField:
        """The field on other matches of the pair, all kept, at the same λ. Raises DegenerateGeometry."""
        return fit_paper(self.strict.refitted(matches), matches, self.fit.smoothing)

    def _parts(self, points: Array) -> tuple[Array, Array, Array]:
        """c, NaN behind the target camera, and the radial and the affine part of g there, each (N, 2), at points
        (N, 2)."""
        c = target_points(self.strict.two_view, points, np.zeros(len(points)))
        seen = np.where(np.isfinite(c), c, 0.0)
        return c, self.radial.at(seen), (seen @ self.slope[:2] + self.slope[2])[:, None] * self.direction


def fit_paper(strict: StrictField, matches: Matches, smoothing: float | None = None) -> PaperField:
    """The paper's field on the strict field's matches; its λ, where none is given, by the same cross-validation.

    Raises DegenerateGeometry.
    """
    view = strict.two_view
    direction = view.e_prime[:2] / max(float(np.linalg.norm(view.e_prime[:2])), 1e-300)
    kept = matches.subset(strict.fit.inliers_used)
    c = target_points(view, kept.x, np.zeros(len(kept)))
    seen = np.isfinite(c).all(axis=1)
    if seen.sum() < 8:
        raise DegenerateGeometry("the paper's field needs points at infinity in front of the target camera; use strict")
    c, kept = c[seen], kept.subset(seen)
    g = kept.y - c
    scale = float(np.sqrt(strict.target_size[0] * strict.target_size[1]))
    problem = SmoothingProblem.build(c, 1 / np.sqrt(kept.weights), scale)
    if smoothing is None:  # the component that moves more decides: λ is one for both
        smoothing = best_smoothing(problem, g[:, int(np.argmax(g.std(axis=0)))], np.ones(len(c)))
    radial, slope = solve_paper(c, g, direction, smoothing * scale**2, problem.noise**2)
    moved = np.linalg.norm(radial.at(c), axis=1)
    if strict.fade == "infinity":
        moved = np.linalg.norm(g, axis=1)
    left = g - radial.at(c) - (c @ slope[:2] + slope[2])[:, None] * direction
    rms = float(np.sqrt(np.mean(np.sum(left**2, axis=1))))
    fit = Fit(
        strict.fit.inliers_used, smoothing, fade_width(moved, matches.scale), rms, strict.fit.held_out_px,
        strict.fit.negative_share,
    )  # fmt: skip
    return PaperField(strict, radial, slope, direction, fit)


def solve_paper(
    c: Array, g: Array, direction: Array, smoothing: float, noise: Array
) -> tuple[ThinPlateSpline, Array]:
    """Minimise |(Φ + ρ)w + u₁Mm − g_x|² + |(Φ + ρ)w' + u₂Mm − g_y|² subject to Mᵀw = Mᵀw' = 0; ρ = 8πλ·noise.

    c, g (N, 2) px; direction u (2,); smoothing λ in px²; noise (N,), relative. Returns the radial part and m (3,). With
    S = Φ + ρ, what S w can never reach under the constraint is the span of S⁻¹M: m is what matters there (6 equations),
    and w follows exactly.
    """
    n = len(c)
    system = kernel(c, c) + 8 * np.pi * smoothing * np.diag(noise)
    polynomial = np.column_stack([c, np.ones(n)])
    factors = scipy.linalg.lu_factor(system)
    beyond = np.linalg.qr(scipy.linalg.lu_solve(factors, polynomial / np.abs(polynomial).max(axis=0)))[0]
    seen = beyond.T @ polynomial
    unit = np.abs(seen).max(axis=0)
    equations = np.vstack([direction[0] * seen, direction[1] * seen]) / unit
    slope = np.linalg.lstsq(equations, (beyond.T @ g).T.ravel(), rcond=None)[0] / unit
    rest = g - np.outer(polynomial @ slope, direction)
    weights = scipy.linalg.lu_solve(factors, rest - beyond @ (beyond.T @ rest))
    # in normalised coordinates r = s ρ: φ(r) = s² (φ(ρ) + ½ρ² ln s²), and under the constraints the second part adds
    # one constant
    centre, scale = c.mean(axis=0), max(float(np.abs(c - c.mean(axis=0)).max()), 1e-9)
    centres = (c - centre) / scale
    weights = weights * scale**2
    constant = 0.5 * np.log(scale**2) * (np.sum(centres**2, axis=1) @ weights)
    affine = np.vstack([np.zeros((2, 2)), constant])
    return ThinPlateSpline(centres, weights, affine, centre, scale), slope
