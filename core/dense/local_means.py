"""Two pictures beside each other around every node: without their local means, and the gain between them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .options import POLISH


def mean(values: Plane, side: int) -> Plane:
    """Means over a square window."""
    means: Plane = cv2.blur(values, (side, side), borderType=cv2.BORDER_REFLECT_101)
    return means


def mean_there(values: Plane, share: Plane | None) -> Plane:
    """Means over the surroundings, of which a share is valid (None: all), of values that are 0 where they are not."""
    means = mean(values, POLISH.surroundings_px)
    return means if share is None else np.divide(means, share, out=means)


def without_means(a: Plane, b: Plane, valid: NDArray[np.bool_]) -> tuple[Plane, Plane, Plane | None]:
    """Both minus their local means, 0 where not valid, and the valid share of the surroundings, None if all is valid.
    """
    if valid.all():
        return a - mean(a, POLISH.surroundings_px), b - mean(b, POLISH.surroundings_px), None
    weight = valid.astype(np.float32)
    share = np.maximum(mean(weight, POLISH.surroundings_px), np.float32(1e-3))
    a, b = ((values - mean_there(values * weight, share)) * weight for values in (a, b))
    return a, b, share


def local_gain(a: Plane, b: Plane, share: Plane | None) -> Plane:
    """What b has to be multiplied by to have the contrast of a, both without their means (see `without_means`)."""
    gain = mean_there(a * b, share)
    gain += POLISH.gain_noise
    gain /= mean_there(b * b, share) + POLISH.gain_noise
    return np.clip(gain, np.float32(1 / POLISH.max_gain), np.float32(POLISH.max_gain), out=gain)
