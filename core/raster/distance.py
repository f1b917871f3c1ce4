"""Distances in px to the inside or the outside of a mask."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .arrays import Array


def outside(inside: NDArray[np.bool_], step: int = 1) -> Array:
    """Distance in px (h, w) of cells to a mask of cells, 0 inside and inf if it is empty; step: px of a cell's side.

    A cell beside the mask may touch what the mask stands for, so one cell is subtracted.
    """
    if not inside.any():
        return np.full(inside.shape, np.inf)
    distance: Array = np.maximum(distance_to(inside) - 1.0, 0.0) * float(step)
    return distance


def distance_to(mask: NDArray[np.bool_]) -> Array:
    """Distance in px (h, w) to the nearest pixel of a mask, 0 in it; very large if it is empty."""
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    # OpenCV's root has other last bits from call to call; squared distances are whole numbers
    exact: Array = np.sqrt(np.rint(np.square(distance, dtype=np.float64)))
    return exact


def distance_to_border(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in px (H, W) to the nearest pixel outside a mask; beyond the picture's edges is outside too."""
    return distance_inside(np.pad(mask, 1))[1:-1, 1:-1]


def distance_inside(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in px (H, W) to the nearest pixel of the picture outside a mask; very large if there is none."""
    distance: NDArray[np.float32] = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return distance
