"""The strict field: one scalar, inverse depth d in units of 1 / baseline, for every point of the canvas.

The target pixel of a canvas point p is x'(p) ~ H_inf p + d(p) e' (docs/method.md, 2; displacing along epipolar lines
is an idea of Yu and Da, arXiv 2311.16637). d is affine exactly where the scene is a plane, so a thin-plate spline for
d bends only where matches ask for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.grid import Grid
from ..raster.robust import NORMAL_MEDIAN
from ..system.errors import DegenerateGeometry
from .fade import fade_width, fading, on_nodes, outside_overlap
from .field import FieldValues, Fit
from .options import FADE, STRICT
from .plane import beyond_reference, continued_plane, fit_plane
from .spline import SmoothingProblem, ThinPlateSpline, spread_points
from .transfer import inverse_depths, target_points


@dataclass(frozen=True)
class StrictField:
    """d(p) = m·p + α(p) g(p): a plane plus a spline, which fades outside the overlap.

    size, target_size: (W, H) px; plane (3,): m on homogeneous reference pixels; spline: g; fade: "plane", or "infinity"
    where m fades as well. Without parallax (e' = 0) d is 0 everywhere.
    """

    two_view: TwoView
    size: tuple[int, int]
    target_size: tuple[int, int]
    plane: Array
    spline: ThinPlateSpline
    fit: Fit
    fade: str = "plane"

    name = "strict"

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Inverse depth at a grid's nodes; ideal (rows, columns, 2): see `Field.on_grid`."""
        return FieldValues(self.with_fade(grid, ideal)[0], far=self.far)

    @property
    def far(self) -> Array:
        """The plane (3,) that d equals beyond the fade: m, or 0 for infinity."""
        return np.zeros(3) if self.fade == "infinity" else self.plane

    def with_fade(
        self, grid: Grid, ideal: Array | None = None, bend: Array | None = None
    ) -> tuple[Array, Array]:
        """Inverse depth (rows, columns) at a grid's nodes, and their distances (rows, columns) from the overlap, px.

        ideal: see `Field.on_grid`; bend (rows, columns): values of the spline there, evaluated if not given.
        """
        points = grid.points if ideal is None else ideal
        plane = points @ self.plane[:2] + self.plane[2]
        if bend is None:
            bend = on_nodes(self.spline, grid, ideal)
        target = target_points(self.two_view, points, plane + bend)
        distance = outside_overlap(grid, target, self.size, self.target_size)
        alpha = fading(distance, self.fit.fade_px)
        return (alpha * (plane + bend) if self.fade == "infinity" else plane + alpha * bend), distance

    def at(self, points: Array) -> Array:
        """Inverse depth (N,) at points (N, 2) px in the overlap, where nothing fades."""
        result: Array = points @ self.plane[:2] + self.plane[2] + self.spline.at(points)
        return result

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px in the overlap, where nothing fades."""
        return target_points(self.two_view, points, self.at(points))

    def refitted(self, matches: Matches) -> StrictField:
        """The spline fitted to other matches, none dropped, with the same λ; the plane stays, since the spline contains
        the affine functions. Raises DegenerateGeometry."""
        refuse_no_spread(matches.x, matches.scale)
        fit = replace(self.fit, inliers_used=np.full(len(matches), True))
        if not self.two_view.e_prime.any():
            return replace(self, fit=fit)
        d, sensitivity = inverse_depths(self.two_view, matches.x, matches.y)
        noise = np.median(sensitivity) / sensitivity / np.sqrt(matches.weights)
        problem = SmoothingProblem.build(matches.x, noise, float(np.sqrt(self.size[0] * self.size[1])))
        g = d - (matches.x @ self.plane[:2] + self.plane[2])
        return replace(self, spline=problem.solve(g, self.fit.smoothing)[0], fit=fit)


def fit_strict(
    two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int], fade: str = "plane"
) -> StrictField:
    """Fits the strict field to inlier matches (docs/method.md, 4).

    Parameters
    ----------
    two_view : TwoView
    matches : Matches
        Inliers of `two_view`, ideal px. Matches given by the user are never dropped.
    size, target_size : (int, int)
        (W, H) px of the reference and of the target.
    fade : {"plane", "infinity"}
        What the field fades to outside the overlap.

    Returns
    -------
    StrictField

    Raises
    ------
    DegenerateGeometry
        Too few matches determine a depth, they lie in one spot or on a line, or they lie behind the target camera.
    """
    if not two_view.e_prime.any():
        return _without_parallax(two_view, matches, size, target_size, fade)
    x, y = matches.x, matches.y
    d, sensitivity = inverse_depths(two_view, x, y)
    usable = np.isfinite(d) & np.isfinite(sensitivity)
    # close to the epipole the line is seen end-on, and a pixel says nothing about d
    usable &= sensitivity > STRICT.min_relative_sensitivity * np.median(sensitivity[usable]) if usable.any() else usable
    if usable.sum() < STRICT.min_centres:
        raise DegenerateGeometry(
            f"only {int(usable.sum())} of {len(x)} matches tell a depth, at least {STRICT.min_centres} needed: "
            "the camera moved too little, or straight at what it saw"
        )
    index = np.flatnonzero(usable)
    unit = float(np.sqrt(size[0] * size[1]))
    noise_px = max(two_view.sigma, STRICT.noise_floor_px * matches.scale)
    weight = matches.weights[index]
    plane = fit_plane(x[index], d[index], sensitivity[index] * np.sqrt(weight), noise_px)
    beyond = beyond_reference(two_view.H_inf + np.outer(two_view.e_prime, plane), size, target_size)
    if len(beyond):
        tolerance = 3 * max(noise_px, STRICT.plane_noise_px * matches.scale)
        plane = continued_plane(x[index], d[index], sensitivity[index], weight, beyond, unit, tolerance, noise_px)
    off_line_px = np.linalg.norm(target_points(two_view, x[index], d[index]) - y[index], axis=1)
    index = _thinned(matches, index, off_line_px, unit)
    refuse_no_spread(x[index], matches.scale)
    g = d - (x @ plane[:2] + plane[2])
    index, spline, residual, smoothing, held_out_px = _prune_and_smooth(matches, g, sensitivity, index, unit)
    s = sensitivity[index]
    # the part of d that fades: the spline, or all of it
    fading_part = spline.at(x[index]) + (x[index] @ plane[:2] + plane[2] if fade == "infinity" else 0.0)
    inliers_used = np.zeros(len(x), bool)
    inliers_used[index] = True
    fit = Fit(
        inliers_used, smoothing, fade_width(s * np.abs(fading_part), matches.scale),
        residual_px=float(np.sqrt(np.mean((s * residual) ** 2))), held_out_px=held_out_px,
        negative_share=float(np.mean(d[index] < 0)),
    )  # fmt: skip
    return StrictField(two_view, size, target_size, plane, spline, fit, fade)


def _thinned(matches: Matches, index: NDArray[np.intp], error_px: Array, unit: float) -> NDArray[np.intp]:
    """Of the matches `index` (n,) with error_px (n,) as many as a spline can have for centres, evenly spread; matches
    given by the user are thinned only where they are more. unit: √(W·H) px."""
    if matches.given and len(index) <= STRICT.max_centres:
        return index
    cell = unit / STRICT.thinning_cells
    return index[spread_points(matches.x[index], error_px / matches.weights[index], STRICT.max_centres, cell)]


def refuse_no_spread(x: Array, scale: float) -> None:
    """Raises DegenerateGeometry where points (N, 2) px with a noise of about `scale` px are too few for a spline, or
    spread by less than their noise across a line."""
    if len(x) < STRICT.min_centres or np.linalg.svd(x - x.mean(axis=0), compute_uv=False)[-1] / np.sqrt(len(x)) < scale:
        raise DegenerateGeometry("the matches do not determine a displacement field: they lie in one spot or on a line")


def _without_parallax(
    two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int], fade: str
) -> StrictField:
    """The field with d = 0 everywhere, of pictures that differ by the homography H_inf alone."""
    zero = ThinPlateSpline(np.empty((0, 2)), np.empty(0), np.zeros(3), np.zeros(2), 1.0)
    error_px = np.linalg.norm(target_points(two_view, matches.x, np.zeros(len(matches))) - matches.y, axis=1)
    index = np.flatnonzero(np.isfinite(error_px))
    if not len(index):
        raise DegenerateGeometry(
            "all that the two pictures share would lie behind the second camera: check whether one is mirrored, and the"
            " focal lengths and principal points, if given"
        )
    rms = float(np.sqrt(np.mean(error_px[index] ** 2)))
    inliers_used = np.zeros(len(matches), bool)
    inliers_used[_thinned(matches, index, error_px[index], float(np.sqrt(size[0] * size[1])))] = True
    fit = Fit(inliers_used, STRICT.initial_smoothing, FADE.min_px * matches.scale, rms, rms, 0.0)
    return StrictField(two_view, size, target_size, np.zeros(3), zero, fit, fade)


def _prune_and_smooth(
    matches: Matches, g: Array, sensitivity: Array, index: NDArray[np.intp], unit: float
) -> tuple[NDArray[np.intp], ThinPlateSpline, Array, float, float]:
    """Fits the spline of g (all matches, N) to the matches `index` (n,), without outliers along their epipolar lines,
    which pass every epipolar test.

    Gross errors are dropped by a first spline, λ is chosen, and what lies beyond a few σ is dropped until none does.
    sensitivity (N,): px per unit of d; unit: √(W·H) px. Returns the remaining indices, the spline, its residuals
    (units of d), λ and the leave-one-out RMS in px.
    """
    floor = STRICT.outlier_floor_px * matches.scale
    s = sensitivity[index]
    problem = SmoothingProblem.build(matches.x[index], np.median(s) / s / np.sqrt(matches.weights[index]), unit)
    protected = np.full(len(index), True) if matches.given else _supported(matches.x[index], g[index], s, floor)
    inverse = problem.inverse(STRICT.initial_smoothing)
    remaining = np.full(len(index), True)

    def drop_others(accepted: NDArray[np.bool_]) -> bool:
        """Drops matches that are neither accepted nor protected by their neighbours; whether there were any."""
        nonlocal index, inverse, protected
        keep = accepted | protected
        if keep.all() or keep.sum() < STRICT.min_centres:
            return False
        index, inverse, protected = index[keep], inverse.subset(keep), protected[keep]
        remaining[remaining] = keep
        return True

    # gross errors bend the spline towards themselves, so each is judged by the spline without it
    while True:
        error = np.abs(sensitivity[index] * inverse.held_out(g[index]))
        if not drop_others(error <= max(STRICT.gross_error_sigmas * np.median(error) / NORMAL_MEDIAN, floor)):
            break
    problem, remaining = problem.subset(remaining), remaining[remaining]
    smoothing = best_smoothing(problem, g[index], sensitivity[index])
    inverse = problem.inverse(smoothing)
    while True:
        error = np.abs(sensitivity[index] * inverse.residual(g[index]))
        if not drop_others(error <= max(STRICT.outlier_sigmas * np.sqrt(np.mean(error**2)), floor)):
            break
    held_out = sensitivity[index] * inverse.held_out(g[index])
    spline, residual = problem.subset(remaining).solve(g[index], smoothing)
    return index, spline, residual, smoothing, float(np.sqrt(np.mean(held_out**2)))


def _supported(x: Array, g: Array, sensitivity: Array, tolerance: float) -> NDArray[np.bool_]:
    """Which points (N,) agree with enough of their nearest neighbours, to within `tolerance` px along the line.

    An object in front of a wall is as far from the spline as an outlier, but several matches agree on it: without this,
    pruning would peel it off from its edges inwards. x (N, 2) px, g (N,), sensitivity (N,) px per unit of g.
    """
    if len(x) <= STRICT.neighbours:
        return np.zeros(len(x), bool)
    distance2 = np.subtract.outer(x[:, 0], x[:, 0]) ** 2 + np.subtract.outer(x[:, 1], x[:, 1]) ** 2
    np.fill_diagonal(distance2, np.inf)
    nearest = np.argpartition(distance2, STRICT.neighbours, axis=1)[:, :STRICT.neighbours]
    agrees = np.abs(g[nearest] - g[:, None]) * sensitivity[:, None] <= tolerance
    result: NDArray[np.bool_] = agrees.sum(axis=1) >= STRICT.agreeing_neighbours
    return result


def best_smoothing(
    problem: SmoothingProblem, g: Array, sensitivity: Array, ladder: Array = STRICT.smoothing_ladder
) -> float:
    """The λ of the ladder with the least leave-one-out error in px.

    Large errors count linearly, not squared: a few depth edges must not decide for the whole picture.

    Parameters
    ----------
    problem : SmoothingProblem
    g : (N,) or (N, 2) array
        Values at its points, one or two components.
    sensitivity : (N,) array
        px per unit of g.
    ladder : (n,) array
        The λ to choose from.

    Returns
    -------
    float
    """
    error = problem.held_out(g, ladder)
    error = (np.abs(error) if g.ndim == 1 else np.linalg.norm(error, axis=-1)) * sensitivity
    return float(ladder[int(np.argmin(robust_mean(error)))])


def robust_mean(error: Array) -> Array:
    """Mean (n,) of Huber's loss over each row of errors (n, N) ≥ 0: squared up to three medians, linear beyond."""
    knee = 3 * np.median(error, axis=1, keepdims=True) + 1e-12
    result: Array = np.where(error < knee, error**2, knee * (2 * error - knee)).mean(axis=1)
    return result
