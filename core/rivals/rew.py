"""REW, robust elastic warping (Li, Wang, Lai, Zhai and Zhang, IEEE Transactions on Multimedia 2018).

A global transformation, by a rotation and focal lengths where they serve, fitted robustly; a thin-plate spline of two
components of what it leaves at the matches; matches whose spline weights lie beyond 3σ are outliers, until none is
left; outside the overlap the spline fades, and the global transformation goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, infinite_homography, inverse_intrinsics, project, rotation_from_vector
from ..cameras.two_view import TwoView
from ..field.fade import fade_width, fading, outside_overlap
from ..field.field import FieldValues, Fit
from ..field.options import STRICT
from ..field.spline import SmoothingProblem, ThinPlateSpline
from ..field.strict import StrictField, best_smoothing, refuse_no_spread
from ..field.transfer import target_points
from ..pose.fundamental import transfer_error
from ..pose.rotation import nearest_rotation
from ..raster.arrays import Array
from ..raster.grid import Grid
from .homography import fit_one_homography, knowing_only
from .options import REW


@dataclass(frozen=True)
class RewField:
    """x' = c + α g(c), c = π(H p): H, the global transformation, in the place of H_inf, g a spline in target px over
    c."""

    two_view: TwoView
    size: tuple[int, int]
    target_size: tuple[int, int]
    spline: ThinPlateSpline
    fit: Fit

    name = "rew"

    @property
    def plane(self) -> Array:
        """It fades to the global transformation."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H p) at a grid's nodes; no depth."""
        points = grid.points if ideal is None else ideal
        c, bend = (part.reshape(points.shape) for part in self._parts(points.reshape(-1, 2)))
        alpha = fading(outside_overlap(grid, c + bend, self.size, self.target_size), self.fit.fade_px)
        return FieldValues(np.full(points.shape[:2], np.nan), alpha[..., None] * bend)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades."""
        c, bend = self._parts(points)
        return c + bend

    def refitted(self, matches: Matches) -> RewField:
        """The spline on other matches, all kept, at the same λ. Raises DegenerateGeometry."""
        kept = np.full(len(matches), True)
        return _bent(self.two_view, self.size, self.target_size, matches, kept, self.fit.smoothing)

    def _parts(self, points: Array) -> tuple[Array, Array]:
        """c, NaN behind the target camera, and g there, each (N, 2)."""
        c = target_points(self.two_view, points, np.full(len(points), np.nan))
        return c, self.spline.at(np.where(np.isfinite(c), c, 0.0))


def fit_rew(strict: StrictField, matches: Matches) -> RewField:
    """REW on the matches that the strict field stands on, which are without gross outliers already.

    λ by the house's cross-validation, where the paper has one for all pictures (0.001·W·H: 0 to 3 dB worse here).
    Matches given by the user are all kept. Raises DegenerateGeometry.
    """
    few = matches.subset(strict.fit.inliers_used)
    view = knowing_only(strict.two_view, global_transformation(strict.two_view, few))
    return _bent(view, strict.size, strict.target_size, matches, strict.fit.inliers_used, None)


def global_transformation(two_view: TwoView, matches: Matches) -> Array:
    """H (3, 3): K' R K⁻¹ that has the matches nearest, robustly (Cauchy), over R and a common factor of the focal
    lengths; the homography where that has them nearer by far.

    The paper has a rotation only; where the camera really moved it leaves so much to the spline that what lies beyond
    the overlap is off by tens of px. Raises DegenerateGeometry.
    """
    from scipy.optimize import least_squares  # takes long to load, and other fields do without

    H = fit_one_homography(two_view, matches).two_view.H_inf
    K, K_prime, x = two_view.K, two_view.K_prime, homogeneous(matches.x)
    start = nearest_rotation(inverse_intrinsics(K_prime) @ H @ K)

    def transformation(p: Array) -> Array:
        first, second = K.copy(), K_prime.copy()
        first[:2, :2] *= np.exp(p[3])
        second[:2, :2] *= np.exp(p[3])
        return infinite_homography(first, second, rotation_from_vector(p[:3]) @ start)

    def residuals(p: Array) -> Array:
        ray = x @ transformation(p).T
        with np.errstate(divide="ignore", invalid="ignore"):
            off = project(ray) - matches.y
        off = np.where(ray[:, 2:] > 0, np.clip(off, -REW.max_error_px, REW.max_error_px), REW.max_error_px)
        return (off * np.sqrt(matches.weights)[:, None]).ravel()

    scale = max(float(np.median(np.abs(residuals(np.zeros(4))))), REW.noise_floor_px * matches.scale)
    bound = np.array([np.pi, np.pi, np.pi, np.log(REW.max_zoom)])
    found = least_squares(
        residuals, np.zeros(4), bounds=(-bound, bound), loss="cauchy", f_scale=scale, max_nfev=REW.max_evaluations
    )
    rotated = transformation(found.x)
    off, off_rotated = (float(np.median(transfer_error(M, matches))) for M in (H, rotated))
    serves = off_rotated <= max(REW.max_error_ratio * off, REW.max_rotation_px * matches.scale)
    return rotated / np.linalg.norm(rotated) if serves else H


def _bent(
    view: TwoView, size: tuple[int, int], target_size: tuple[int, int], matches: Matches, kept: NDArray[np.bool_],
    smoothing: float | None,
) -> RewField:  # fmt: skip
    """The field over a global transformation; smoothing: λ, all `kept` matches stay then; else it is found, and what
    lies beyond 3σ goes."""
    index = np.flatnonzero(kept)
    c = target_points(view, matches.x[index], np.full(len(index), np.nan))
    seen = np.isfinite(c).all(axis=1)
    index, c = index[seen], c[seen]
    refuse_no_spread(matches.x[index], matches.scale)
    g = matches.y[index] - c
    unit = float(np.sqrt(size[0] * size[1]))
    problem = SmoothingProblem.build(c, 1 / np.sqrt(matches.weights[index]), unit)
    prune = smoothing is None and not matches.given
    if smoothing is None:
        smoothing = best_smoothing(problem, g, np.ones(len(g)))
    while True:
        # residuals are the weights times 8πλ
        spline, residual = problem.solve(g, smoothing)
        sigma = np.sqrt(np.mean(residual**2, axis=0))
        limit = np.maximum(STRICT.outlier_sigmas * sigma, STRICT.outlier_floor_px * matches.scale)
        good = (np.abs(residual) <= limit).all(axis=1)
        if not prune or good.all() or good.sum() < STRICT.min_centres:
            break
        problem, index, g = problem.subset(good), index[good], g[good]
    left = np.full(len(matches), False)
    left[index] = True
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    moved = np.linalg.norm(g - residual, axis=1)
    fit = Fit(left, smoothing, fade_width(moved, matches.scale), rms, np.nan, np.nan)
    return RewField(view, size, target_size, spline, fit)
