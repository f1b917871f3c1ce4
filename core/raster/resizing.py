"""Where a pixel lies after its picture was resized. Pixel centres are integers, so the picture's corner is at −½."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Array


def size_change(size: ArrayLike, new_size: ArrayLike) -> tuple[Array, Array]:
    """factor and shift, each of the shape of the sizes (W, H): pixel p of the old size is factor p + shift of the new.
    """
    factor = np.asarray(new_size) / np.asarray(size)
    return factor, (factor - 1) / 2


def resized_points(points: NDArray[Any], size: ArrayLike, new_size: ArrayLike) -> Array:
    """Points (…, 2) px of a picture of one size (W, H) in px of the same picture at a new size.

    One coordinate (…,) with a length of one axis for either size works alike.
    """
    resized: Array = (points + 0.5) * (np.asarray(new_size) / np.asarray(size)) - 0.5
    return resized
