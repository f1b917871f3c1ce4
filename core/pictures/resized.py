"""Pictures made smaller."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .picture import Picture


def resized(picture: Picture, scale: float) -> Picture:
    """Shrink a picture.

    Parameters
    ----------
    picture : Picture
        The picture, which stays as it is.
    scale : float
        Of its sides, at most 1.

    Returns
    -------
    Picture
        Each pixel is the mean light of what it covers, weighted by alpha.
    """
    height, width = picture.light.shape[:2]
    size = max(1, round(width * scale)), max(1, round(height * scale))
    if size == (width, height):
        return picture

    def shrink(array: NDArray[Any]) -> NDArray[Any]:
        small: NDArray[Any] = cv2.resize(array, size, interpolation=cv2.INTER_AREA)
        return small.reshape(size[1], size[0], *array.shape[2:])

    if picture.wanted is not None:
        picture = replace(picture, wanted=shrink(picture.wanted.astype(np.float32)) >= 0.5)
    if picture.alpha is None:
        return replace(picture, light=shrink(picture.pixels), view=shrink(picture.view))
    weight, alpha = picture.alpha[..., None], shrink(picture.alpha)

    def weighed(array: NDArray[Any]) -> NDArray[Any]:
        """Means weighted by alpha: what lies under transparent pixels does not count."""
        mean: NDArray[Any] = shrink(array * weight) / np.maximum(alpha, 1e-6)[..., None]
        return mean

    view = np.clip(np.rint(weighed(picture.view)), 0, 255).astype(np.uint8)
    burnt_in = None if picture.burnt_in is None else shrink(picture.burnt_in.astype(np.float32)) > 0
    return replace(picture, light=weighed(picture.pixels), alpha=alpha, view=view, burnt_in=burnt_in)
