"""Which picture each pixel comes from: a minimal cut through the overlap, from coarse to fine (docs/method.md, 8).

The cut prefers places where both pictures have the same tones and gradients. It avoids depth edges, what the added
picture cannot see and places where the warp is uncertain. Time and memory are bounded: the coarsest cut has a limited
number of cells at any picture size, and each finer one only looks at a narrow band around the coarser seam.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...raster.arrays import bounds, cut, dilated, strips, with_margin
from ...raster.distance import distance_to_border
from ...raster.lazy import AnyImage, Placed
from ...system.threads import each, in_order
from ..options import OVERLAP
from .min_cut import FIRST, FREE, NOWHERE, SECOND, min_cut
from .seam_options import SEAM

if TYPE_CHECKING:
    from .seam_costs import SeamCosts


def known_labels(
    before: Layer, layer: Layer, painted: NDArray[np.int8] | None = None, hidden: NDArray[np.bool_] | None = None
) -> NDArray[np.int8]:
    """Which pixels are settled before a seam is sought.

    What only one picture shows, or shows opaque, comes from it.

    Parameters
    ----------
    before, layer : Layer
        The panorama before, and the added picture's layer.
    painted : (H, W) int8 array, optional
        An artist's decision, as FIRST, SECOND or FREE. It wins wherever that picture shows something.
    hidden : (H, W) bool array, optional
        What the added picture cannot see, if that is to come from the panorama before without being weighed against
        what the seam costs.

    Returns
    -------
    (H, W) int8 array
        FIRST from the panorama before, SECOND from the added picture, FREE, or NOWHERE where neither shows anything.
    """
    known = np.full(before.alpha.shape, NOWHERE, np.int8)

    def put(rows: slice) -> tuple[int, int]:
        out, not_seen = known[rows], False if hidden is None else hidden[rows]
        (shows_before, opaque_before), (shows, opaque) = (
            (one.alpha[rows] > 0, one.alpha[rows] >= OVERLAP.opaque_alpha) for one in (before, layer)
        )
        out[shows_before & shows] = FREE
        # a soft edge of one gives way where the other is opaque
        out[shows_before & (~shows | (opaque_before & ~opaque))] = FIRST
        out[shows & (~shows_before | (opaque & ~opaque_before))] = SECOND
        out[shows_before & not_seen] = FIRST
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


def find_seam(known: NDArray[np.int8], costs: SeamCosts) -> NDArray[np.bool_]:
    """Find the cheapest seam.

    Parameters
    ----------
    known : (H, W) int8 array
        See `known_labels`.
    costs : SeamCosts
        Of the overlap.

    Returns
    -------
    (H, W) bool array
        Where the panorama comes from the added picture.
    """
    out: NDArray[np.bool_] = known == SECOND
    free = int((known == FREE).sum())
    if not free:
        return out
    cell = 1 << (len(costs.levels) - 1)
    # wider than the box by a coarsest cell, so that the settled pixels beside it anchor the cut
    reach = cell * (2 << max(0, math.ceil(math.log(free / cell**2 / SEAM.coarse_cells, 4))))
    rows, columns = costs.box
    sides = [-(-(part.stop - part.start) // cell) * cell + 2 * reach for part in costs.box]
    here = (columns.start - reach, rows.start - reach, sides[1], sides[0])
    levels = [
        Placed(cost, (reach >> level, reach >> level), (sides[0] >> level, sides[1] >> level))
        for level, cost in enumerate(costs.levels)
    ]
    last = levels[-1]
    found = _cut_levels(cut(known, here, NOWHERE), levels, Placed(costs.price, last.at, last.size))
    out[costs.box] = cut(found, (reach, reach, columns.stop - columns.start, rows.stop - rows.start))
    return out


def _cut_levels(known: NDArray[np.int8], levels: Sequence[AnyImage], price: AnyImage) -> NDArray[np.bool_]:
    """The cut through pixels (True: SECOND), found in the cells of the last level; price: see `SeamCosts`."""
    if len(levels) == 1:
        return _cut(known, levels[0], price)
    return _within_band(known, _cut_levels(_halved_labels(known), levels[1:], price), levels[0], None)


def _cut(known: NDArray[np.int8], cost: AnyImage, price: AnyImage) -> NDArray[np.bool_]:
    """The cut at one level (True: SECOND), refined from that at half the size if there are too many free pixels."""
    free = known == FREE
    if free.sum() <= SEAM.coarse_cells:
        return _cut_within(known, cost, price, free)
    # A cell has four pixels' area but two pixels' side: its price doubles beside its cost.
    coarse = _cut(_halved_labels(known), _halved(cost, free), 2 * _halved(price, free))
    return _within_band(known, coarse, cost, price)


def _within_band(
    known: NDArray[np.int8], coarse: NDArray[np.bool_], cost: AnyImage, price: AnyImage | None
) -> NDArray[np.bool_]:
    """The cut within a narrow band around that through cells of twice the side."""
    finer = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)[: known.shape[0], : known.shape[1]]
    labels: NDArray[np.bool_] = np.where(known == FREE, finer, known == SECOND)
    for reach in (SEAM.band_half_width_px, 1):
        settled = np.where(labels, np.int8(SECOND), np.int8(FIRST))
        near = _near_border(labels, known != NOWHERE, reach)
        settled[near] = known[near]
        settled[known == NOWHERE] = NOWHERE
        if (settled == FREE).sum() <= SEAM.band_pixels:
            return _cut_within(settled, cost, price, known == FREE)
    return labels


def _cut_within(
    known: NDArray[np.int8], cost: AnyImage, price: AnyImage | None, free: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The cut through what is FREE in `known`; free (h, w): where the cost is known."""
    out: NDArray[np.bool_] = known == SECOND
    box = bounds(known == FREE)
    if box is not None:
        part = with_margin(box, 2, known.shape)  # neighbours, and what their cost is continued from
        out[part] = min_cut(_continued(cost[part], free[part]), known[part], None if price is None else price[part])
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
