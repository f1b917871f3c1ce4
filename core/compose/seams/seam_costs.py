"""What a seam costs, from the panorama's pixels up to the cells in which it is found (docs/method.md, 8).

A seam is found in cells, of which a picture has some hundred along its side, and then moved within a narrow band. What
differs over a whole cell is seen. What differs from one pixel to the next is mostly texture that is a pixel off: at
full size it would outprice a cut through a leg.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Part, Plane, beside, eroded, small_strips, strips
from ...raster.lazy import AnyImage
from ...raster.picture_map import PictureMap
from ...system.threads import each
from ..options import OVERLAP, PLACING
from .seam_options import SEAM

if TYPE_CHECKING:
    from .overlap import Overlap


@dataclass(frozen=True)
class SeamCosts:
    """What a seam through an overlap costs.

    Attributes
    ----------
    box : (slice, slice)
        Rows and columns of the canvas in which it lies.
    levels : tuple of (h, w) float32 arrays
        What the seam costs at each pixel, in [0, 1], then in cells of twice the side each; it is found in the last.
    price : (h, w) float32 array
        What it costs to show the added picture at each cell of the last level, in units of a border between opposite
        tones; negative where it costs not to show it.
    """

    box: Part
    levels: tuple[Plane, ...]
    price: Plane


def seam_costs(
    overlap: Overlap, picture_map: PictureMap, confidence: AnyImage | None, hidden: NDArray[np.bool_],
    moving: NDArray[np.int8] | None = None, behind: NDArray[np.bool_] | None = None, slide: AnyImage | None = None,
    misplaced: Plane | None = None,
) -> SeamCosts:  # fmt: skip
    """Price every seam through an overlap.

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
    hidden : (H, W) bool array
        What the added picture cannot see: it costs by how different it looks.
    moving : (h, w) int8 array, optional
        See `moving_labels`: what is to be shown from the other picture costs likewise, and no seam goes through it.
    behind : (H, W) bool array, optional
        What the panorama before cannot see: it costs where it is shown from there.
    slide : (H, W) image, optional
        How far each pixel's viewpoint lies towards that of the added picture, 0..1. At 0 the panorama before is exact,
        and at 1 the added picture is.
    misplaced : (H, W) float32 array, optional
        px by which the added picture is expected to be further from its place than the panorama before.

    Returns
    -------
    SeamCosts
    """
    risk = _risk(picture_map, confidence, overlap.box)
    count = max(0, round(math.log2(max(picture_map.size) / SEAM.found_px)))
    levels = []
    for level in range(count + 1):
        difference, share = _in_cells(overlap, 1 << level)
        cost = _cost(difference, share > 0, _largest(risk, 1 << level))
        if moving is not None:
            cost[means(moving != 0, 1 << level) > 0] = 1
        levels.append(cost)
    price = _price(overlap, difference, 1 << count, hidden, moving, behind, slide)
    if misplaced is not None:
        off = np.where(overlap.both, np.clip(misplaced[overlap.box], -PLACING.max_px, PLACING.max_px), np.float32(0))
        price += np.float32(PLACING.price / math.hypot(*price.shape)) * means(off, 1 << count)
    return SeamCosts(overlap.box, tuple(levels), price)


def averaged_costs(several: Sequence[SeamCosts]) -> SeamCosts:
    """The mean of what a seam costs in several frames that overlap in the same box."""
    *levels, price = (
        np.mean(np.stack(values), axis=0)
        for values in zip(*((*one.levels, one.price) for one in several), strict=True)
    )
    return SeamCosts(several[0].box, tuple(levels), price)


def _in_cells(overlap: Overlap, side: int) -> tuple[Plane, Plane]:
    """The difference of tones (h, w, C) in cells of so many px, and the share (h, w) of each that lies in the overlap.
    """
    if side == 1:
        return overlap.difference, overlap.both.astype(np.float32)
    share = means(overlap.both, side)
    difference = means(overlap.difference, side)
    difference /= np.maximum(share, np.float32(1e-6))[..., None]
    return difference, share


def means(values: NDArray[Any], side: int) -> Plane:
    """Means over cells of side × side pixels of values (h, w[, C]); beyond the edges there is 0."""
    if side == 1:
        return values.astype(np.float32, copy=False)
    height, width = (-(-length // side) for length in values.shape[:2])
    out = np.empty((height, width, *values.shape[2:]), np.float32)

    def put(cells: slice) -> None:
        part = _padded_rows(values, cells, side)
        out[cells] = cv2.resize(part, (width, len(out[cells])), interpolation=cv2.INTER_AREA).reshape(out[cells].shape)

    each(put, strips((height, width * side * side)))
    return out


def _largest(values: Plane, side: int) -> Plane:
    """The largest over cells of side × side pixels of values (h, w) ≥ 0."""
    if side == 1:
        return values
    height, width = (-(-length // side) for length in values.shape)
    out = np.empty((height, width), np.float32)

    def put(cells: slice) -> None:
        # rows first: along them memory lies in order
        rows = _padded_rows(values, cells, side).reshape(-1, side, width * side).max(axis=1)
        out[cells] = rows.reshape(-1, width, side).max(axis=2)

    each(put, strips((height, width * side * side)))
    return out


def _padded_rows(values: NDArray[Any], cells: slice, side: int) -> Plane:
    """The rows of some cells of side × side pixels of values (h, w[, C]), with zeros after them, so that all are whole.
    """
    part = values[cells.start * side : cells.stop * side].astype(np.float32, copy=False)
    after = [(-length) % side for length in part.shape[:2]]
    return np.pad(part, [(0, after[0]), (0, after[1]), *[(0, 0)] * (part.ndim - 2)])


def _risk(picture_map: PictureMap, confidence: AnyImage | None, box: Part) -> Plane:
    """By what factor (h, w), 1 to 4, a seam costs more in a box of the canvas for edges of depth and for doubt."""
    risk = np.ones([part.stop - part.start for part in box], np.float32)

    def put(rows: slice) -> None:
        near, here = beside(rows, 1, len(risk))
        part = slice(box[0].start + near.start, box[0].start + near.stop), box[1]
        for axis in (0, 1):
            bends = [np.diff(values[part], n=2, axis=axis) for values in (picture_map.x, picture_map.y)]
            bend = _padded(np.nan_to_num(np.hypot(*bends), nan=0.0), axis, 1, 1)
            risk[rows] += np.minimum(bend[here], np.float32(1))
        if confidence is not None:
            risk[rows] += 1 - confidence[part][here]

    each(put, small_strips(risk.shape))
    return risk


def _cost(difference: Plane, both: NDArray[np.bool_], risk: Plane) -> Plane:
    """What a seam costs (h, w) by the difference of tones (h, w, C), where both pictures show something (h, w), and the
    factor (h, w) for what is doubtful there."""
    cost = np.empty(both.shape, np.float32)
    rim = _rim(both)

    def put(rows: slice) -> None:
        near, here = beside(rows, 1, len(cost))
        apart = _mean(np.abs(difference[near]))
        for axis in (0, 1):
            step = _mean(np.abs(np.diff(difference[near], axis=axis)))
            apart += np.maximum(_padded(step, axis, 0, 1), _padded(step, axis, 1, 0))
        apart = apart[here]
        part = apart * apart
        part /= apart + np.float32(OVERLAP.same_tone)
        part *= risk[rows]
        part += np.float32(SEAM.length_price)
        part[rim[rows]] += np.float32(SEAM.rim_price)
        cost[rows] = np.minimum(part, np.float32(1), out=part)

    each(put, small_strips(cost.shape))
    return cost


def _rim(both: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) the overlap ends within some pixels or cells."""
    return both & ~eroded(both, SEAM.rim_width)


def _mean(values: Plane) -> Plane:
    """Means (h, w) over channels (h, w, C); NumPy's own takes several times as long over so few."""
    total = values[..., 0].copy()
    for k in range(1, values.shape[2]):
        total += values[..., k]
    return total / np.float32(values.shape[2])


def _padded(values: Plane, axis: int, before: int, after: int) -> Plane:
    """Values (h, w) with so many zeros before and after them along an axis."""
    return np.pad(values, [(before, after) if k == axis else (0, 0) for k in range(2)])


def _price(
    overlap: Overlap, difference: Plane, side: int, hidden: NDArray[np.bool_], moving: NDArray[np.int8] | None,
    behind: NDArray[np.bool_] | None, slide: AnyImage | None,
) -> Plane:  # fmt: skip
    """What it costs to show the added picture (h, w) in cells of so many px, which differ by tones (h, w, C)."""
    apart = _mean(np.abs(difference))

    def of(mask: NDArray[np.bool_] | NDArray[np.int8], tone: float, least: float) -> Plane:
        return means(mask, side) * (np.float32(tone) * apart + np.float32(least))

    price = of(hidden[overlap.box] & overlap.both, SEAM.hidden_price, SEAM.least_hidden_price)
    if behind is not None:
        price -= of(behind[overlap.box] & overlap.both, SEAM.behind_price, SEAM.least_behind_price)
    if moving is not None:
        price -= of(moving, SEAM.hidden_price, 0.0)
    each_cell = np.float32(SEAM.added_price / math.hypot(*price.shape))
    if slide is None:
        price += each_cell
    else:
        price += each_cell * (1 - 2 * means(np.asarray(slide[overlap.box], np.float32), side))
    return price
