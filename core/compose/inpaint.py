"""Filling holes that no camera saw, if asked for: smoothly, from what lies behind. No detail is invented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import Part, bounds, dilated, with_margin
from ..raster.lazy import AnyImage, Retouched
from ..raster.log_encoding import log_decode, log_encode
from ..raster.pull_push import filled
from .options import INPAINT


def holes_of(hidden: NDArray[np.bool_], before: Layer, layer: Layer) -> NDArray[np.bool_]:
    """Where (H, W) no camera saw anything: hidden (H, W) from the added picture, not shown by the panorama before."""
    holes: NDArray[np.bool_] = hidden & (before.alpha == 0) & (layer.alpha > 0)
    return holes


def inpainted(panorama: Layer, holes: NDArray[np.bool_], inverse_depth: AnyImage) -> Layer:
    """Fill holes with a smooth continuation of what lies around them, opaque; all other pixels keep their bits.

    Parameters
    ----------
    panorama : Layer
    holes : (H, W) bool array
        What is filled.
    inverse_depth : (H, W) image
        Of the canvas, 1 / baseline. Something near hid the hole, so it is filled from what lies further away than
        halfway to that.

    Returns
    -------
    Layer
    """
    extent = bounds(holes)
    if extent is None:
        return panorama
    box = with_margin(extent, INPAINT.reach_px, holes.shape)
    missing = holes[box]
    beside = dilated(missing, INPAINT.reach_px) & ~missing & (panorama.alpha[box] > 0)
    far = _far(inverse_depth[box], missing, beside)
    weight = beside * np.where(far, np.float32(1), np.float32(INPAINT.near_weight))
    tones = filled(log_encode(panorama.light[box]), weight)
    at = box[0].start, box[1].start
    alpha = panorama.alpha.copy()
    alpha[box][missing] = 1
    return Layer(Patched(panorama.light, at, missing, log_decode(tones)), alpha)


def _far(inverse_depth: NDArray[Any], missing: NDArray[np.bool_], beside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) depth lies beyond the middle between the hole's own and the nearest that lies `beside` it."""
    depth = np.nan_to_num(inverse_depth).astype(np.float32)
    behind = filled(depth[..., None], missing.astype(np.float32))[..., 0]
    side = 2 * INPAINT.reach_px + 1
    nearest = cv2.dilate(np.where(beside, depth, depth.min()).astype(np.float32), np.ones((side, side), np.uint8))
    far: NDArray[np.bool_] = depth <= (behind + np.maximum(nearest, behind)) / 2
    return far


@dataclass(frozen=True, eq=False)
class Patched(Retouched):
    """Light with the pixels of a patch (h, w, C) in place of those that are touched."""

    patch: NDArray[np.float32]

    def anew(self, before: NDArray[np.float32], there: Part) -> NDArray[np.float32]:
        """See `Retouched`."""
        pixels: NDArray[np.float32] = self.patch[there][self.touched[there]]
        return pixels
