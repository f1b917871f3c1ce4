"""The epipolar displacement field: one scalar d, inverse depth in baselines, for every point of the canvas.

Target pixel of a canvas point p: x'(p) ~ H_inf p + d(p) e' (docs/method.md, 2; the idea of sliding along epipolar
lines: Yu and Da, arXiv 2311.16637). d is affine exactly where the scene is a plane, so a thin-plate spline for d bends
only where matches ask for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.grid import Grid
from ..system.errors import DegenerateGeometry
from .fade import fade_width, fading, on_nodes, outside_overlap
from .field import FieldValues, Fit
from .plane import beyond_reference, continued_plane, fit_plane
from .spline import SmoothingProblem, ThinPlateSpline, spread_points
from .transfer import inverse_depths, target_points

CENTRE_BUDGET = 1000
# λ in units of W·H of the reference: where the search for the best one starts, and how far it goes.
SMOOTHING_START = 1e-3
SMOOTHING_LADDER = SMOOTHING_START * 10.0 ** np.arange(-3.0, 2.01, 0.5)
PRUNE_SIGMAS = 3.0
GROSS_DEVIATIONS = 10.0
# Whatever σ says, an error this small (px) is no outlier; and so much agreement among the nearest makes a thing.
PRUNE_FLOOR_PX, NEIGHBOURS, SUPPORT = 1.0, 8, 3
MIN_CENTRES = 8
# Flat things are flat to this much at least, in units of the matches' scale.
PLANE_PX = 0.3


@dataclass(frozen=True)
class StrictField:
    """d(p) = m·p + α(p) g(p): a plane, and a spline of what the plane leaves, faded out beyond the overlap.

    plane (3,): m on homogeneous reference pixels; spline: g; fade: to the plane, or to infinity (m fades too). Where
    there is no parallax (e' = 0) d is 0 everywhere.
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
        """Inverse depth, float64, at a grid's nodes.

        ideal (rows, columns, 2): the nodes' ideal pixels, where the reference's lens bends its picture.
        """
        return FieldValues(self.with_fade(grid, ideal)[0], far=self.far)

    @property
    def far(self) -> Array:
        """The plane (3,) that d ends in beyond the fade: m, or infinity."""
        return np.zeros(3) if self.fade == "infinity" else self.plane

    def with_fade(
        self, grid: Grid, ideal: Array | None = None, bend: Array | None = None
    ) -> tuple[Array, Array]:
        """Inverse depth, and how many px outside the overlap, each (rows, columns), at a grid's nodes; bend: the spline
        there, if known."""
        points = grid.points if ideal is None else ideal
        plane = points @ self.plane[:2] + self.plane[2]
        if bend is None:
            bend = on_nodes(self.spline, grid, ideal)
        target = target_points(self.two_view, points, plane + bend)
        away = outside_overlap(grid, target, self.size, self.target_size)
        alpha = fading(away, self.fit.fade_px)
        return (alpha * (plane + bend) if self.fade == "infinity" else plane + alpha * bend), away

    def at(self, points: Array) -> Array:
        """Inverse depth (N,) at points (N, 2) of the overlap, where nothing fades."""
        return points @ self.plane[:2] + self.plane[2] + self.spline.at(points)

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades."""
        return target_points(self.two_view, points, self.at(points))

    def refitted(self, matches: Matches) -> StrictField:
        """A spline on other matches of the pair, all kept, at the same λ; the plane stays, since whatever is affine in
        d the spline takes up. Raises DegenerateGeometry."""
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
    """The strict field of inlier matches (docs/method.md, 4).

    size, target_size: (W, H) px; fade: one of FADES. Matches given by the user are all kept. Raises DegenerateGeometry.
    """
    if not two_view.e_prime.any():
        return _without_parallax(two_view, matches, size, target_size, fade)
    x, y = matches.x, matches.y
    d, sensitivity = inverse_depths(two_view, x, y)
    usable = np.isfinite(d) & np.isfinite(sensitivity)
    # where the line is seen end-on (beside the epipole) a pixel says nothing about d
    usable &= sensitivity > 1e-3 * np.median(sensitivity[usable]) if usable.any() else usable
    if usable.sum() < MIN_CENTRES:
        raise DegenerateGeometry(
            f"only {int(usable.sum())} of {len(x)} matches tell a depth, at least {MIN_CENTRES} needed: "
            "the camera moved too little, or straight at what it saw"
        )
    index = np.flatnonzero(usable)
    unit = float(np.sqrt(size[0] * size[1]))
    noise_px = max(two_view.sigma, 0.1 * matches.scale)
    weight = matches.weights[index]
    plane = fit_plane(x[index], d[index], sensitivity[index] * np.sqrt(weight), noise_px)
    beyond = beyond_reference(two_view.H_inf + np.outer(two_view.e_prime, plane), size, target_size)
    if len(beyond):
        tolerance = 3 * max(noise_px, PLANE_PX * matches.scale)
        plane = continued_plane(x[index], d[index], sensitivity[index], weight, beyond, unit, tolerance, noise_px)
    off_line = np.linalg.norm(target_points(two_view, x[index], d[index]) - y[index], axis=1)
    index = _thinned(matches, index, off_line, unit)
    refuse_no_spread(x[index], matches.scale)
    g = d - (x @ plane[:2] + plane[2])
    index, spline, residual, smoothing, held_out_px = _prune_and_smooth(matches, g, sensitivity, index, unit)
    s = sensitivity[index]
    # what fades: the bend, or all of d
    fading = spline.at(x[index]) + (x[index] @ plane[:2] + plane[2] if fade == "infinity" else 0.0)
    kept = np.zeros(len(x), bool)
    kept[index] = True
    fit = Fit(
        kept, smoothing, fade_width(s * np.abs(fading), matches.scale),
        residual_px=float(np.sqrt(np.mean((s * residual) ** 2))), held_out_px=held_out_px,
        negative_share=float(np.mean(d[index] < 0)),
    )  # fmt: skip
    return StrictField(two_view, size, target_size, plane, spline, fit, fade)


def _thinned(matches: Matches, index: NDArray[np.intp], off: Array, unit: float) -> NDArray[np.intp]:
    """As many of the matches `index` (n,), off (n,) px where they should be, as a spline can bear; of those the user
    gave all, up to that."""
    if matches.given and len(index) <= CENTRE_BUDGET:
        return index
    return index[spread_points(matches.x[index], off / matches.weights[index], CENTRE_BUDGET, unit / 200)]


def refuse_no_spread(x: Array, scale: float) -> None:
    """Raises DegenerateGeometry where points (N, 2) with noise of the unit `scale` px are too few for a spline, or lie
    on a line."""
    if len(x) < MIN_CENTRES or np.linalg.svd(x - x.mean(axis=0), compute_uv=False)[-1] / np.sqrt(len(x)) < scale:
        raise DegenerateGeometry("the matches do not determine a displacement field: they lie in one spot or on a line")


def _without_parallax(
    two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int], fade: str
) -> StrictField:
    """d = 0 everywhere: the pictures differ by a homography alone."""
    nothing = ThinPlateSpline(np.empty((0, 2)), np.empty(0), np.zeros(3), np.zeros(2), 1.0)
    off = np.linalg.norm(target_points(two_view, matches.x, np.zeros(len(matches))) - matches.y, axis=1)
    index = np.flatnonzero(np.isfinite(off))
    if not len(index):
        raise DegenerateGeometry(
            "all that the two pictures share would lie behind the second camera: check whether one is mirrored, and the"
            " focal lengths and principal points, if given"
        )
    rms = float(np.sqrt(np.mean(off[index] ** 2)))
    kept = np.zeros(len(matches), bool)
    kept[_thinned(matches, index, off[index], float(np.sqrt(size[0] * size[1])))] = True
    fit = Fit(kept, SMOOTHING_START, 8 * matches.scale, rms, rms, 0.0)
    return StrictField(two_view, size, target_size, np.zeros(3), nothing, fit, fade)


def _prune_and_smooth(
    matches: Matches, g: Array, sensitivity: Array, index: NDArray[np.intp], unit: float
) -> tuple[NDArray[np.intp], ThinPlateSpline, Array, float, float]:
    """Drop what lies beyond 3σ of the spline (outliers along the line pass every epipolar test), choose λ, drop again,
    until stable.

    Returns the kept indices, the spline, its residuals, λ and the leave-one-out RMS in px.
    """
    floor = PRUNE_FLOOR_PX * matches.scale
    s = sensitivity[index]
    problem = SmoothingProblem.build(matches.x[index], np.median(s) / s / np.sqrt(matches.weights[index]), unit)
    supported = np.full(len(index), True) if matches.given else _supported(matches.x[index], g[index], s, floor)
    inverse = problem.inverse(SMOOTHING_START)
    left = np.full(len(index), True)

    def drop(keep: NDArray[np.bool_]) -> bool:
        """Take out what neither the threshold nor its neighbours keep; says whether anything went."""
        nonlocal index, inverse, supported
        keep = keep | supported
        if keep.all() or keep.sum() < MIN_CENTRES:
            return False
        index, inverse, supported = index[keep], inverse.subset(keep), supported[keep]
        left[left] = keep
        return True

    # gross errors first: they would bend the spline towards themselves, so each is judged by the spline without it
    while True:
        error = np.abs(sensitivity[index] * inverse.held_out(g[index]))
        if not drop(error <= max(GROSS_DEVIATIONS * np.median(error) / 0.6745, floor)):
            break
    problem, left = problem.subset(left), left[left]
    smoothing = best_smoothing(problem, g[index], sensitivity[index])
    inverse = problem.inverse(smoothing)
    while True:
        error = np.abs(sensitivity[index] * inverse.residual(g[index]))
        if not drop(error <= max(PRUNE_SIGMAS * np.sqrt(np.mean(error**2)), floor)):
            break
    held_out = sensitivity[index] * inverse.held_out(g[index])
    spline, residual = problem.subset(left).solve(g[index], smoothing)
    return index, spline, residual, smoothing, float(np.sqrt(np.mean(held_out**2)))


def _supported(x: Array, g: Array, sensitivity: Array, tolerance: float) -> NDArray[np.bool_]:
    """Which points (N,) agree with at least three of their eight nearest to within `tolerance` px along the line.

    A thing in front of a wall is as far from the spline as an outlier, but it does not stand alone: without this,
    pruning would peel it off from its edges inwards.
    """
    if len(x) <= NEIGHBOURS:
        return np.zeros(len(x), bool)
    apart = np.subtract.outer(x[:, 0], x[:, 0]) ** 2 + np.subtract.outer(x[:, 1], x[:, 1]) ** 2
    np.fill_diagonal(apart, np.inf)
    nearest = np.argpartition(apart, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    agrees = np.abs(g[nearest] - g[:, None]) * sensitivity[:, None] <= tolerance
    return agrees.sum(axis=1) >= SUPPORT


def best_smoothing(problem: SmoothingProblem, g: Array, sensitivity: Array) -> float:
    """λ of the ladder with the least leave-one-out error in px; g (N,) or, in two components, (N, 2).

    Large errors count in proportion, not squared: a few depth edges must not decide for the whole picture.
    """
    error = problem.held_out(g, SMOOTHING_LADDER)
    error = (np.abs(error) if g.ndim == 1 else np.linalg.norm(error, axis=-1)) * sensitivity
    return float(SMOOTHING_LADDER[int(np.argmin(robust_mean(error)))])


def robust_mean(error: Array) -> Array:
    """Mean square of each row (n,) of errors (n, N) ≥ 0, in which large ones count in proportion."""
    knee = 3 * np.median(error, axis=1, keepdims=True) + 1e-12
    return np.where(error < knee, error**2, knee * (2 * error - knee)).mean(axis=1)
