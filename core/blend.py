"""Two layers into one picture, in scene-linear float: feathered across the overlap, or averaged."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .warp import Layer

BLENDS = ("feather", "linear")


def blend(reference: Layer, target: Layer, mode: str) -> Layer:
    """One layer from two on the same canvas; straight alpha.

    feather: each picture counts by the distance to its own border, so neither shows an edge. linear: both count alike
    wherever both show something (the plain average of the literature: it hides nothing). Where one shows nothing the
    other is taken as it is.
    """
    shows, shows_too = reference.alpha > 0, target.alpha > 0
    pixels, alpha = target.pixels.copy(), np.where(shows, reference.alpha, target.alpha)
    np.copyto(pixels, reference.pixels, where=shows[..., None])
    box = _bounds(shows & shows_too)
    if box is not None:
        both = (shows & shows_too)[box]
        share = _feather_share(shows, shows_too)[box] if mode == "feather" else np.full(both.shape, 0.5, np.float32)
        weight, weight_too = share * reference.alpha[box], (1 - share) * target.alpha[box]
        total = weight + weight_too
        mixed = reference.pixels[box] * weight[..., None] + target.pixels[box] * weight_too[..., None]
        mixed /= np.maximum(total, 1e-12)[..., None]
        np.copyto(pixels[box], mixed, where=both[..., None])
        # what one picture shows whole is not seen through, however soft the other's edge
        np.maximum(alpha[box], target.alpha[box], out=alpha[box], where=both)
    return Layer(pixels, alpha)


def _feather_share(shows: NDArray[np.bool_], shows_too: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The reference's weight (H, W) in [0, 1] where both show something."""
    inner, inner_too = _distance_to_border(shows), _distance_to_border(shows_too)
    return inner / np.maximum(inner + inner_too, 1e-6)


def _distance_to_border(mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Distance in px to the nearest pixel outside the mask; what lies beyond the canvas is outside."""
    padded = np.pad(mask.astype(np.uint8), 1)
    return cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1]


def _bounds(mask: NDArray[np.bool_]) -> tuple[slice, slice] | None:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return None
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
