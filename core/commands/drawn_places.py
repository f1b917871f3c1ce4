"""Places of a picture that were drawn in the window, as the mask of what the panorama is to show of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.masks import read_wanted
from .options import DRAWN


def with_circles(
    mask: NDArray[Any] | None, circles: Sequence[Sequence[float]], size: tuple[int, int], name: str
) -> NDArray[np.bool_]:
    """A mask with filled circles.

    Parameters
    ----------
    mask : ndarray or None
        What was painted, as `read_wanted` takes it.
    circles : sequence of (x, y, radius)
        px of the picture.
    size : (int, int)
        (W, H) px of the picture.
    name : str
        What the picture is called.

    Returns
    -------
    (h, w) bool array
        In the shape of the picture, and of its size unless that is larger than is drawn on.
    """
    share = min(1.0, DRAWN.side / max(size))
    width, height = (max(1, round(side * share)) for side in size)
    drawn = np.zeros((height, width), np.uint8)
    if mask is not None:
        drawn[read_wanted(mask, (width, height), name)] = 1
    for x, y, radius in circles:
        at = (round((x + 0.5) * share - 0.5), round((y + 0.5) * share - 0.5))
        cv2.circle(drawn, at, max(1, round(radius * share)), 1, cv2.FILLED)
    return drawn > 0
