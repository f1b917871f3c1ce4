"""Which of what the sweep found is to be believed."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array, Plane
from ...raster.picture_map import falls_inside
from .choice import Compared
from .options import SWEEP
from .sweep import Swept, swept


@dataclass(frozen=True, eq=False)
class Found:
    """Moves along (h, w) px from the base, and where (h, w) they were found."""

    along: Plane
    where: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Hints:
    """What is known before the search: inverse ranges (N,) of points at columns and rows (N,) of the chart; d (H, W),
    and where (H, W) it was found, on the chart of half the size."""

    columns: Array
    rows: Array
    inverse_ranges: Array
    d: Plane
    where: NDArray[np.bool_]


def found_on(compared: Compared, span: tuple[int, int]) -> Found:
    """Search a patch from so many px from the base to so many."""
    best = swept(compared, *span)
    where = best.unique & compared.several & _agreed(compared, best)
    if where.any():
        usual = SWEEP.usual_factor * float(np.percentile(best.cost[where], SWEEP.usual_percent))
        where &= best.cost <= max(SWEEP.least_cost, usual)
    where &= ~_small(best.along, where, SWEEP.speckle)
    where &= ~_wrong(best, where, _small(best.along, where, SWEEP.island), SWEEP.island_gain, SWEEP.island_cost)
    doubtful = where & (compared.from_rim < 1) & (np.abs(best.along - compared.field_px) > SWEEP.rim_px)
    doubtful &= ~_going_on(best.along, where & ~doubtful, doubtful)
    where &= ~_wrong(best, where, doubtful, SWEEP.rim_gain, SWEEP.rim_cost)
    return Found(best.along, where)


def span_of(compared: Compared, hints: Hints) -> tuple[int, int]:
    """px from the base, to both sides, that hints ask to be searched."""
    patch, lows, highs = compared.patch, [0.0], [0.0]
    height, width = patch.shape
    row, column = hints.rows - patch.top, (hints.columns - patch.left) % patch.chart.circumference
    here = (row >= 0) & (row < height) & (column < width)
    if here.any():
        at = row[here].astype(int), column[here].astype(int)
        px = (hints.inverse_ranges[here] - compared.base[at]) / compared.per_px[at]
        percent = SWEEP.points_percent
        lows.append(float(np.percentile(px, percent)))
        highs.append(float(np.percentile(px, 100 - percent)))
    d, where = (patch.of_chart(values, times=2) for values in (hints.d, hints.where))
    if where.sum() > SWEEP.least_found:
        px = ((d - compared.base) / compared.per_px)[where]
        lows.append(float(np.percentile(px, SWEEP.range_percent)))
        highs.append(float(np.percentile(px, 100 - SWEEP.range_percent)))
    # nothing lies beyond infinity
    lows = [max(min(lows), float(compared.infinity_px.min()) - SWEEP.margin_px)]
    margin, few, many = SWEEP.margin_px, SWEEP.least_range_px, SWEEP.most_range_px
    low, high = np.floor(min(lows) - margin), np.ceil(max(highs) + margin)
    return int(np.clip(low, -many, -few)), int(np.clip(high, few, many))


def _agreed(compared: Compared, best: Swept) -> NDArray[np.bool_]:
    """The nodes (h, w) that some other picture agrees with: of all that fall on its pixel the best lies as far."""
    agreed, d = np.zeros(best.along.shape, bool), compared.at(best.along)
    for number, seen in enumerate(compared.seen):
        height, width = seen.picture.levels.shape[:2]
        x, y = seen.places(d)
        here = np.nonzero(falls_inside(x, y, (width, height)) & (compared.owner != number))
        cell = np.rint(y[here]).astype(np.int64) * width + np.rint(x[here]).astype(np.int64)
        order = np.lexsort((best.summed[here], cell))
        begins = np.flatnonzero(np.diff(cell[order], prepend=-1))
        along = best.along[here][order]
        of_best = np.repeat(along[begins], np.diff(begins, append=len(order)))
        agree = np.zeros(len(order), bool)
        agree[order] = np.abs(along - of_best) <= SWEEP.agreement_px
        agreed[here] |= agree
    return agreed


def _small(along: Plane, where: NDArray[np.bool_], side: float) -> NDArray[np.bool_]:
    """The found nodes (h, w) of pieces that are smaller than a square of so many nodes a side."""
    sixteenths = np.where(where, np.rint(along * 16), np.iinfo(np.int16).min).astype(np.int16)
    cv2.filterSpeckles(sixteenths, np.iinfo(np.int16).min, int(side**2), SWEEP.speckle_px * 16)
    small: NDArray[np.bool_] = where & (sixteenths == np.iinfo(np.int16).min)
    return small


def _going_on(along: Plane, sure: NDArray[np.bool_], doubtful: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The doubtful nodes (h, w) on which the surface of sure ones goes on, node by node without a jump."""
    reached = sure.copy()
    steps = [(axis, np.abs(np.diff(along, axis=axis)) <= SWEEP.speckle_px) for axis in (0, 1)]
    while True:
        before = reached.copy()
        for axis, smooth in steps:
            first, second = (np.moveaxis(reached, axis, 0)[part] for part in (slice(None, -1), slice(1, None)))
            may = np.moveaxis(doubtful, axis, 0)
            close = np.moveaxis(smooth, axis, 0)
            second |= first & close & may[1:]
            first |= second & close & may[:-1]
        if np.array_equal(before, reached):
            return reached & doubtful


def _wrong(
    best: Swept, where: NDArray[np.bool_], island: NDArray[np.bool_], least_gain: float, most_cost: float
) -> NDArray[np.bool_]:
    """The nodes (h, w) of islands in which the pictures are not more alike by some levels than where the field lies, or
    differ by more than so many medians of all that was found."""
    if not island.any():
        return island
    count, numbers = cv2.connectedComponents(island.astype(np.uint8), connectivity=4)
    flat = numbers.ravel()
    size = np.maximum(np.bincount(flat, minlength=count), 1)
    cost, at_field = (
        np.bincount(flat, values.ravel().astype(np.float64), count) / size for values in (best.cost, best.field_cost)
    )
    usual = max(float(np.median(best.cost[where])), SWEEP.island_floor)
    wrong = (at_field - cost <= least_gain) | (cost >= most_cost * usual)
    wrong[0] = False
    found: NDArray[np.bool_] = wrong[numbers]
    return found
