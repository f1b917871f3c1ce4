"""The largest rectangle within a mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import Box


def largest_rectangle(shows: NDArray[np.bool_]) -> Box:
    """The largest axis-parallel rectangle (left, top, width, height) of True pixels of a mask (H, W).

    Exact; of equals the one that ends first, from the top, then from the left; (0, 0, 0, 0) where nothing is True.
    """
    height, width = shows.shape
    column = np.arange(width, dtype=np.int64)
    # For each pixel of a row: how far its column is True upwards, and how far a rectangle of that height can be
    # widened. The largest rectangle is found from some pixel of its last row; each step works on a whole row at once.
    up, left, right = np.zeros(width, np.int64), np.zeros(width, np.int64), np.full(width, width, np.int64)
    best, box = 0, (0, 0, 0, 0)
    for row, here in enumerate(shows):
        row_left = np.maximum.accumulate(np.where(here, 0, column + 1))
        row_right = np.minimum.accumulate(np.where(here, width, column)[::-1])[::-1]
        up = np.where(here, up + 1, 0)
        left = np.where(here, np.maximum(left, row_left), 0)
        right = np.where(here, np.minimum(right, row_right), width)
        area = up * (right - left)
        at = int(area.argmax())
        if area[at] > best:
            best = int(area[at])
            box = (int(left[at]), row + 1 - int(up[at]), int(right[at] - left[at]), int(up[at]))
    return box
