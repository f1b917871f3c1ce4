"""The field of Yu and Da (arXiv 2311.16637), in a solvable form, for comparison (docs/method.md, 4).

x' = c + α g(c) with c = π(H_inf p), target px from pixel (0, 0). The affine part of g has one constant direction and
its two radial parts are independent, so it does not stay on the epipolar lines.
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

    strict: the strict field of the same matches; radial: the sum; slope (3,): m; direction (2,): u.
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
        """The strict field's plane (3,), an estimate of where the target will lie."""
        return self.strict.plane

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H_inf p) at a grid's nodes; d = 0, since it has no depth."""
        points = grid.points if ideal is None else ideal
        c, radial, affine = (part.reshape(points.shape) for part in self._parts(points.reshape(-1, 2)))
        field = self.strict
        distance = outside_overlap(grid, c + radial + affine, field.size, field.target_size)
        alpha = fading(distance, self.fit.fade_px)[..., None]
        shift = alpha * (radial + affine) if field.fade == "infinity" else alpha * radial + affine
        return FieldValues(np.zeros(points.shape[:2]), shift)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px in the overlap, where nothing fades."""
        c, radial, affine = self._parts(points)
        return c + radial + affine

    def refitted(self, matches: Matches) -> PaperField:
        """The field fitted to other matches, none dropped, with the same λ. Raises DegenerateGeometry."""
        return fit_paper(self.strict.refitted(matches), matches, self.fit.smoothing)

    def _parts(self, points: Array) -> tuple[Array, Array, Array]:
        """c, NaN behind the target camera, and the radial and the affine part of g there, each (N, 2) px, for points
        (N, 2) px."""
        c = target_points(self.strict.two_view, points, np.zeros(len(points)))
        finite = np.where(np.isfinite(c), c, 0.0)
        return c, self.radial.at(finite), (finite @ self.slope[:2] + self.slope[2])[:, None] * self.direction


def fit_paper(strict: StrictField, matches: Matches, smoothing: float | None = None) -> PaperField:
    """Fits the paper's field to the matches of the strict field.

    Parameters
    ----------
    strict : StrictField
    matches : Matches
        The matches that `strict` was given, ideal px.
    smoothing : float, optional
        λ in units of W·H of the target; found by the strict field's cross-validation if not given.

    Returns
    -------
    PaperField

    Raises
    ------
    DegenerateGeometry
        Hardly any of the points at infinity lie in front of the target camera.
    """
    view = strict.two_view
    direction = view.e_prime[:2] / max(float(np.linalg.norm(view.e_prime[:2])), 1e-300)
    used = matches.subset(strict.fit.inliers_used)
    c = target_points(view, used.x, np.zeros(len(used)))
    in_front = np.isfinite(c).all(axis=1)
    if in_front.sum() < 8:
        raise DegenerateGeometry("the paper's field needs points at infinity in front of the target camera; use strict")
    c, used = c[in_front], used.subset(in_front)
    g = used.y - c
    scale = float(np.sqrt(strict.target_size[0] * strict.target_size[1]))
    problem = SmoothingProblem.build(c, 1 / np.sqrt(used.weights), scale)
    if smoothing is None:  # both components share one λ: the one that varies more decides
        smoothing = best_smoothing(problem, g[:, int(np.argmax(g.std(axis=0)))], np.ones(len(c)))
    radial, slope = solve_paper(c, g, direction, smoothing * scale**2, problem.noise**2)
    fading_part = np.linalg.norm(g if strict.fade == "infinity" else radial.at(c), axis=1)
    residual = g - radial.at(c) - (c @ slope[:2] + slope[2])[:, None] * direction
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    fit = Fit(
        strict.fit.inliers_used, smoothing, fade_width(fading_part, matches.scale), rms, strict.fit.held_out_px,
        strict.fit.negative_share,
    )  # fmt: skip
    return PaperField(strict, radial, slope, direction, fit)


def solve_paper(
    c: Array, g: Array, direction: Array, smoothing: float, noise: Array
) -> tuple[ThinPlateSpline, Array]:
    """Minimise |(Φ + ρ)w + u₁Mm − g_x|² + |(Φ + ρ)w' + u₂Mm − g_y|² subject to Mᵀw = Mᵀw' = 0; ρ = 8πλ·noise.

    c, g (N, 2) px; direction u (2,); smoothing λ in px²; noise (N,), relative. Returns the radial part and m (3,). With
    S = Φ + ρ, residuals in the span of S⁻¹M cannot be reached by S w under the constraint: m minimises those (6
    equations), and w then solves the rest exactly.
    """
    n = len(c)
    system = kernel(c, c) + 8 * np.pi * smoothing * np.diag(noise)
    polynomial = np.column_stack([c, np.ones(n)])
    factors = scipy.linalg.lu_factor(system)
    unreachable = np.linalg.qr(scipy.linalg.lu_solve(factors, polynomial / np.abs(polynomial).max(axis=0)))[0]
    projected = unreachable.T @ polynomial
    unit = np.abs(projected).max(axis=0)
    equations = np.vstack([direction[0] * projected, direction[1] * projected]) / unit
    slope = np.linalg.lstsq(equations, (unreachable.T @ g).T.ravel(), rcond=None)[0] / unit
    rest = g - np.outer(polynomial @ slope, direction)
    weights = scipy.linalg.lu_solve(factors, rest - unreachable @ (unreachable.T @ rest))
    # normalised, r = s ρ: φ(r) = s² (φ(ρ) + ½ρ² ln s²), whose second part sums to a constant under the constraints
    centre, scale = c.mean(axis=0), max(float(np.abs(c - c.mean(axis=0)).max()), 1e-9)
    centres = (c - centre) / scale
    weights = weights * scale**2
    constant = 0.5 * np.log(scale**2) * (np.sum(centres**2, axis=1) @ weights)
    affine = np.vstack([np.zeros((2, 2)), constant])
    return ThinPlateSpline(centres, weights, affine, centre, scale), slope
