"""Tones of one picture as another has them."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array
from .options import MATCHING


def tone_curves(
    first: NDArray[np.uint8], second: NDArray[Any], both: NDArray[np.bool_], levels: int
) -> list[NDArray[np.uint8]]:
    """For each channel of a second picture (h, w[, C]) the curve (levels,) from its levels to those of the first that
    matches its histogram over the mask `both` (h, w) to the first's."""
    mask, share = both.view(np.uint8), np.linspace(0, 1, MATCHING.tone_quantiles + 1)

    def quantiles(picture: NDArray[Any], k: int, count: int) -> Array:
        """Quantiles of channel k, of `count` levels; a level's own pixels count half below it, half above."""
        n = cv2.calcHist([picture], [k], mask, [count], [0, count]).ravel().astype(np.float64)
        occupied = np.flatnonzero(n)
        return np.interp(share * n.sum(), (np.cumsum(n) - n / 2)[occupied], occupied)

    channels = range(second.shape[2] if second.ndim == 3 else 1)
    return [
        rounded_levels(np.interp(np.arange(levels), quantiles(second, k, levels), quantiles(first, k, 256)))
        for k in channels
    ]


def rounded_levels(values: NDArray[Any]) -> NDArray[np.uint8]:
    """Values as levels, 0 to 255."""
    result: NDArray[np.uint8] = np.clip(np.rint(values), 0, 255).astype(np.uint8)
    return result
