"""Inverse range d(r) on every ray from the viewpoint, fitted to the points of N pictures (docs/method.md).

Picture j sees the ray r at K_j (R_j r + d(r) t_j). Among the points d is a spline that bends only where they ask for
it. Beyond them it fades to another, which anchors hold at the inverse range of the points nearby.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..cameras.rig import Rig
from ..raster.arrays import Array
from ..raster.robust import sigma_of
from ..system.errors import DegenerateGeometry
from ..system.progress import Tick, unwatched
from .sphere_options import SPHERE
from .sphere_points import SpherePoints, angular_unit, points_of, px_scale, seen_at
from .sphere_slack import SphereSlack, fit_sphere_slack
from .sphere_spline import SphereSpline, problem_on_sphere, share_near, solved_on_sphere, squared_chords
from .spline import Inverse, SmoothingProblem, spread_points
from .strict import best_smoothing


@dataclass(frozen=True, eq=False)
class SphereField:
    """d on the sphere, and what each picture is off beside it.

    depth: d; slacks: of each picture, None where it has too few points or none was asked for.
    """

    depth: SphereDepth
    slacks: tuple[SphereSlack | None, ...]

    @property
    def leave_one_out_px(self) -> float:
        """Median px by which the points are off, each predicted without itself."""
        return self.depth.leave_one_out_px

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know."""
        if not self.leave_one_out_px > SPHERE.deep_px * self.depth.px_scale:
            return ()
        return (
            "the scene is too near and deep for the points that were found: half of them lie more than "
            f"{self.leave_one_out_px:.1f} px from where the others say; take more pictures, closer together",
        )

    def at(self, rays: Array) -> Array:
        """Inverse range (…) on unit rays (…, 3)."""
        return self.depth.at(rays)

    def deviation(self, rays: Array) -> Array:
        """Standard deviation (…) of that on unit rays (…, 3)."""
        return np.sqrt(self.depth.doubt.at(rays))

    def renumbered(self, order: Sequence[int]) -> SphereField:
        """The same with the pictures in another order."""
        return replace(self, slacks=tuple(self.slacks[number] for number in order))

    def slack(self, number: int, rays: Array) -> Array | None:
        """px (…, 2), before the lens, by which picture `number` is off on unit rays (…, 3); None if it has none."""
        slack = self.slacks[number]
        return None if slack is None else slack.at(rays)


@dataclass(frozen=True, eq=False)
class SphereDepth:
    """d on the sphere.

    inner: among the points; outer: beyond them, None without points: then d = 0; reach, width: radians from the nearest
    point where it begins to fade, and over which; bounds: least and largest d; doubt: its variance; smoothing: λ;
    leave_one_out_px: see `SphereField`; px_scale: see `sphere_points`.
    """

    inner: SphereSpline
    outer: SphereSpline | None
    reach: float
    width: float
    bounds: tuple[float, float]
    doubt: Nearby
    smoothing: float
    leave_one_out_px: float
    px_scale: float

    def at(self, rays: Array) -> Array:
        """Inverse range (…) on unit rays (…, 3)."""
        flat = rays.reshape(-1, 3)
        out = np.zeros(len(flat))
        if self.outer is not None:
            share = share_near(self.inner.centres * self.inner.unit, flat, self.reach, self.width)
            for spline, part in ((self.inner, share), (self.outer, 1 - share)):
                counts = part > 0
                out[counts] += part[counts] * spline.at(flat[counts])[:, 0]
            np.clip(out, *self.bounds, out=out)
        return out.reshape(rays.shape[:-1])


@dataclass(frozen=True, eq=False)
class Nearby:
    """Means of values (N,) at unit rays (N, 3) around a ray, weighted by 1 / (c² + reach²)², c: chord in radians."""

    rays: Array
    values: Array
    reach: float

    def at(self, rays: Array) -> Array:
        """Values (…) at unit rays (…, 3)."""
        flat = rays.reshape(-1, 3)
        out = np.zeros(len(flat))
        rows = max(1, SPHERE.values_at_once // max(1, len(self.rays)))
        for start in range(0, len(flat) if len(self.rays) else 0, rows):
            weights = 1 / np.square(squared_chords(flat[start : start + rows], self.rays, 1.0) + self.reach**2)
            out[start : start + rows] = weights @ self.values / weights.sum(axis=1)
        return out.reshape(rays.shape[:-1])


def fit_sphere_field(rig: Rig, with_slack: bool = True, tick: Tick = unwatched) -> SphereField:
    """Fit inverse range to the points of a rig, and to each picture what its own points leave.

    Parameters
    ----------
    rig : Rig
    with_slack : bool
        Whether pictures may be off their epipolar lines, where their points are.
    tick : callable
        Called between steps; ends the work by raising.

    Returns
    -------
    SphereField
        d = 0 everywhere if all pictures were taken from one place.

    Raises
    ------
    DegenerateGeometry
        Too few points tell a range.
    """
    # sums round otherwise in another order, and what is chosen by them differs
    order = rig.own_order
    rig = rig.renumbered(order)
    unit = angular_unit(rig)
    depth = _fitted(rig, unit, tick) if rig.t.any() else _without_parallax(unit)
    slacks = []
    for number in range(len(rig)):
        tick()
        slacks.append(fit_sphere_slack(rig, number, depth.at, unit) if with_slack else None)
    return SphereField(depth, tuple(slacks)).renumbered(np.argsort(order).tolist())


def _without_parallax(unit: float) -> SphereDepth:
    """d = 0 everywhere, for pictures from one place."""
    nothing = SphereSpline(np.empty((0, 3)), np.empty((0, 1)), np.zeros((4, 1)), unit)
    sure = Nearby(np.empty((0, 3)), np.empty(0), unit)
    return SphereDepth(nothing, None, 0.0, unit, (0.0, 0.0), sure, np.inf, 0.0, 1.0)


def _fitted(rig: Rig, unit: float, tick: Tick) -> SphereDepth:
    """d by the points of a rig; unit: radians."""
    points, scale = points_of(rig), px_scale(rig)
    if len(points) < SPHERE.min_centres:
        raise DegenerateGeometry(
            f"only {len(points)} points tell how far the scene is, at least {SPHERE.min_centres} needed: the pictures "
            "were taken too close together, or share too little"
        )
    chosen = spread_points(points.rays, points.error_px, SPHERE.max_centres, SPHERE.spacing * unit)
    points, problem, smoothing = _pruned(points.subset(chosen), unit, scale, tick)
    tick()
    values = points.inverse_ranges
    inner, residual = solved_on_sphere(problem, values[:, None], smoothing)
    left_out = problem.inverse(smoothing).held_out(values)
    tick()
    anchors, levels, spreads = _anchors(rig, points, unit)
    rays = np.vstack([points.rays, anchors])
    noise = np.concatenate([points.noise, np.full(len(anchors), _anchor_noise(smoothing))])
    together = np.concatenate([values - residual[:, 0], levels])
    outer, _ = solved_on_sphere(problem_on_sphere(rays, noise, unit), together[:, None], smoothing)
    low, high = np.percentile(values, SPHERE.outer_percents)
    return SphereDepth(
        inner, outer, SPHERE.fade_reach * unit, SPHERE.fade * unit,
        (float(min(low, 0.0)), float(SPHERE.nearest * max(high, 0.0))),
        Nearby(rays, np.concatenate([left_out**2, spreads**2]), SPHERE.doubt_reach * unit), smoothing,
        float(np.median(np.abs(left_out) * points.sensitivity)), scale,
    )  # fmt: skip


def _pruned(
    points: SpherePoints, unit: float, scale: float, tick: Tick
) -> tuple[SpherePoints, SmoothingProblem, float]:
    """Points without gross errors, which a stiff and a flexible spline both miss and no neighbours agree with; and the
    λ that predicts the rest best."""
    problem = problem_on_sphere(points.rays, points.noise, unit)
    protected = _supported(points, scale)
    fits = []
    for smoothing in SPHERE.judging_smoothings:
        tick()
        fits.append(_fitting(points, problem.inverse(smoothing), protected, scale))
    tick()
    keep: NDArray[np.bool_] = np.logical_or.reduce(fits)
    points, problem = points.subset(keep), problem.subset(keep)
    return points, problem, best_smoothing(problem, points.inverse_ranges, points.sensitivity, SPHERE.smoothing_ladder)


def _fitting(points: SpherePoints, inverse: Inverse, protected: NDArray[np.bool_], scale: float) -> NDArray[np.bool_]:
    """Which points (N,) a spline predicts without them, once those that it does not are left out."""
    remaining = np.full(len(points), True)
    floor = SPHERE.gross_error_floor_px * scale
    while True:
        error = np.abs(points.sensitivity * inverse.held_out(points.inverse_ranges))
        keep = (error <= max(SPHERE.gross_error_medians * np.median(error), floor)) | protected
        if keep.all() or keep.sum() < SPHERE.min_centres:
            return remaining
        points, inverse, protected = points.subset(keep), inverse.subset(keep), protected[keep]
        remaining[remaining] = keep


def _supported(points: SpherePoints, scale: float) -> NDArray[np.bool_]:
    """Which points (N,) agree with enough of their nearest neighbours: things in front of a wall do."""
    count = min(SPHERE.neighbours, len(points) - 1)
    _, near = cKDTree(points.rays).query(points.rays, k=count + 1)
    off = np.abs(points.inverse_ranges[near[:, 1:]] - points.inverse_ranges[:, None]) * points.sensitivity[:, None]
    supported: NDArray[np.bool_] = (off <= SPHERE.agreement_px * scale).sum(axis=1) >= SPHERE.agreeing_neighbours
    return supported


def _anchors(rig: Rig, points: SpherePoints, unit: float) -> tuple[Array, Array, Array]:
    """Rays (M, 3) that pictures see far from all points, the median inverse range (M,) of the points nearest to each,
    and their standard deviation (M,)."""
    spacing = SPHERE.anchor_spacing * unit
    rays = even_rays(spacing)
    tree = cKDTree(points.rays)
    far = tree.query(rays)[0] > SPHERE.anchor_reach * spacing
    rays = rays[far]
    _, near = tree.query(rays, k=min(SPHERE.anchor_neighbours, len(points)))
    around = points.inverse_ranges[near]
    levels = np.maximum(np.median(around, axis=1), 0.0)
    spreads = np.array([sigma_of(some - level) for some, level in zip(around, levels, strict=True)])
    seen = np.zeros(len(rays), bool)
    for view in rig.views:
        margin = SPHERE.anchor_margin * max(view.size)
        with np.errstate(invalid="ignore"):
            pixels = seen_at(view, rays, levels)
            seen |= ((pixels >= -margin) & (pixels < np.array(view.size) + margin)).all(axis=1)
    return rays[seen], levels[seen], spreads[seen]


def even_rays(spacing: float) -> Array:
    """Unit rays (N, 3) all over the sphere, about `spacing` radians apart: a Fibonacci lattice."""
    count = max(1, round(4 * np.pi / spacing**2))
    number = np.arange(count) + 0.5
    height, turn = 1 - 2 * number / count, np.pi * (1 + np.sqrt(5)) * number
    level = np.sqrt(1 - height**2)
    return np.column_stack([level * np.cos(turn), height, level * np.sin(turn)])


def _anchor_noise(smoothing: float) -> float:
    """Noise of the anchors, relative to the median point's, with which the spline follows them over
    `SphereOptions.anchor_stiffness`.

    A spline that minimises Σ (f − g)² / noise² + 8πλ ∫ |∇²f|² over points of density n has the length (8πλ noise² / n)
    to the power ¼.
    """
    density = 1 / SPHERE.anchor_spacing**2
    return float(np.sqrt(SPHERE.anchor_stiffness**4 * density / (8 * np.pi * smoothing)))
