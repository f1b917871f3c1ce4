"""Near things that a picture's border cuts: taken away by showing what lies behind them (docs/method.md, 8).

A branch that hangs into one picture ends where that picture does: the other shows it elsewhere, against another
background. As long as the depth there is the branch's, or half of it, the other picture has nothing to put in its
place. So the depth around it is taken from the background, and the seam is free to go around it. Whether that is better
is decided by what would be seen, part by part, in small pictures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.view import View
from ...panorama.other_depth import every_nth, seen_at, with_depth
from ...panorama.projection import focal_of
from ...panorama.warp import Warp
from ...pictures.picture import Picture
from ...raster.arrays import NEIGHBOURS, Part, Plane, dilated, with_margin
from ...raster.distance import distance_inside, distance_to
from ...raster.lazy import part_of
from ...raster.log_encoding import log_encode
from ...raster.pull_push import filled
from .rough_seam import Look, RoughSeam
from .seam_options import CUT_THINGS, SEAM


@dataclass(frozen=True, eq=False)
class _Cells:
    """What is looked at: a coarse warp, how both pictures look there, and px of a picture's longer side.

    bad (H, W): where they differ by much, or one of them cannot see; seen (H, W): what is seen of seams, those between
    the pictures and those within each.
    """

    warp: Warp
    rough: RoughSeam
    look: Look
    side: float
    bad: NDArray[np.bool_]
    seen: Plane

    @staticmethod
    def of(warp: Warp, rough: RoughSeam, side: float) -> _Cells:
        """By how both look."""
        look = rough.look(warp)
        hidden = look.hidden if warp.behind is None else look.hidden | warp.behind
        bad = hidden & look.shown[0] & look.shown[1]
        if look.overlap is not None:
            apart = cv2.blur(np.abs(look.overlap.difference).mean(axis=2), (3, 3))
            bad[look.overlap.box] |= look.overlap.both & (apart > CUT_THINGS.min_difference)
        close = np.ones((2 * round(CUT_THINGS.joined * side) + 1,) * 2, np.uint8)
        bad = cv2.morphologyEx(bad.astype(np.uint8), cv2.MORPH_CLOSE, close) > 0
        return _Cells(warp, rough, look, side, bad, _seam_seen(look) + _own_cuts(look))

    def refilled(self, refills: Sequence[_Refill]) -> _Cells:
        """The same with the depth of refills."""
        if not refills:
            return self
        return _Cells.of(_refilled(self.warp, self.rough.views, refills), self.rough, self.side)


@dataclass(frozen=True)
class _Refill:
    """Depth (h, w) from the background for a part (h, w) of the canvas, `place`; weight (h, w): how much it counts."""

    place: Part
    part: NDArray[np.bool_]
    depth: Plane
    weight: Plane


def without_cut_things(
    warp: Warp, views: Sequence[View], pictures: Sequence[Picture], rough: RoughSeam | None = None
) -> Warp:
    """Give what a picture's border cuts the depth of its background, where that shows less.

    Parameters
    ----------
    warp : Warp
        Of two pictures.
    views : sequence of View
        What is known of the pictures, the reference first.
    pictures : sequence of Picture
    rough : RoughSeam, optional
        With pictures as small as the warp, if that is coarse already.

    Returns
    -------
    Warp
    """
    if not np.isfinite(views[1].t).all() or not views[1].t.any():
        return warp
    projection = warp.canvas.projection
    focal = focal_of(views[0].K) if projection is None else projection.focal
    # px of the canvas along a picture's longer side
    longer = max(max(view.size) for view in views) * focal / focal_of(views[0].K)
    step = 1 << max(0, round(math.log2(longer / SEAM.found_px)))
    coarse, rough = every_nth(warp, step), rough or RoughSeam.of(pictures, views, focal / step)
    if not np.isfinite(coarse.inverse_depth).all():
        return warp
    cells = _Cells.of(coarse, rough, longer / step)
    kept: list[_Refill] = []
    for deepest in CUT_THINGS.deepest:
        refills, cells = _better(cells, deepest)
        kept += refills
    return _enlarged(warp, views, kept, step) if kept else warp


def _better(cells: _Cells, deepest: float) -> tuple[list[_Refill], _Cells]:
    """The refills within a share of the overlap's shorter side from its border with which less is seen, and how all
    looks with them."""
    refills = _refills(cells, deepest)
    after = cells.refilled(refills)
    kept = [one for one in refills if _is_better(one, cells, after)]
    if kept and len(kept) < len(refills):
        after = cells.refilled(kept)
        kept = kept if float(after.seen.sum()) < float(cells.seen.sum()) else []
    return (kept, after) if kept else ([], cells)


def _refills(cells: _Cells, share: float) -> list[_Refill]:
    """Depth for each thing at the border of either picture, beyond which the other goes on, around which something is
    seen; share: of the overlap's shorter side from the border."""
    out: list[_Refill] = []
    first, second = cells.look.shown
    both = first & second
    if not both.any():
        return out
    rows, columns = np.flatnonzero(both.any(axis=1)), np.flatnonzero(both.any(axis=0))
    deepest = share * min(np.ptp(rows), np.ptp(columns))
    for mine, other in ((first, second), (second, first)):
        rim = both & dilated(other & ~mine, 1)
        if not rim.any():
            continue
        from_rim = distance_to(rim).astype(np.float32)
        things = (cells.bad & (from_rim < deepest)).astype(np.uint8)
        count, number, stats, _ = cv2.connectedComponentsWithStats(things, connectivity=8)
        for label in range(1, count):
            left, top, width, height, area = stats[label]
            box = slice(int(top), int(top + height)), slice(int(left), int(left + width))
            if area < CUT_THINGS.min_cells or from_rim[box][number[box] == label].min() > CUT_THINGS.near * cells.side:
                continue
            place = with_margin(box, round((CUT_THINGS.grown + CUT_THINGS.ring) * cells.side) + 2, both.shape)
            around = dilated(number[place] == label, _px(CUT_THINGS.grown, cells.side))
            part = around & dilated(mine[place], 1)  # small pictures end up to a cell early
            if cells.seen[place][_zone(part, cells.side)].sum() <= _least_gain(part):
                continue
            one = _refill(cells, place, part, around, from_rim[place])
            if one is not None:
                out.append(one)
    return out


def _zone(part: NDArray[np.bool_], side: float) -> NDArray[np.bool_]:
    """Where (h, w) a refilled part (h, w) is judged."""
    return dilated(part, _px(CUT_THINGS.zone, side))


def _least_gain(part: NDArray[np.bool_]) -> float:
    """By how much less must be seen for a part (h, w) to be refilled."""
    return CUT_THINGS.least_gain + CUT_THINGS.gain_per_cell * float(part.sum())


def _px(share: float, side: float) -> int:
    """Cells of a share of a picture's longer side."""
    return max(1, round(share * side))


def _refill(
    cells: _Cells, place: Part, part: NDArray[np.bool_], thing: NDArray[np.bool_], from_rim: Plane
) -> _Refill | None:
    """What lies behind a part (h, w) of a place, by the farthest of what surrounds it and the thing (h, w) that it is
    of; None where nothing tells."""
    grown = _px(CUT_THINGS.grown, cells.side)
    shown = cells.look.shown[0][place] | cells.look.shown[1][place]
    around = dilated(part, _px(CUT_THINGS.ring, cells.side)) & ~thing & shown & ~cells.bad[place]
    if around.sum() < CUT_THINGS.least_ring:
        return None
    depth = cells.warp.inverse_depth[place]
    far = around & (depth <= np.percentile(depth[around], CUT_THINGS.far_percentile) + _one_px(cells, place, around))
    weight = np.where(far, np.float32(1), np.where(around, np.float32(CUT_THINGS.near_weight), np.float32(0)))
    behind = filled(np.where(around, depth, np.float32(0))[..., None], weight)[..., 0]
    # the border itself needs no gentle end: beyond it nothing of this picture goes on
    soft = np.where(from_rim < grown, 1, np.clip(distance_inside(part) / grown, 0, 1)).astype(np.float32) * part
    return _Refill(place, part, behind, soft)


def _one_px(cells: _Cells, place: Part, around: NDArray[np.bool_]) -> float:
    """The inverse depth that moves the pictures against each other by a cell."""
    depth = cells.warp.inverse_depth[place]
    more = np.float32(1e-3)
    moved = 0.0
    for number, view in enumerate(cells.rough.views):
        before, after = (seen_at(cells.warp, cells.rough.views, number, place, d) for d in (depth, depth + more))
        away = np.hypot(*(b - a for a, b in zip(before, after, strict=True)))[around]
        moved += float(np.nanmedian(away)) / max(view.size) * cells.side
    return float(more) / max(moved, 1e-9)


def _refilled(warp: Warp, views: Sequence[View], refills: Sequence[_Refill]) -> Warp:
    """A warp with the depth of all refills."""
    depth, where = warp.inverse_depth.copy(), np.zeros(warp.inverse_depth.shape, bool)
    for one in refills:
        depth[one.place] += one.weight * (one.depth - depth[one.place])
        where[one.place] |= one.part
    return with_depth(warp, views, depth, where)


def _enlarged(warp: Warp, views: Sequence[View], refills: Sequence[_Refill], step: int) -> Warp:
    """The same on the whole canvas, whose every `step`-th pixel was looked at."""
    if step == 1:
        return _refilled(warp, views, refills)
    height, width = warp.inverse_depth.shape
    larger = []
    for one in refills:
        rows, columns = (slice(part.start * step, part.stop * step) for part in one.place)
        size = (columns.stop - columns.start, rows.stop - rows.start)
        rows, columns = slice(rows.start, min(rows.stop, height)), slice(columns.start, min(columns.stop, width))
        inner = slice(rows.stop - rows.start), slice(columns.stop - columns.start)
        part = cv2.resize(one.part.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)[inner] > 0
        # a cell further, or interpolation would fade it out at the border itself
        wider = cv2.dilate(one.weight, np.ones((3, 3), np.uint8))
        depth, weight = (
            cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)[inner] for values in (one.depth, wider)
        )
        larger.append(_Refill((rows, columns), part, depth, weight * part))
    return _refilled(warp, views, larger)


def _seam_seen(look: Look) -> Plane:
    """By how much (H, W) the pictures differ where the seam runs."""
    overlap = look.overlap
    out = np.zeros(look.chosen.shape, np.float32)
    if overlap is None:
        return out
    out[overlap.box] = cv2.dilate(np.abs(overlap.difference).mean(axis=2) * overlap.both, np.ones((2, 2), np.uint8))
    shown = look.shown[0] | look.shown[1]
    return _at_changes(look.chosen, shown, out)


def _at_changes(labels: NDArray[np.bool_], shown: NDArray[np.bool_], tones: Plane) -> Plane:
    """The larger of two neighbours' tones (H, W) where their labels differ, summed over both directions."""
    out = np.zeros_like(tones)
    for here, there in NEIGHBOURS:
        edge = (labels[here] != labels[there]) & shown[here] & shown[there]
        out[here] += edge * np.maximum(tones[here], tones[there])
    return out


def _own_cuts(look: Look) -> Plane:
    """Where (H, W) a picture is cut within itself: its map jumps, and it is shown on both sides.

    Every jump counts by its tones. `tears` forgives those that the picture explains, and those in foliage: refills that
    slice a house would be taken for better.
    """
    out = np.zeros(look.chosen.shape, np.float32)
    if look.overlap is None:
        return out
    box = with_margin(look.overlap.box, CUT_THINGS.margin_cells, out.shape)
    within = out[box]
    for number, (layer, seen) in enumerate(zip(look.layers, look.maps, strict=True)):
        x, y, chosen = seen.x[box], seen.y[box], look.chosen[box]
        mine = (chosen if number else ~chosen) & look.shown[number][box]
        for here, there in NEIGHBOURS:
            with np.errstate(invalid="ignore"):
                jumps = np.hypot(x[here] - x[there], y[here] - y[there]) > CUT_THINGS.jump_cells
            jumps &= mine[here] & mine[there]
            if jumps.any():
                tones = log_encode(part_of(layer.light, box)).mean(axis=2)
                within[here] += jumps * np.abs(tones[here] - tones[there])
    return out


def _is_better(one: _Refill, before: _Cells, after: _Cells) -> bool:
    """Whether much less is seen around a refill than before, and at its worst place, too."""
    zone = _zone(one.part, before.side)
    window = 2 * (_px(CUT_THINGS.window, before.side) // 2) + 1
    old, new = (float(cells.seen[one.place][zone].sum()) for cells in (before, after))
    most_old, most_new = (
        float(cv2.boxFilter(cells.seen[one.place], -1, (window, window), normalize=False)[zone].max()) / window
        for cells in (before, after)
    )
    hardly_seen = most_new < max(CUT_THINGS.hardly_seen, CUT_THINGS.less_at_worst * most_old)
    return new < CUT_THINGS.much_less * old and old - new > _least_gain(one.part) and hardly_seen
