"""Parts of a panorama that take another depth than was found, where less is seen then (docs/method.md, 8).

It is tried in small pictures, and judged part by part by the tone steps along the seam, and those within a picture
where its map jumps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.view import View
from ...panorama.other_depth import every_nth, with_depth
from ...panorama.projection import focal_of
from ...panorama.warp import Warp
from ...raster.arrays import NEIGHBOURS, Part, Plane, dilated, with_margin
from ...raster.lazy import part_of
from ...raster.log_encoding import log_encode
from .seam_options import CUT_THINGS, SEAM

if TYPE_CHECKING:
    from .rough_seam import Look, RoughSeam


@dataclass(frozen=True, eq=False)
class Cells:
    """What is looked at: a coarse warp, how both pictures look there, and px of a picture's longer side.

    unlike, bad (H, W): where they differ by much, and where they do or one of them cannot see; seen (H, W): what is
    seen of seams, those between the pictures and those within each.
    """

    warp: Warp
    rough: RoughSeam
    look: Look
    side: float
    unlike: NDArray[np.bool_]
    bad: NDArray[np.bool_]
    seen: Plane

    @staticmethod
    def of(warp: Warp, rough: RoughSeam, side: float) -> Cells:
        """By how both look."""
        look = rough.look(warp)
        hidden = look.hidden if warp.behind is None else look.hidden | warp.behind
        unlike = np.zeros(hidden.shape, bool)
        if look.overlap is not None:
            apart = cv2.blur(np.abs(look.overlap.difference).mean(axis=2), (3, 3))
            unlike[look.overlap.box] = look.overlap.both & (apart > CUT_THINGS.min_difference)
        bad = joined(unlike | (hidden & look.shown[0] & look.shown[1]), round(CUT_THINGS.joined * side))
        return Cells(warp, rough, look, side, unlike, bad, _seam_seen(look) + _own_cuts(look))

    def refilled(self, refills: Sequence[Refill]) -> Cells:
        """The same with the depth of refills."""
        if not refills:
            return self
        return Cells.of(_refilled(self.warp, self.rough.views, refills), self.rough, self.side)


@dataclass(frozen=True)
class Refill:
    """Depth (h, w) for a part (h, w) of the canvas, `place`; weight (h, w): how much it counts."""

    place: Part
    part: NDArray[np.bool_]
    depth: Plane
    weight: Plane


# Says what it refills, and how all looks with that.
Way = Callable[[Cells], tuple[list[Refill], Cells]]


def improved(
    warp: Warp, views: Sequence[View], rough_of: Callable[[float], RoughSeam], ways: Iterable[Way]
) -> Warp:
    """A warp of two pictures with what some ways of refilling parts of it, one after the other, make better.

    Parameters
    ----------
    warp : Warp
    views : sequence of View
        What is known of the pictures, the reference first.
    rough_of : callable
        Cuts seams through small pictures that have so many px per radian.
    ways : iterable of Way

    Returns
    -------
    Warp
        The same where there is no baseline.
    """
    if not np.isfinite(views[1].t).all() or not views[1].t.any():
        return warp
    projection = warp.canvas.projection
    focal = focal_of(views[0].K) if projection is None else projection.focal
    # px of the canvas along a picture's longer side
    longer = max(max(view.size) for view in views) * focal / focal_of(views[0].K)
    step = 1 << max(0, round(math.log2(longer / SEAM.found_px)))
    coarse = every_nth(warp, step)
    if not np.isfinite(coarse.inverse_depth).all():
        return warp
    cells = Cells.of(coarse, rough_of(focal / step), longer / step)
    kept: list[Refill] = []
    for way in ways:
        refills, cells = way(cells)
        kept += refills
    return _enlarged(warp, views, kept, step) if kept else warp


def kept_of(
    refills: Sequence[Refill], better: list[Refill], cells: Cells, after: Cells
) -> tuple[list[Refill], Cells]:
    """Those of some refills that are better, if they are so without the others too, and how all looks with them.

    cells, after: how all looks before, and with all refills.
    """
    if better and len(better) < len(refills):
        after = cells.refilled(better)
        better = better if float(after.seen.sum()) < float(cells.seen.sum()) else []
    return (better, after) if better else ([], cells)


def joined(mask: NDArray[np.bool_], cells: int) -> NDArray[np.bool_]:
    """A mask (H, W) without gaps of up to twice so many cells."""
    square = np.ones((2 * cells + 1,) * 2, np.uint8)
    closed: NDArray[np.bool_] = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, square) > 0
    return closed


def zone_of(part: NDArray[np.bool_], side: float) -> NDArray[np.bool_]:
    """Where (h, w) a refilled part (h, w) is judged."""
    return dilated(part, cells_of(CUT_THINGS.zone, side))


def least_gain(part: NDArray[np.bool_]) -> float:
    """By how much less must be seen for a part (h, w) to be refilled."""
    return CUT_THINGS.least_gain + CUT_THINGS.gain_per_cell * float(part.sum())


def cells_of(share: float, side: float) -> int:
    """Cells of a share of a picture's longer side."""
    return max(1, round(share * side))


def _refilled(warp: Warp, views: Sequence[View], refills: Sequence[Refill]) -> Warp:
    """A warp with the depth of all refills."""
    depth, where = warp.inverse_depth.copy(), np.zeros(warp.inverse_depth.shape, bool)
    for one in refills:
        depth[one.place] += one.weight * (one.depth - depth[one.place])
        where[one.place] |= one.part
    return with_depth(warp, views, depth, where)


def _enlarged(warp: Warp, views: Sequence[View], refills: Sequence[Refill], step: int) -> Warp:
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
        larger.append(Refill((rows, columns), part, depth, weight * part))
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


def is_better(one: Refill, before: Cells, after: Cells) -> bool:
    """Whether much less is seen around a refill than before, and at its worst place, too."""
    zone = zone_of(one.part, before.side)
    window = 2 * (cells_of(CUT_THINGS.window, before.side) // 2) + 1
    old, new = (float(cells.seen[one.place][zone].sum()) for cells in (before, after))
    most_old, most_new = (
        float(cv2.boxFilter(cells.seen[one.place], -1, (window, window), normalize=False)[zone].max()) / window
        for cells in (before, after)
    )
    hardly_seen = most_new < max(CUT_THINGS.hardly_seen, CUT_THINGS.less_at_worst * most_old)
    return new < CUT_THINGS.much_less * old and old - new > least_gain(one.part) and hardly_seen
