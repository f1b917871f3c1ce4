"""Things that the map tears: shown whole, by a smooth depth (docs/method.md, 8).

People who move, twigs, and what is too near to be matched have a depth that is wrong, and ragged: the picture that is
shown there is torn by it, though it has them whole. Where the other picture does not agree anyway, no depth is right.
So they take one that changes slowly between what surrounds them, and one picture shows them as it was taken. Whether
that is better is decided by what would be seen, part by part, in small pictures.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...field.folding import breaks
from ...raster.arrays import NEIGHBOURS, Part, dilated, larger_parts, with_margin
from ...raster.distance import distance_inside
from ...raster.lazy import whole
from ...raster.log_encoding import log_encode
from ...raster.pull_push import filled
from .refills import Cells, Refill, cells_of, is_better, joined, kept_of, least_gain, zone_of
from .seam_options import CUT_THINGS, TORN_THINGS
from .tears import tears


def untorn(cells: Cells) -> tuple[list[Refill], Cells]:
    """Give what the map tears a smooth depth, where that shows less (see `refills.improved`)."""
    kept: list[Refill] = []
    for _ in range(TORN_THINGS.rounds):
        refills, cells = _untorn(cells)
        if not refills:
            break
        kept += refills
    return kept, cells


def _untorn(cells: Cells) -> tuple[list[Refill], Cells]:
    """The refills with which less is seen, each by the depth of what surrounds it that shows least, and how all looks
    with them."""
    parts = _parts(cells)
    best: list[tuple[float, Refill] | None] = [None] * len(parts)
    for percentiles in TORN_THINGS.percentiles if parts else ():
        refills = [_refill(cells, place, part, percentiles) for place, part in parts]
        after = cells.refilled([one for one in refills if one is not None])
        for number, one in enumerate(refills):
            if one is None or not is_better(one, cells, after) or _smears(one, cells, after):
                continue
            seen, before = float(after.seen[one.place][zone_of(one.part, cells.side)].sum()), best[number]
            if before is None or seen < before[0]:
                best[number] = seen, one
    chosen = [one[1] for one in best if one is not None]
    after = cells.refilled(chosen)
    return kept_of(chosen, [one for one in chosen if is_better(one, cells, after)], cells, after)


def _parts(cells: Cells) -> list[tuple[Part, NDArray[np.bool_]]]:
    """Where things are torn and something is seen of it, and which parts (h, w) of these places they take up."""
    both = cells.look.shown[0] & cells.look.shown[1]
    torn = _torn(cells) & both
    things = joined(
        torn | (cells.bad & dilated(torn, cells_of(TORN_THINGS.near, cells.side))),
        cells_of(TORN_THINGS.joined, cells.side),
    )
    count, number, stats, _ = cv2.connectedComponentsWithStats(things.astype(np.uint8), connectivity=8)
    out = []
    for label in range(1, count):
        left, top, width, height, area = stats[label]
        if area < CUT_THINGS.min_cells:
            continue
        box = slice(int(top), int(top + height)), slice(int(left), int(left + width))
        place = with_margin(box, round((CUT_THINGS.grown + CUT_THINGS.ring) * cells.side) + 2, both.shape)
        part = dilated(number[place] == label, cells_of(CUT_THINGS.grown, cells.side)) & both[place]
        if cells.seen[place][zone_of(part, cells.side)].sum() > least_gain(part):
            out.append((place, part))
    return out


def _torn(cells: Cells) -> NDArray[np.bool_]:
    """Where (H, W) the map of the picture that is shown jumps visibly, or folds or jumps and the other does not agree.
    """
    torn = np.zeros(cells.unlike.shape, bool)
    unlike = dilated(cells.unlike, 1)
    for number, (picture, seen) in enumerate(zip(cells.rough.pictures, cells.look.maps, strict=True)):
        shown = _shown(cells, number)
        torn |= larger_parts(breaks(seen, shown, TORN_THINGS.jump) & unlike, TORN_THINGS.least_cells)
        torn |= tears(log_encode(whole(picture.light)).mean(axis=2), seen, shown) & dilated(cells.bad, 1)
    return torn


def _shown(cells: Cells, number: int) -> NDArray[np.bool_]:
    """Where (H, W) a picture is what is shown."""
    chosen = cells.look.chosen if number else ~cells.look.chosen
    return cells.look.shown[number] & chosen


def _refill(cells: Cells, place: Part, part: NDArray[np.bool_], percentiles: tuple[float, float]) -> Refill | None:
    """A depth for a part (h, w) of a place that changes slowly between what surrounds it, of its inverse depth from one
    percentile to another; None where nothing tells."""
    shown = cells.look.shown[0][place] | cells.look.shown[1][place]
    around = dilated(part, cells_of(CUT_THINGS.ring, cells.side)) & ~part & shown & ~cells.bad[place]
    if around.sum() < CUT_THINGS.least_ring:
        return None
    depth = cells.warp.inverse_depth[place]
    least, most = np.percentile(depth[around], percentiles)
    counts = around & (depth >= least) & (depth <= most)
    weight = np.where(counts, np.float32(1), np.where(around, np.float32(CUT_THINGS.near_weight), np.float32(0)))
    smooth = filled(np.where(around, depth, np.float32(0))[..., None], weight)[..., 0]
    soft = np.clip(distance_inside(part) / cells_of(CUT_THINGS.grown, cells.side), 0, 1).astype(np.float32) * part
    return Refill(place, part, smooth, soft)


def _smears(one: Refill, before: Cells, after: Cells) -> bool:
    """Whether a refill draws a picture out over many more cells than before."""
    zone = zone_of(one.part, before.side)
    old, new = (int((_drawn_out(cells, one.place) & zone).sum()) for cells in (before, after))
    return new - old > TORN_THINGS.most_smeared * float(one.part.sum())


def _drawn_out(cells: Cells, place: Part) -> NDArray[np.bool_]:
    """Where (h, w) in a place the picture that is shown goes on by a fraction of a px from one cell to the next."""
    out = np.zeros(cells.bad[place].shape, bool)
    for number, seen in enumerate(cells.look.maps):
        x, y, mine = seen.x[place], seen.y[place], _shown(cells, number)[place]
        for here, there in NEIGHBOURS:
            with np.errstate(invalid="ignore"):
                short = np.hypot(x[here] - x[there], y[here] - y[there]) < TORN_THINGS.least_step
            out[here] |= short & mine[here] & mine[there]
    return out
