"""Which picture each pixel comes from: a minimal cut through the overlap, coarse first, then finer and finer in a band.

The cut goes where the two pictures look alike, in tones and in their gradients, and keeps away from edges of depth,
from what the added picture cannot see and from where the warp is uncertain. Its cost is bounded: the coarse cut has so
many cells at any picture size, and each finer one only looks at a narrow band around what is there.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import beside, bounds, dilated, strips, with_margin
from ..raster.distance import distance_to_border
from ..raster.lazy import AnyImage, Placed
from ..raster.picture_map import PictureMap
from ..system.threads import each, in_order
from .min_cut import FIRST, FREE, NOWHERE, SECOND, min_cut
from .options import OVERLAP, SEAM
from .overlap import Overlap


def known_labels(
    before: Layer, layer: Layer, hidden: NDArray[np.bool_], painted: NDArray[np.int8] | None = None
) -> NDArray[np.int8]:
    """What is settled before any seam (H, W): FIRST from the panorama before, SECOND from the picture that is added,
    FREE, NOWHERE.

    What only one shows whole comes from it, what is hidden from the added picture from the panorama before where that
    shows it. painted (H, W): -1 and 1 where the artist has decided, 0 elsewhere; it wins wherever the layer shows
    something.
    """
    known = np.full(before.alpha.shape, NOWHERE, np.int8)

    def put(rows: slice) -> tuple[int, int]:
        out, unseen = known[rows], hidden[rows]
        (shows_before, whole_before), (shows, whole) = (
            (one.alpha[rows] > 0, one.alpha[rows] >= OVERLAP.opaque_alpha) for one in (before, layer)
        )
        out[shows_before & shows] = FREE
        # a soft edge of one gives way to what the other shows whole
        out[shows_before & (~shows | unseen | (whole_before & ~whole))] = FIRST
        out[shows & (~shows_before | (whole & ~whole_before & ~unseen))] = SECOND
        return int(shows_before.sum()), int((shows_before & ~shows).sum())

    shown, alone = np.sum(list(in_order(put, strips(known.shape))), axis=0).tolist()
    if shown and alone < SEAM.surrounded_share * shown:
        # all round it is the added picture: the cheapest cut would leave nothing of what was there before
        inner = distance_to_border(before.alpha > 0)
        known[(known == FREE) & (inner > SEAM.kept_depth * inner.max())] = FIRST
    if painted is not None:
        known[(painted < 0) & (before.alpha > 0)] = FIRST
        known[(painted > 0) & (layer.alpha > 0)] = SECOND
    return known


def seam_cost(overlap: Overlap, picture_map: PictureMap, confidence: AnyImage | None) -> NDArray[np.float32]:
    """What a seam costs at each pixel of the overlap's box (h, w), in [0, 1].

    picture_map: of the picture that is added; confidence (H, W): of dense refinement, None without it.

    A difference so small that blending evens it out costs as its square, a larger one as it is: rather a longer way
    where nobody sees it than a short one through what moved.
    """
    cost = np.empty(overlap.both.shape, np.float32)

    def put(rows: slice) -> None:
        near, here = beside(rows, 1, len(cost))
        box = slice(overlap.box[0].start + near.start, overlap.box[0].start + near.stop), overlap.box[1]
        cost[rows] = _cost(overlap.difference[near], picture_map, confidence, box)[here]

    each(put, strips(cost.shape))
    return cost


def _cost(
    difference: NDArray[np.float32], picture_map: PictureMap, confidence: AnyImage | None, box: tuple[slice, slice]
) -> NDArray[np.float32]:
    """What a seam costs at the pixels of a box of the canvas, by the difference (h, w, C) there."""
    away = _mean(np.abs(difference))
    warned = np.ones(away.shape, np.float32)
    for axis in (0, 1):
        step = _mean(np.abs(np.diff(difference, axis=axis)))
        away += np.maximum(_padded(step, axis, 0, 1), _padded(step, axis, 1, 0))
        warned += np.minimum(_jumps(picture_map, box, axis), np.float32(1))
    if confidence is not None:
        warned += 1 - confidence[box]
    cost = away * away
    cost /= away + np.float32(OVERLAP.same_tone)
    cost *= warned
    cost += np.float32(SEAM.length_price)
    return np.minimum(cost, np.float32(1), out=cost)


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means (h, w) over channels (h, w, C); NumPy's own takes several times as long over so few."""
    total = values[..., 0].copy()
    for k in range(1, values.shape[2]):
        total += values[..., k]
    return total / np.float32(values.shape[2])


def _jumps(picture_map: PictureMap, box: tuple[slice, slice], axis: int) -> NDArray[np.float32]:
    """By how many px the map's step to the next pixel differs from the step before: at edges of depth."""
    bends = [np.diff(values[box], n=2, axis=axis) for values in (picture_map.x, picture_map.y)]
    return _padded(np.nan_to_num(np.hypot(*bends), nan=0.0), axis, 1, 1)


def _padded(values: NDArray[np.float32], axis: int, before: int, after: int) -> NDArray[np.float32]:
    return np.pad(values, [(before, after) if k == axis else (0, 0) for k in range(2)])


def added_price(
    overlap: Overlap, hidden: NDArray[np.bool_], times: NDArray[np.int8] | None = None
) -> NDArray[np.float32]:
    """What each pixel of the overlap's box (h, w) costs if it comes from the picture that is added; less than nothing:
    if it does not.

    hidden (H, W): what that picture cannot see costs by how different it looks, and so does what moved if it is not
    seen at its own time, times (h, w): see `moving_things.times`.
    """
    misplaced = hidden[overlap.box].astype(np.int8)
    if times is not None:
        misplaced -= times
    price = np.zeros(misplaced.shape, np.float32)
    where = misplaced != 0
    price[where] = np.float32(SEAM.ghost_price) * np.abs(overlap.difference[where]).mean(axis=1) * misplaced[where]
    price += np.float32(SEAM.added_price / math.hypot(*price.shape))
    return price


def find_seam(
    known: NDArray[np.int8], cost: NDArray[np.float32], price: NDArray[np.float32], box: tuple[slice, slice]
) -> NDArray[np.bool_]:
    """Where (H, W) the panorama comes from the picture that is added, by the cheapest seam.

    known (H, W): see `known_labels`; cost and price (h, w): of a seam and of that picture, in the overlap's box of rows
    and columns.
    """
    out: NDArray[np.bool_] = known == SECOND
    free = int((known == FREE).sum())
    if not free:
        return out
    # around the box as far as a coarse cell: what lies there on either side is what the cut holds on to
    reach = 2 << max(0, math.ceil(math.log(free / SEAM.coarse_cells, 4)))
    wider = [
        slice(max(0, part.start - reach), min(side, part.stop + reach))
        for part, side in zip(box, known.shape, strict=True)
    ]
    here, at = (wider[0], wider[1]), (box[0].start - wider[0].start, box[1].start - wider[1].start)
    height, width = out[here].shape
    out[here] = _cut(known[here], *(Placed(values, at, (height, width)) for values in (cost, price)))
    return out


def _cut(known: NDArray[np.int8], cost: AnyImage, price: AnyImage) -> NDArray[np.bool_]:
    """The cut at one level, from that at half the size where this one is too large to be cut at once."""
    free = known == FREE
    if free.sum() <= SEAM.coarse_cells:
        return _cut_within(known, cost, price, free)
    # four pixels have a cell's area, but two its side
    coarse = _cut(_halved_labels(known), _halved(cost, free), 2 * _halved(price, free))
    finer = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)[: known.shape[0], : known.shape[1]]
    labels: NDArray[np.bool_] = np.where(known == FREE, finer, known == SECOND)
    for reach in (SEAM.band_half_width_px, 1):
        settled = np.where(labels, np.int8(SECOND), np.int8(FIRST))
        near = _near_border(labels, known != NOWHERE, reach)
        settled[near] = known[near]
        settled[known == NOWHERE] = NOWHERE
        if (settled == FREE).sum() <= SEAM.band_pixels:
            return _cut_within(settled, cost, price, free)
    return labels


def _cut_within(
    known: NDArray[np.int8], cost: AnyImage, price: AnyImage, free: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The cut through what is FREE in `known`; free (h, w): where the cost is known."""
    out: NDArray[np.bool_] = known == SECOND
    box = bounds(known == FREE)
    if box is not None:
        part = with_margin(box, 2, known.shape)  # neighbours, and what their cost is continued from
        out[part] = min_cut(_continued(cost[part], free[part]), known[part], price[part])
    return out


def _near_border(labels: NDArray[np.bool_], there: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Where a pixel of the other label lies within `reach` px."""
    return dilated(labels & there, reach) & dilated(~labels & there, reach)


def _continued(cost: NDArray[np.float32], free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Beside what is free a seam costs what it does just inside: else it would run along every border."""
    beside = cv2.dilate(np.where(free, cost, np.float32(0)), np.ones((3, 3), np.uint8))
    return np.where(free, cost, beside)


def _halved(cost: AnyImage, free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Means over cells of 2×2, of what is free in them."""
    height, width = free.shape
    out = np.empty((-(-height // 2), -(-width // 2)), np.float32)

    def put(cells: slice) -> None:
        rows = slice(2 * cells.start, min(height, 2 * cells.stop))
        here = free[rows]
        sums = _cell_sums(np.where(here, cost[rows, 0:width], np.float32(0)))
        np.divide(sums, np.maximum(_cell_sums(here.astype(np.float32)), np.float32(1)), out=out[cells])

    each(put, strips(out.shape))
    return out


def _cell_sums(values: NDArray[Any]) -> NDArray[Any]:
    even = np.pad(values, [(0, side % 2) for side in values.shape])
    sums: NDArray[Any] = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return sums


def _halved_labels(known: NDArray[np.int8]) -> NDArray[np.int8]:
    """A cell is settled where more than half of it is, and nowhere where all of it is."""
    states = (known == FIRST, known == SECOND, known != NOWHERE)
    first, second, there = (_cell_sums(state.astype(np.int8)) for state in states)
    out = np.zeros(first.shape, np.int8)
    out[2 * first > there], out[2 * second > there], out[there == 0] = FIRST, SECOND, NOWHERE
    return out
