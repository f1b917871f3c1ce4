"""How far the viewpoint slides: what keeps straight things straight, and lets the seam run unseen, decides.

Each candidate is judged on a coarse map, by what an artist sees first: bent lines, leaning uprights, what is enlarged
or folded, what a seam would cut, and holes (docs/method.md, 6). All of it is measured on what the pictures show, not on
the canvas, so that candidates with different frames compare.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import undistort
from ..cameras.projective import homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..raster.arrays import Array
from .options import CHOICE
from .own_depth import OwnDepth, Things
from .rig_viewpoint import RigViewpoint
from .slid_warp import slid_warp
from .straightness import along, leans, planes_through
from .upright_edges import StraightEdges
from .viewpoint import Viewpoint
from .warp import Warp

# The upper left corner of each cell of a grid (rows, columns, …), that to its right, and that below it.
CORNERS = np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1]
# The whole way across the overlap.
ALL = (0.0, 1.0)


@dataclass(frozen=True)
class SlideCost:
    """What a slide costs.

    Attributes
    ----------
    s1 : float
    bend_px : float
        How far long straight edges are bent, weighted by their length, px at `ChoiceOptions.px_per_radian`.
    lean_deg : float
        How far upright ones lean, degrees.
    enlarged, folded : float
        Shares of the pictures, on surfaces, that are enlarged or folded.
    seam_px : float or None
        px of a rough seam that is seen; None where none was cut, since without any it would cost too much already.
    holes : float or None
        Share, of what is shown, of holes in it; None likewise.
    cost : float
        All of it, in px of bend.
    part : (float, float)
        Within which part of the way across the overlap it slides, from and to shares of it.
    """

    s1: float
    bend_px: float
    lean_deg: float
    enlarged: float
    folded: float
    seam_px: float | None
    holes: float | None
    cost: float
    part: tuple[float, float] = ALL


@dataclass(frozen=True)
class SlideChoice:
    """How far the viewpoint slides.

    Attributes
    ----------
    s1 : float
    costs : tuple of SlideCost
        What each candidate costs.
    why : str
        Why it was chosen, in plain words.
    part : (float, float)
        Within which part of the way across the overlap it slides.
    """

    s1: float
    costs: tuple[SlideCost, ...]
    why: str
    part: tuple[float, float] = ALL

    def others(self) -> tuple[SlideChoice, ...]:
        """What else costs about as much and is unlike this and unlike each other, that which slides least first."""
        if not self.costs:
            return ()
        taken = [next(one for one in self.costs if (one.s1, one.part) == (self.s1, self.part))]
        most = CHOICE.others_cost * taken[0].cost
        possible = [
            one for one in self.costs
            if one.seam_px is not None and one.cost <= most and _possible(one, self.costs[0])
        ]  # fmt: skip
        found: list[SlideChoice] = []
        for one in sorted(possible, key=lambda one: (one.part != ALL, one.s1, one.cost)):
            unlike = all(one.part != other.part or abs(one.s1 - other.s1) >= CHOICE.unlike for other in taken)
            if unlike and len(found) < CHOICE.most_others:
                taken.append(one)
                why = f"costs {one.cost:.3f} px of bend, about as little as any; with the least it would be torn"
                found.append(replace(self, s1=one.s1, part=one.part, why=why))
        return tuple(found)


# Where there is nothing to slide along.
NO_WAY = SlideChoice(0.0, (), "the pictures do not lie side by side, or were taken from one place")


def choose_slide(
    base: Warp, views: Sequence[View], viewpoint: Viewpoint, edges: Sequence[StraightEdges], down: Array | None,
    rough_seam: Callable[[Warp], float], progress: Callable[[float], None] = lambda share: None,
) -> SlideChoice:  # fmt: skip
    """Choose how far the viewpoint slides.

    Parameters
    ----------
    base : Warp
        Of both pictures, seen from the reference's place, on a cylinder or sphere that is coarse and holds both.
    views : sequence of View
        What is known of the pictures, the reference first.
    viewpoint : Viewpoint
        How it slides from the one to the other (see `viewpoint_between`).
    edges : sequence of StraightEdges
        Of each picture, in the reference's frame.
    down : (3,) array or None
        Unit vector along gravity in the reference's frame; None where nothing confirms it.
    rough_seam : callable
        px of a rough seam that is seen, on the canvas of a coarse warp.
    progress : callable, optional
        progress(share that is done); it may raise to stop.

    Returns
    -------
    SlideChoice
        Of candidates that cost about as much, the one that slides least, within a part of the way only where all others
        cost more.
    """
    base = replace(base, depth=base.inverse_depth, lazy_confidence=None)  # read more than once
    samples = [
        _samples(OwnDepth.of(base, view, number), one, down)
        for number, (view, one) in enumerate(zip(views, edges, strict=True))
    ]
    bare = [
        _cost(s1, _geometry(samples, viewpoint.within(part).sliding(s1), down), part)
        for s1, part in [*((s1, ALL) for s1 in CHOICE.candidates), *((1.0, part) for part in CHOICE.parts)]
    ]

    def seam_of(one: SlideCost) -> tuple[float, float]:
        return _seam_and_holes(base, views, viewpoint.within(one.part).sliding(one.s1), rough_seam)

    costs = _seamed([one for one in bare if one.part == ALL], seam_of, progress)
    choice = _least(costs)
    best = next(one for one in costs if one.s1 == choice.s1)
    parts = [one for one in bare if one.part != ALL and _possible(one, costs[0])]
    for one in sorted(parts, key=lambda one: one.cost):
        if best.cost < CHOICE.least_cost or one.cost + _tie(one.cost) >= best.cost:
            break
        progress(1.0)
        one = _with_seam(one, *seam_of(one))
        choice = replace(choice, costs=(*choice.costs, one))
        if one.cost + _tie(one.cost) < best.cost:
            where = "from {:.0%} to {:.0%} of the way across the overlap".format(*one.part)
            why = f"costs {one.cost:.3f} px of bend, the least, {where}"
            best, choice = one, replace(choice, s1=one.s1, why=why, part=one.part)
    return choice


def _seamed(
    bare: Sequence[SlideCost], seam_of: Callable[[SlideCost], tuple[float, float]], progress: Callable[[float], None]
) -> tuple[SlideCost, ...]:
    """Candidates that slide further and further with their seams, which take longest: those of CHOICE.seam_candidates
    are cut, the others' interpolated; none but the first where no other could be chosen even if its seam is unseen."""
    progress(0.0)
    seams = {bare[0].s1: seam_of(bare[0])}
    first = _with_seam(bare[0], *seams[bare[0].s1])
    if all(one.cost + _tie(one.cost) >= first.cost for one in bare if _possible(one, first)):
        return first, *bare[1:]
    cut = [one for one in bare[1:] if one.s1 in CHOICE.seam_candidates]
    for number, one in enumerate(cut, 1):
        progress(number / (1 + len(cut)))
        seams[one.s1] = seam_of(one)
    at, (seam_px, holes) = list(seams), zip(*seams.values(), strict=True)
    return tuple(
        _with_seam(one, float(np.interp(one.s1, at, seam_px)), float(np.interp(one.s1, at, holes))) for one in bare
    )


def choose_rig_slide(
    base: Warp, views: Sequence[View], viewpoint: RigViewpoint, edges: Sequence[StraightEdges], down: Array | None,
    progress: Callable[[float], None] = lambda share: None,
) -> SlideChoice:  # fmt: skip
    """Choose how far the viewpoint slides among the places of N pictures, by their straight edges and what would be
    enlarged or folded.

    Parameters
    ----------
    base : Warp
        Of all pictures, seen from the first one's place, on a cylinder or sphere that is coarse.
    views : sequence of View
        Of all pictures, the first one's R = I and t = 0.
    viewpoint : RigViewpoint
        How it slides (see `rig_viewpoint`).
    edges, down, progress
        See `choose_slide`.

    Returns
    -------
    SlideChoice
        Of candidates that cost about as much, the one that slides least.
    """
    samples, costs = [], []
    for number, (view, one) in enumerate(zip(views, edges, strict=True)):
        progress(number / len(views) / 2)
        samples.append(_samples(OwnDepth.of(base, view, number), one, down))
    for number, s1 in enumerate(CHOICE.candidates):
        progress(0.5 + number / len(CHOICE.candidates) / 2)
        costs.append(_cost(s1, _geometry(samples, viewpoint.sliding(s1), down)))
    return _least(tuple(costs))


def _least(costs: tuple[SlideCost, ...]) -> SlideChoice:
    """The choice by the costs of candidates, which slide further and further."""
    still = costs[0]
    # what folds or stretches at some slide only does so the more at a longer one
    possible = list(takewhile(lambda one: _possible(one, still), costs))
    least = min(one.cost for one in possible)
    best = next(one for one in possible if one.cost <= least + _tie(least))
    why = f"costs {best.cost:.3f} px of bend, the least"
    if best.cost > least:
        why = f"costs {best.cost:.3f} px of bend, about as little as any"
    if len(possible) < len(costs):
        why += f"; from {costs[len(possible)].s1:g} on the map would fold or stretch"
    return SlideChoice(best.s1, costs, why)


def _possible(one: SlideCost, still: SlideCost) -> bool:
    """Whether a candidate folds and stretches hardly more than what does not slide."""
    return (
        one.folded <= still.folded + CHOICE.max_folded and one.enlarged <= still.enlarged + CHOICE.max_stretched
    )  # fmt: skip


def _tie(least: float) -> float:
    """By how much what is as good as the least may cost more."""
    return max(CHOICE.tie_px, CHOICE.tie_share * least)


def _cost(s1: float, geometry: tuple[float, float, float, float], part: tuple[float, float] = ALL) -> SlideCost:
    """A candidate's cost by bend (px), lean (degrees), and shares enlarged and folded."""
    bend, lean, enlarged, folded = geometry
    cost = bend + CHOICE.per_lean_deg * lean + CHOICE.per_enlarged * enlarged + CHOICE.per_folded * folded
    return SlideCost(s1, bend, lean, enlarged, folded, None, None, cost, part)


def _with_seam(one: SlideCost, seam_px: float, holes: float) -> SlideCost:
    """A candidate's cost with that of its seam (px) and holes."""
    more = CHOICE.per_seam_px * min(seam_px, CHOICE.max_seam_px) + CHOICE.per_hole * holes
    return replace(one, seam_px=seam_px, holes=holes, cost=one.cost + more)


@dataclass(frozen=True)
class _Samples:
    """What one picture shows: places along its straight edges (N, points), and a coarse grid of it (rows, columns).

    lengths (N,): of the edges, weights; upright (N,): which of them are upright; areas (rows − 1, columns − 1): solid
    angles of the grid's cells as the picture shows them, NaN where an edge of depth crosses.
    """

    edges: Things
    lengths: Array
    upright: NDArray[np.bool_]
    grid: Things
    areas: Array


def _samples(depth: OwnDepth, edges: StraightEdges, down: Array | None) -> _Samples:
    """What a picture shows, with its depth; edges: in the reference's frame."""
    view = depth.view
    long = edges.lengths >= CHOICE.least_length
    edges = StraightEdges(edges.rays[long], edges.lengths[long])
    rays = along(edges)
    places = depth.things(rays)
    upright = np.zeros(len(edges.lengths), bool)
    if down is not None:
        upright = (leans(edges.normals, down) < CHOICE.upright_within) & ~_level(rays, places.d, down)
    step = max(view.size) / CHOICE.cells
    columns, rows = (np.arange(0, side, step) for side in view.size)
    ideal = undistort(np.stack(np.meshgrid(columns, rows), axis=-1), view.camera)
    grid = homogeneous(ideal) @ (inverse_intrinsics(view.K).T @ view.R)
    grid /= np.linalg.norm(grid, axis=-1, keepdims=True)
    rough, smooth = depth.things(grid), depth.smoothed(CHOICE.smoothing).things(grid)
    parallax = CHOICE.px_per_radian * np.stack([rough.d[part] for part in CORNERS])
    nearest, farthest = parallax.max(axis=0), parallax.min(axis=0)
    surface = nearest - farthest < CHOICE.least_jump_px + CHOICE.jump_share * nearest
    areas = np.where(surface, _areas(grid), np.nan)
    return _Samples(places, edges.lengths, upright, smooth, areas)


def _level(rays: Array, d: Array, down: Array) -> NDArray[np.bool_]:
    """Which edges (N,) lie on a floor or ceiling rather than upright, by unit rays (N, points, 3) from the camera and
    inverse range (N, points): those that run straight away from it lie in a plane with gravity, too.

    Along a level edge the height below the camera stays the same, along an upright one the distance.
    """
    sine = rays @ down
    cosine = np.sqrt(np.maximum(1 - np.square(sine), 0))  # straight down, rounding may exceed 1
    height, distance = (np.log(np.maximum(v, 1e-6)) for v in (np.abs(sine), cosine))
    inverse_range = np.log(np.maximum(d, 1e-6))
    spread = [np.abs(np.diff(inverse_range - part, axis=1).sum(axis=1)) for part in (height, distance)]
    crosses = sine.min(axis=1) * sine.max(axis=1) < 0
    level: NDArray[np.bool_] = ~crosses & (spread[0] < spread[1])
    return level


def _geometry(
    samples: Sequence[_Samples], viewpoint: Viewpoint | RigViewpoint, down: Array | None
) -> tuple[float, float, float, float]:
    """Bend (px) and lean (degrees) of the edges of all pictures, and shares of their cells enlarged and folded."""
    bends, weights, lean, upright_weights, enlarged, folded = ([] for _ in range(6))
    for one in samples:
        normals, off = planes_through(viewpoint.seen_from(one.edges.q, one.edges.d)[0])
        bends.append(np.minimum(CHOICE.px_per_radian * off, CHOICE.max_bend_px))
        weights.append(one.lengths)
        if down is not None:
            lean.append(np.minimum(np.degrees(leans(normals[one.upright], down)), CHOICE.max_lean_deg))
            upright_weights.append(one.lengths[one.upright])
        with np.errstate(invalid="ignore"):
            ratio = _areas(viewpoint.seen_from(one.grid.q, one.grid.d)[0]) / one.areas
            enlarged.append((ratio > CHOICE.max_enlarged**2).ravel())
            twice = np.isfinite(one.areas) & _twice(viewpoint, one.grid)[CORNERS[0]]
            folded.append((twice | (ratio < CHOICE.least_area)).ravel())
    shares = [float(np.concatenate(one).mean()) for one in (enlarged, folded)]
    return _mean(bends, weights), _mean(lean, upright_weights, CHOICE.least_upright), shares[0], shares[1]


def _twice(viewpoint: Viewpoint | RigViewpoint, things: Things) -> NDArray[np.bool_]:
    """Which things (…) the panorama shows more than once: the slide goes back over them faster than they move on.

    A thing is seen wherever the viewpoint of the ray towards it is the one that the ray starts from.
    """
    if isinstance(viewpoint, RigViewpoint):
        return viewpoint.shows_twice(things.q, things.d)
    past = []
    for slide in np.linspace(0, viewpoint.s1, CHOICE.fold_steps):
        rays = things.q - (slide * things.d)[..., None] * viewpoint.c
        past.append(viewpoint.slide_at(rays) > slide + CHOICE.same_slide)
    twice: NDArray[np.bool_] = np.diff(np.stack(past), axis=0).sum(axis=0) > 1
    return twice


def _mean(values: Sequence[Array], weights: Sequence[Array], least: float = 1e-9) -> float:
    """The weighted mean of all values, towards 0 where all weights together are less than `least`."""
    total = float(sum(one.sum() for one in weights))
    return float(sum(one @ weight for one, weight in zip(values, weights, strict=True))) / max(total, least)


def _areas(rays: Array) -> Array:
    """Signed solid angles (rows − 1, columns − 1) between each ray (rows, columns, 3) and its right and lower one."""
    here, right, below = (rays[part] for part in CORNERS)
    areas: Array = (np.cross(right - here, below - here) * here).sum(axis=-1)
    return areas


def _seam_and_holes(
    base: Warp, views: Sequence[View], viewpoint: Viewpoint, rough_seam: Callable[[Warp], float]
) -> tuple[float, float]:
    """px (at `ChoiceOptions.px_per_radian`) of a rough seam that is seen, and the share of holes in what is shown."""
    projection = base.canvas.projection
    assert projection is not None
    warp = slid_warp(base, views, viewpoint, projection) if viewpoint.s1 else base
    shown = np.logical_or.reduce([one.inside() for one in warp.maps])
    side = 2 * max(1, round(CHOICE.hole_radius * projection.focal)) + 1
    within = cv2.morphologyEx(np.pad(shown, side).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    holes = int(within[side:-side, side:-side].sum()) - int(shown.sum())
    seam_px = rough_seam(warp) * CHOICE.px_per_radian / projection.focal
    return seam_px, holes / max(1, int(shown.sum()))
