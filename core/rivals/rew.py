"""REW, robust elastic warping (Li, Wang, Lai, Zhai and Zhang, IEEE Transactions on Multimedia 2018).

A robust global transformation, a rotation with focal lengths where that fits; a thin-plate spline of two components
through its residuals; matches whose spline weights lie beyond 3σ are dropped until none does; outside the overlap the
spline fades and the global transformation continues.
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
    """x' = c + α g(c), c = π(H p): H, the global transformation, stands in two_view in place of H_inf; spline: g, in
    target px over c; size, target_size: (W, H) px."""

    two_view: TwoView
    size: tuple[int, int]
    target_size: tuple[int, int]
    spline: ThinPlateSpline
    fit: Fit

    name = "rew"

    @property
    def plane(self) -> Array:
        """0 (3,): it fades to the global transformation."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Shift from π(H p) at a grid's nodes; d is NaN."""
        points = grid.points if ideal is None else ideal
        c, bend = (part.reshape(points.shape) for part in self._parts(points.reshape(-1, 2)))
        alpha = fading(outside_overlap(grid, c + bend, self.size, self.target_size), self.fit.fade_px)
        return FieldValues(np.full(points.shape[:2], np.nan), alpha[..., None] * bend)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px in the overlap, where nothing fades."""
        c, bend = self._parts(points)
        return c + bend

    def refitted(self, matches: Matches) -> RewField:
        """The spline fitted to other matches, none dropped, with the same λ. Raises DegenerateGeometry."""
        every = np.full(len(matches), True)
        return _with_spline(self.two_view, self.size, self.target_size, matches, every, self.fit.smoothing)

    def _parts(self, points: Array) -> tuple[Array, Array]:
        """c, NaN behind the target camera, and g there, each (N, 2) px, for points (N, 2) px."""
        c = target_points(self.two_view, points, np.full(len(points), np.nan))
        return c, self.spline.at(np.where(np.isfinite(c), c, 0.0))


def fit_rew(strict: StrictField, matches: Matches) -> RewField:
    """Fits REW to the matches of the strict field, which have no gross outliers left.

    λ is found by the strict field's cross-validation; the paper has one for all pictures, which is up to 3 dB worse.

    Parameters
    ----------
    strict : StrictField
    matches : Matches
        The matches that `strict` was given, ideal px; of matches given by the user none is dropped.

    Returns
    -------
    RewField

    Raises
    ------
    DegenerateGeometry
        The matches do not determine a homography or a spline.
    """
    used = matches.subset(strict.fit.inliers_used)
    view = knowing_only(strict.two_view, global_transformation(strict.two_view, used))
    return _with_spline(view, strict.size, strict.target_size, matches, strict.fit.inliers_used, None)


def global_transformation(two_view: TwoView, matches: Matches) -> Array:
    """H (3, 3) = K' R K⁻¹, fitted robustly (Cauchy) over R and a common factor of the focal lengths, or the homography
    where that fits much better.

    The paper has the rotation only: where the camera moved it leaves so much to the spline that the picture beyond the
    overlap is off by tens of px. Raises DegenerateGeometry.
    """
    from scipy.optimize import least_squares  # takes long to load, and other fields do without

    H = fit_one_homography(two_view, matches).two_view.H_inf
    K, K_prime, x = two_view.K, two_view.K_prime, homogeneous(matches.x)
    start = nearest_rotation(inverse_intrinsics(K_prime) @ H @ K)

    def transformation(p: Array) -> Array:
        """H of a rotation vector relative to `start` and the logarithm of the factor, p (4,)."""
        first, second = K.copy(), K_prime.copy()
        first[:2, :2] *= np.exp(p[3])
        second[:2, :2] *= np.exp(p[3])
        return infinite_homography(first, second, rotation_from_vector(p[:3]) @ start)

    def residuals(p: Array) -> Array:
        ray = x @ transformation(p).T
        with np.errstate(divide="ignore", invalid="ignore"):
            off = project(ray) - matches.y
        off = np.where(ray[:, 2:] > 0, np.clip(off, -REW.max_error_px, REW.max_error_px), REW.max_error_px)
        result: Array = (off * np.sqrt(matches.weights)[:, None]).ravel()
        return result

    scale = max(float(np.median(np.abs(residuals(np.zeros(4))))), REW.noise_floor_px * matches.scale)
    bound = np.array([np.pi, np.pi, np.pi, np.log(REW.max_zoom)])
    found = least_squares(
        residuals, np.zeros(4), bounds=(-bound, bound), loss="cauchy", f_scale=scale, max_nfev=REW.max_evaluations
    )
    rotated = transformation(found.x)
    off, off_rotated = (float(np.median(transfer_error(M, matches))) for M in (H, rotated))
    fits = off_rotated <= max(REW.max_error_ratio * off, REW.max_rotation_px * matches.scale)
    return rotated / np.linalg.norm(rotated) if fits else H


def _with_spline(
    view: TwoView, size: tuple[int, int], target_size: tuple[int, int], matches: Matches, used: NDArray[np.bool_],
    smoothing: float | None,
) -> RewField:  # fmt: skip
    """The field over a global transformation, from the matches that the mask `used` (N,) selects.

    smoothing: λ, and then no match is dropped; None: λ is found, and outliers are dropped.
    """
    index = np.flatnonzero(used)
    c = target_points(view, matches.x[index], np.full(len(index), np.nan))
    in_front = np.isfinite(c).all(axis=1)
    index, c = index[in_front], c[in_front]
    refuse_no_spread(matches.x[index], matches.scale)
    g = matches.y[index] - c
    unit = float(np.sqrt(size[0] * size[1]))
    problem = SmoothingProblem.build(c, 1 / np.sqrt(matches.weights[index]), unit)
    prune = smoothing is None and not matches.given
    if smoothing is None:
        smoothing = best_smoothing(problem, g, np.ones(len(g)))
    while True:
        # a residual is 8πλ times the spline's weight, so both have the same outliers
        spline, residual = problem.solve(g, smoothing)
        sigma = np.sqrt(np.mean(residual**2, axis=0))
        limit = np.maximum(STRICT.outlier_sigmas * sigma, STRICT.outlier_floor_px * matches.scale)
        good = (np.abs(residual) <= limit).all(axis=1)
        if not prune or good.all() or good.sum() < STRICT.min_centres:
            break
        problem, index, g = problem.subset(good), index[good], g[good]
    inliers_used = np.full(len(matches), False)
    inliers_used[index] = True
    rms = float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))
    displacement = np.linalg.norm(g - residual, axis=1)
    fit = Fit(inliers_used, smoothing, fade_width(displacement, matches.scale), rms, np.nan, np.nan)
    return RewField(view, size, target_size, spline, fit)
