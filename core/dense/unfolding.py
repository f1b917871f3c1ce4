"""Removes folds from a dense map, except those that occlusion explains.

Where a near object hides a far one the map has to jump back, over what is occluded. A fold anywhere else is noise:
there the moves are smoothed until the map no longer folds.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.two_view import TwoView
from ..field.folding import jacobian
from ..field.visibility import nearness_of, occluded
from ..raster.arrays import Plane, beside
from ..raster.picture_map import PictureMap
from ..system.threads import each
from .epipolar_lines import EpipolarLines
from .options import UNFOLDING


def unfolded(
    lines: EpipolarLines, two_view: TwoView, target_size: tuple[int, int], along: Plane, across: Plane
) -> Plane:
    """The moves `along` (h, w) px, changed where the map folds outside occlusions and their rims.

    across (h, w): moves across the lines, px; target_size: (W, H) px.
    """
    window = np.ones((UNFOLDING.occlusion_margin,) * 2, np.uint8)
    for _ in range(UNFOLDING.rounds):
        start, along = along, along.copy()
        x, y = lines.target(along, across)
        usual = _usual_area(x, y)
        folded = _folded(x, y, usual)
        if not folded.any():
            break
        hidden = _hidden(lines, two_view, target_size, along, x, y).astype(np.uint8)
        visible = cv2.dilate(hidden, window) == 0
        folded &= visible
        for number in range(UNFOLDING.median_steps + UNFOLDING.mean_steps):
            if not folded.any():
                break
            means = max(0, number - UNFOLDING.median_steps)
            sigma = UNFOLDING.min_mean_sigma * 2 ** (means / UNFOLDING.means_per_doubling)
            reach = np.ones((2 * int(sigma) + 1,) * 2, np.uint8)
            nearby = cv2.dilate(folded.view(np.uint8), reach) & visible
            rows, columns = np.nonzero(nearby.view(np.bool_))
            part = _span(rows, along.shape[0]), _span(columns, along.shape[1])
            if number < UNFOLDING.median_steps:
                smooth = cv2.medianBlur(np.ascontiguousarray(along[part]), UNFOLDING.median_nodes)
            else:
                smooth = cv2.GaussianBlur(along[part], (0, 0), sigma)
            np.copyto(along[part], smooth, where=nearby[part].view(np.bool_))
            x[rows, columns], y[rows, columns] = lines.target(along, across, (rows, columns))
            # only the cells of these nodes and of their neighbours have changed
            changed = np.flatnonzero(cv2.dilate(nearby, np.ones((3, 3), np.uint8)).view(np.bool_))
            folded.ravel()[changed] = _is_fold(_areas(x, y, changed), usual)
            folded &= visible
        along = _without_large_moves(along, start)
    return along


def _span(places: NDArray[np.intp], count: int) -> slice:
    """The rows or columns (of `count`) that smoothing at `places` needs."""
    reach = UNFOLDING.smoothing_reach
    return slice(max(0, int(places.min(initial=count)) - reach), min(count, int(places.max(initial=0)) + reach + 1))


def _without_large_moves(along: Plane, start: Plane) -> Plane:
    """The moves (h, w) px, put back to `start` in connected patches where any of them changed by more than noise."""
    change = np.abs(along - start)
    if not (change > UNFOLDING.max_move_px).any():
        return along
    count, patch = cv2.connectedComponents((change > 0).astype(np.uint8))
    largest = np.zeros(count, np.float32)
    np.maximum.at(largest, patch.ravel(), change.ravel())
    largest[0] = 0
    return np.where(largest[patch] > UNFOLDING.max_move_px, start, along)


def _usual_area(x: Plane, y: Plane) -> float:
    """The median signed area, target px², of a node's cell; NaN where all of the map is NaN."""
    areas = _areas(x, y, np.arange(0, x.size, UNFOLDING.usual_area_every))
    areas = areas[np.isfinite(areas)]
    return float(np.median(areas)) if areas.size else np.nan


def _areas(x: Plane, y: Plane, nodes: NDArray[np.intp]) -> NDArray[np.float32]:
    """The `jacobian` (n,) of a map x, y (h, w) at nodes (n,), which are flat indices."""
    rows, columns = x.shape
    row, column = np.divmod(nodes, columns)
    ends = [(nodes - (column > 0), nodes + (column < columns - 1)),
            (nodes - columns * (row > 0), nodes + columns * (row < rows - 1))]  # fmt: skip
    (x_across, y_across), (x_down, y_down) = (
        tuple(np.take(values, after) - np.take(values, before) for values in (x, y)) for before, after in ends
    )
    spacing = ((column > 0) + (column < columns - 1).astype(np.float32)) * (
        (row > 0) + (row < rows - 1).astype(np.float32)
    )
    return np.divide(x_across * y_down - x_down * y_across, spacing, dtype=np.float32)


def _is_fold(areas: NDArray[np.float32], usual: float) -> NDArray[np.bool_]:
    """Which areas are turned over, or almost nothing, beside the usual one."""
    with np.errstate(invalid="ignore"):
        return areas * np.float32(np.sign(usual)) <= np.float32(UNFOLDING.min_relative_area * abs(usual))


def _folded(x: Plane, y: Plane, usual: float) -> NDArray[np.bool_]:
    """The nodes (h, w) at which a map x, y (h, w) folds."""
    folded = np.empty(x.shape, bool)

    def look(top: int) -> None:
        rows = slice(top, min(top + UNFOLDING.strip_rows, len(x)))
        with_neighbours, own = beside(rows, 1, len(x))
        folded[rows] = _is_fold(jacobian(x[with_neighbours], y[with_neighbours]), usual)[own]

    each(look, range(0, len(x), UNFOLDING.strip_rows))
    return folded


def _hidden(
    lines: EpipolarLines, two_view: TwoView, target_size: tuple[int, int], along: Plane, x: Plane, y: Plane
) -> NDArray[np.bool_]:
    """The nodes (h, w) that are occluded in the target; along (h, w) px: their moves, x, y (h, w): their target px."""
    # x'₃ of H_inf p + d e' at the nodes, whose ideal pixels p are without the lens
    row = two_view.H_inf[2]
    infinite = lines.ideal[..., 0] * row[0] + (lines.ideal[..., 1] * row[1] + row[2])
    depth = (lines.inverse_depth + along * lines.depth_per_px).astype(np.float32)
    with np.errstate(invalid="ignore", divide="ignore"):
        nearness = nearness_of(depth, depth * np.float32(two_view.e_prime[2]) + infinite.astype(np.float32))
    return occluded(PictureMap(x, y, target_size), nearness)
