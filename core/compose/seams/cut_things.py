"""Near things that a picture's border cuts: taken away by showing what lies behind them (docs/method.md, 8).

A branch that hangs into one picture ends where that picture does: the other shows it elsewhere, against another
background. As long as the depth there is the branch's, or half of it, the other picture has nothing to put in its
place. So the depth around it is taken from the background, and the seam is free to go around it. Whether that is better
is decided by what would be seen, part by part, in small pictures.
"""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.other_depth import seen_at
from ...raster.arrays import Part, Plane, dilated, with_margin
from ...raster.distance import distance_inside, distance_to
from ...raster.pull_push import filled
from .refills import Cells, Refill, Way, cells_of, is_better, kept_of, least_gain, zone_of
from .seam_options import CUT_THINGS


def _better(cells: Cells, deepest: float) -> tuple[list[Refill], Cells]:
    """The refills within a share of the overlap's shorter side from its border with which less is seen, and how all
    looks with them."""
    refills = _refills(cells, deepest)
    after = cells.refilled(refills)
    return kept_of(refills, [one for one in refills if is_better(one, cells, after)], cells, after)


def _refills(cells: Cells, share: float) -> list[Refill]:
    """Depth for each thing at the border of either picture, beyond which the other goes on, around which something is
    seen; share: of the overlap's shorter side from the border."""
    out: list[Refill] = []
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
            around = dilated(number[place] == label, cells_of(CUT_THINGS.grown, cells.side))
            part = around & dilated(mine[place], 1)  # small pictures end up to a cell early
            if cells.seen[place][zone_of(part, cells.side)].sum() <= least_gain(part):
                continue
            one = _refill(cells, place, part, around, from_rim[place])
            if one is not None:
                out.append(one)
    return out


def _refill(
    cells: Cells, place: Part, part: NDArray[np.bool_], thing: NDArray[np.bool_], from_rim: Plane
) -> Refill | None:
    """What lies behind a part (h, w) of a place, by the farthest of what surrounds it and the thing (h, w) that it is
    of; None where nothing tells."""
    grown = cells_of(CUT_THINGS.grown, cells.side)
    shown = cells.look.shown[0][place] | cells.look.shown[1][place]
    around = dilated(part, cells_of(CUT_THINGS.ring, cells.side)) & ~thing & shown & ~cells.bad[place]
    if around.sum() < CUT_THINGS.least_ring:
        return None
    depth = cells.warp.inverse_depth[place]
    far = around & (depth <= np.percentile(depth[around], CUT_THINGS.far_percentile) + _one_cell(cells, place, around))
    weight = np.where(far, np.float32(1), np.where(around, np.float32(CUT_THINGS.near_weight), np.float32(0)))
    behind = filled(np.where(around, depth, np.float32(0))[..., None], weight)[..., 0]
    # the border itself needs no gentle end: beyond it nothing of this picture goes on
    soft = np.where(from_rim < grown, 1, np.clip(distance_inside(part) / grown, 0, 1)).astype(np.float32) * part
    return Refill(place, part, behind, soft)


def _one_cell(cells: Cells, place: Part, around: NDArray[np.bool_]) -> float:
    """The inverse depth that moves the pictures against each other by a cell."""
    depth = cells.warp.inverse_depth[place]
    more = np.float32(1e-3)
    moved = 0.0
    for number, view in enumerate(cells.rough.views):
        before, after = (seen_at(cells.warp, cells.rough.views, number, place, d) for d in (depth, depth + more))
        away = np.hypot(*(b - a for a, b in zip(before, after, strict=True)))[around]
        moved += float(np.nanmedian(away)) / max(view.size) * cells.side
    return float(more) / max(moved, 1e-9)


# What lies deeper is tried first (see `refills.improved`).
WAYS: tuple[Way, ...] = tuple(partial(_better, deepest=deepest) for deepest in CUT_THINGS.deepest)
