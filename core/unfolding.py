"""Folds that mean nothing, taken out of a dense map.

Where a near thing hides a far one the map has to jump back, and what it jumps over is occluded. Wherever else it turns
over, noise does it: there the moves are smoothed until it no longer does.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .canvas import Canvas
from .line_map import Lines, Plane
from .occlusion import occluded
from .two_view import TwoView
from .warp import Warp, jacobian

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


def unfolded(lines: Lines, two_view: TwoView, target_size: tuple[int, int], along: Plane, across: Plane) -> Plane:
    """The moves (h, w) along the lines without folds outside what is occluded and its rim."""
    around = np.ones((RIM, RIM), np.uint8)
    for _ in range(LOOKS):
        start = along
        keep = cv2.dilate(_hidden(lines, two_view, target_size, along, across).astype(np.uint8), around) > 0
        for number in range(MEDIANS + MEANS):
            folded = _turns_over(*lines.target(along, across)) & ~keep
            if not folded.any():
                break
            sigma = LEAST_SIGMA * 2 ** (max(0, number - MEDIANS) / 6)
            reach = np.ones((2 * int(sigma) + 1,) * 2, np.uint8)
            near = (cv2.dilate(folded.astype(np.uint8), reach) > 0) & ~keep
            smooth = cv2.medianBlur(along, MEDIAN) if number < MEDIANS else cv2.GaussianBlur(along, (0, 0), sigma)
            along = np.where(near, smooth, along)
        along = _where_little_moved(along, start)
    return along


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


def _turns_over(x: Plane, y: Plane) -> NDArray[np.bool_]:
    turn = jacobian(x, y)
    known = turn.ravel()[::SPARSE]
    known = known[np.isfinite(known)]
    if not known.size:
        return np.zeros(turn.shape, bool)
    usual = float(np.median(known))
    with np.errstate(invalid="ignore"):
        return turn * np.sign(usual) <= LEAST_TURN * abs(usual)


def _hidden(
    lines: Lines, two_view: TwoView, target_size: tuple[int, int], along: Plane, across: Plane
) -> NDArray[np.bool_]:
    """Which nodes (h, w) the target cannot see."""
    rows, columns = lines.shape
    x, y = lines.target(along, across)
    left, top, width, height = lines.box
    sx, sy = width / columns, height / rows
    # nodes as the pixels of a canvas of their own
    to_reference = np.array([[sx, 0, left + (sx - 1) / 2], [0, sy, top + (sy - 1) / 2], [0, 0, 1]])
    depth = lines.inverse_depth + along * lines.moved
    warp = Warp(Canvas(columns, rows, (0, 0)), x, y, depth.astype(np.float32))
    return occluded(warp, replace(two_view, H_inf=two_view.H_inf @ to_reference), target_size)
