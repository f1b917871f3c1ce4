"""Distances in px to the inside or the outside of a mask."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .arrays import Array


def outside(inside: NDArray[np.bool_], step: int = 1) -> Array:
    """How many px the cells of a mask (h, w) lie outside it, inf where it is empty; step: px from cell to cell.

    A cell beside the last inside one may still touch what is meant: distances count from one cell on.
    """
    if not inside.any():
        return np.full(inside.shape, np.inf)
    steps = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # OpenCV's root has other last bits from call to call; squared distances are whole numbers
    steps = np.sqrt(np.rint(np.square(steps, dtype=np.float64)))
    distance: Array = np.maximum(steps - 1, 0.0) * step
    return distance


def distance_to_border(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in px (H, W) to the nearest pixel outside a mask; what lies beyond the canvas is outside."""
    return distance_inside(np.pad(mask, 1))[1:-1, 1:-1]


def distance_inside(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in px (H, W) to the nearest pixel outside a mask, however far."""
    distance: NDArray[np.float32] = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return distance
