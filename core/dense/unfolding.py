"""Folds that mean nothing, taken out of a dense map.

Where a near thing hides a far one the map has to jump back, and what it jumps over is occluded. Wherever else it turns
over, noise does it: there the moves are smoothed until it no longer does.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.two_view import TwoView
from ..panorama.canvas import Canvas
from ..panorama.folding import jacobian
from ..panorama.visibility import occluded
from ..panorama.warp import Warp
from ..raster.arrays import Plane, beside
from ..system.threads import each
from .epipolar_lines import EpipolarLines

# How often occlusion is looked at, and how often moves are smoothed each time: by medians, which leave what is right as
# it is, then by means, which end what is left.
LOOKS, MEDIANS, MEANS = 2, 4, 4
# Nodes, a side, of a median; px of a mean at first: what does not help is done more widely.
MEDIAN, LEAST_SIGMA = 5, 1.5
# More px than noise moves a node by: smoothing that would move any of a patch further has met the edge of a near thing
# whose rim was not told, and the patch stays as it was.
MOST_MOVED = 8.0
# The area (share of the usual) that is left at a place not folded; px around what is occluded that are left alone.
LEAST_TURN, RIM = 0.1, 5
# One node in so many tells what is usual.
SPARSE = 17
# Nodes that smoothing looks at on each side, at most; rows that are looked at at once.
REACH, STRIP = 12, 128


def unfolded(
    lines: EpipolarLines, two_view: TwoView, cameras: tuple[Camera, Camera], along: Plane, across: Plane
) -> Plane:
    """The moves (h, w) along the lines without folds outside what is occluded and its rim.

    cameras: of reference and target.
    """
    around = np.ones((RIM, RIM), np.uint8)
    for _ in range(LOOKS):
        start, along = along, along.copy()
        x, y = lines.target(along, across)
        usual = _usual_area(x, y)
        folded = _turns_over(x, y, usual)
        if not folded.any():
            break
        free = cv2.dilate(_hidden(lines, two_view, cameras, along, x, y).astype(np.uint8), around) == 0
        folded &= free
        for number in range(MEDIANS + MEANS):
            if not folded.any():
                break
            sigma = LEAST_SIGMA * 2 ** (max(0, number - MEDIANS) / 6)
            reach = np.ones((2 * int(sigma) + 1,) * 2, np.uint8)
            near = cv2.dilate(folded.view(np.uint8), reach) & free
            rows, columns = np.nonzero(near.view(np.bool_))
            part = _span(rows, along.shape[0]), _span(columns, along.shape[1])
            if number < MEDIANS:
                smooth = cv2.medianBlur(np.ascontiguousarray(along[part]), MEDIAN)
            else:
                smooth = cv2.GaussianBlur(along[part], (0, 0), sigma)
            np.copyto(along[part], smooth, where=near[part].view(np.bool_))
            x[rows, columns], y[rows, columns] = lines.target(along, across, (rows, columns))
            # these and their neighbours may have come to fold, or no longer do
            changed = np.flatnonzero(cv2.dilate(near, np.ones((3, 3), np.uint8)).view(np.bool_))
            folded.ravel()[changed] = _turned(_areas(x, y, changed), usual)
            folded &= free
        along = _where_little_moved(along, start)
    return along


def _span(places: NDArray[np.intp], count: int) -> slice:
    """What of `count` rows or columns smoothing at some of them looks at."""
    return slice(max(0, int(places.min(initial=count)) - REACH), min(count, int(places.max(initial=0)) + REACH + 1))


def _where_little_moved(along: Plane, start: Plane) -> Plane:
    """The moves, those of patches in which any is further from its start than noise goes put back."""
    moved = np.abs(along - start)
    if not (moved > MOST_MOVED).any():
        return along
    count, patch = cv2.connectedComponents((moved > 0).astype(np.uint8))
    most = np.zeros(count, np.float32)
    np.maximum.at(most, patch.ravel(), moved.ravel())
    most[0] = 0
    return np.where(most[patch] > MOST_MOVED, start, along)


def _usual_area(x: Plane, y: Plane) -> float:
    """The area, with its sign, that a map's nodes take up; NaN where it leads nowhere."""
    known = _areas(x, y, np.arange(0, x.size, SPARSE))
    known = known[np.isfinite(known)]
    return float(np.median(known)) if known.size else np.nan


def _areas(x: Plane, y: Plane, nodes: NDArray[np.intp]) -> NDArray[np.float32]:
    """The `jacobian` of a map (h, w) at some nodes (flat indices)."""
    rows, columns = x.shape
    row, column = np.divmod(nodes, columns)
    ends = [(nodes - (column > 0), nodes + (column < columns - 1)),
            (nodes - columns * (row > 0), nodes + columns * (row < rows - 1))]  # fmt: skip
    (x_across, y_across), (x_down, y_down) = (
        tuple(np.take(values, after) - np.take(values, before) for values in (x, y)) for before, after in ends
    )
    many = ((column > 0) + (column < columns - 1).astype(np.float32)) * (
        (row > 0) + (row < rows - 1).astype(np.float32)
    )
    return np.divide(x_across * y_down - x_down * y_across, many, dtype=np.float32)


def _turned(areas: NDArray[np.float32], usual: float) -> NDArray[np.bool_]:
    """Which areas say that the map turns over."""
    with np.errstate(invalid="ignore"):
        return areas * np.float32(np.sign(usual)) <= np.float32(LEAST_TURN * abs(usual))


def _turns_over(x: Plane, y: Plane, usual: float) -> NDArray[np.bool_]:
    folded = np.empty(x.shape, bool)

    def look(top: int) -> None:
        rows = slice(top, min(top + STRIP, len(x)))
        near, here = beside(rows, 1, len(x))
        folded[rows] = _turned(jacobian(x[near], y[near]), usual)[here]

    each(look, range(0, len(x), STRIP))
    return folded


def _hidden(
    lines: EpipolarLines, two_view: TwoView, cameras: tuple[Camera, Camera], along: Plane, x: Plane, y: Plane
) -> NDArray[np.bool_]:
    """Which nodes (h, w) the target cannot see; x, y: where they fall."""
    rows, columns = lines.shape
    left, top, width, height = lines.box
    sx, sy = width / columns, height / rows
    # nodes as the pixels of a canvas of their own
    to_reference = np.array([[sx, 0, left + (sx - 1) / 2], [0, sy, top + (sy - 1) / 2], [0, 0, 1]])
    depth = lines.inverse_depth + along * lines.depth_per_px
    warp = Warp(Canvas(columns, rows, (0, 0)), x, y, depth.astype(np.float32))
    # the reference's camera in px of the nodes, so that its lens is undone there
    of_nodes = replace(cameras[0], K=np.linalg.inv(to_reference) @ cameras[0].K, size=(columns, rows))
    return occluded(warp, replace(two_view, H_inf=two_view.H_inf @ to_reference), cameras[1].size, of_nodes)
