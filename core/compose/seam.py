"""Which picture each pixel comes from: a minimal cut through the overlap, from coarse to fine (docs/method.md, 8).

The cut prefers places where both pictures have the same tones and gradients. It avoids depth edges, what the added
picture cannot see and places where the warp is uncertain. Time and memory are bounded: the coarsest cut has a limited
number of cells at any picture size, and each finer one only looks at a narrow band around the coarser seam.
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
    """Which pixels are settled before a seam is sought.

    What only one picture shows, or shows opaque, comes from it; what the added picture cannot see comes from the
    panorama before where that shows it.

    Parameters
    ----------
    before, layer : Layer
        The panorama before, and the added picture's layer.
    hidden : (H, W) bool array
        What the added picture cannot see.
    painted : (H, W) int8 array, optional
        An artist's decision, as FIRST, SECOND or FREE. It wins wherever that picture shows something.

    Returns
    -------
    (H, W) int8 array
        FIRST from the panorama before, SECOND from the added picture, FREE, or NOWHERE where neither shows anything.
    """
    known = np.full(before.alpha.shape, NOWHERE, np.int8)

    def put(rows: slice) -> tuple[int, int]:
        out, not_seen = known[rows], hidden[rows]
        (shows_before, opaque_before), (shows, opaque) = (
            (one.alpha[rows] > 0, one.alpha[rows] >= OVERLAP.opaque_alpha) for one in (before, layer)
        )
        out[shows_before & shows] = FREE
        # a soft edge of one gives way where the other is opaque
        out[shows_before & (~shows | not_seen | (opaque_before & ~opaque))] = FIRST
        out[shows & (~shows_before | (opaque & ~opaque_before & ~not_seen))] = SECOND
        return int(shows_before.sum()), int((shows_before & ~shows).sum())

    shown, alone = np.sum(list(in_order(put, strips(known.shape))), axis=0).tolist()
    if shown and alone < SEAM.surrounded_share * shown:
        # The added picture surrounds the panorama: the cheapest cut would leave nothing of it, so its core is kept.
        inner = distance_to_border(before.alpha > 0)
        known[(known == FREE) & (inner > SEAM.kept_depth * inner.max())] = FIRST
    if painted is not None:
        known[(painted < 0) & (before.alpha > 0)] = FIRST
        known[(painted > 0) & (layer.alpha > 0)] = SECOND
    return known


def seam_cost(overlap: Overlap, picture_map: PictureMap, confidence: AnyImage | None) -> NDArray[np.float32]:
    """What a seam costs at each pixel of the overlap.

    A difference that is small enough for blending to even out costs as its square, a larger one in proportion: a long
    seam that nobody sees is better than a short one through what moved. The cost doubles at a depth edge of a pixel of
    parallax, and where dense refinement has no confidence at all.

    Parameters
    ----------
    overlap : Overlap
    picture_map : PictureMap
        Of the added picture, over the whole canvas.
    confidence : (H, W) image or None
        Of dense refinement, None without it.

    Returns
    -------
    (h, w) float32 array
        In [0, 1], in the overlap's box.
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
    """What a seam costs (h, w) in a box of the canvas, by the difference of tones (h, w, C) there."""
    apart = _mean(np.abs(difference))
    risk = np.ones(apart.shape, np.float32)
    for axis in (0, 1):
        step = _mean(np.abs(np.diff(difference, axis=axis)))
        apart += np.maximum(_padded(step, axis, 0, 1), _padded(step, axis, 1, 0))
        risk += np.minimum(_second_differences(picture_map, box, axis), np.float32(1))
    if confidence is not None:
        risk += 1 - confidence[box]
    cost = apart * apart
    cost /= apart + np.float32(OVERLAP.same_tone)
    cost *= risk
    cost += np.float32(SEAM.length_price)
    return np.minimum(cost, np.float32(1), out=cost)


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means (h, w) over channels (h, w, C); NumPy's own takes several times as long over so few."""
    total = values[..., 0].copy()
    for k in range(1, values.shape[2]):
        total += values[..., k]
    return total / np.float32(values.shape[2])


def _second_differences(picture_map: PictureMap, box: tuple[slice, slice], axis: int) -> NDArray[np.float32]:
    """Second differences of the map (h, w), px of the picture: large at depth edges."""
    bends = [np.diff(values[box], n=2, axis=axis) for values in (picture_map.x, picture_map.y)]
    return _padded(np.nan_to_num(np.hypot(*bends), nan=0.0), axis, 1, 1)


def _padded(values: NDArray[np.float32], axis: int, before: int, after: int) -> NDArray[np.float32]:
    """Values (h, w) with so many zeros before and after them along an axis."""
    return np.pad(values, [(before, after) if k == axis else (0, 0) for k in range(2)])


def added_price(
    overlap: Overlap, hidden: NDArray[np.bool_], moving: NDArray[np.int8] | None = None,
    behind: NDArray[np.bool_] | None = None,
) -> NDArray[np.float32]:  # fmt: skip
    """What it costs to show the added picture at each pixel of the overlap.

    What it cannot see costs by how different it looks, and so does what moved and is to be shown from the other
    picture; what the panorama before cannot see costs where that is shown.

    Parameters
    ----------
    overlap : Overlap
    hidden : (H, W) bool array
        What the added picture cannot see.
    moving : (h, w) int8 array, optional
        See `moving_labels`.
    behind : (H, W) bool array, optional
        What the panorama before cannot see.

    Returns
    -------
    (h, w) float32 array
        In the overlap's box, in units of a border between opposite tones; negative where it costs not to show it.
    """
    misplaced = hidden[overlap.box].astype(np.int8)
    if behind is not None:
        misplaced -= behind[overlap.box]
    if moving is not None:
        misplaced -= moving
    price = np.zeros(misplaced.shape, np.float32)
    where = misplaced != 0
    price[where] = np.float32(SEAM.ghost_price) * np.abs(overlap.difference[where]).mean(axis=1) * misplaced[where]
    price += np.float32(SEAM.added_price / math.hypot(*price.shape))
    return price


def find_seam(
    known: NDArray[np.int8], cost: NDArray[np.float32], price: NDArray[np.float32], box: tuple[slice, slice]
) -> NDArray[np.bool_]:
    """Find the cheapest seam.

    Parameters
    ----------
    known : (H, W) int8 array
        See `known_labels`.
    cost, price : (h, w) float32 arrays
        See `seam_cost` and `added_price`.
    box : (slice, slice)
        Rows and columns of the canvas in which these two lie.

    Returns
    -------
    (H, W) bool array
        Where the panorama comes from the added picture.
    """
    out: NDArray[np.bool_] = known == SECOND
    free = int((known == FREE).sum())
    if not free:
        return out
    # wider than the box by a coarse cell, so that the settled pixels beside it anchor the cut
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
    """The cut at one level (True: SECOND), refined from that at half the size if there are too many free pixels."""
    free = known == FREE
    if free.sum() <= SEAM.coarse_cells:
        return _cut_within(known, cost, price, free)
    # A cell has four pixels' area but two pixels' side: its price doubles beside its cost.
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
    """Where (h, w) pixels of both labels lie within `reach` px, of those that are `there`."""
    return dilated(labels & there, reach) & dilated(~labels & there, reach)


def _continued(cost: NDArray[np.float32], free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The cost (h, w), continued by a pixel beside what is free: a free border would attract the seam."""
    beside = cv2.dilate(np.where(free, cost, np.float32(0)), np.ones((3, 3), np.uint8))
    return np.where(free, cost, beside)


def _halved(cost: AnyImage, free: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Means over cells of 2 × 2 pixels, of those that are free."""
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
    """Sums over cells of 2 × 2 pixels; beyond the edges there is 0."""
    even = np.pad(values, [(0, side % 2) for side in values.shape])
    sums: NDArray[Any] = even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]
    return sums


def _halved_labels(known: NDArray[np.int8]) -> NDArray[np.int8]:
    """Labels of cells of 2 × 2 pixels: settled if more than half of what they show is, NOWHERE if they show nothing."""
    states = (known == FIRST, known == SECOND, known != NOWHERE)
    first, second, there = (_cell_sums(state.astype(np.int8)) for state in states)
    out = np.zeros(first.shape, np.int8)
    out[2 * first > there], out[2 * second > there], out[there == 0] = FIRST, SECOND, NOWHERE
    return out
