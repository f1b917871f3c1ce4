"""Blending across a seam in several bands (Burt and Adelson, ACM TOG 1983).

Fine detail changes over within a pixel or two, broad light over the width of the coarsest band. What is blended is the
*difference* of the two pictures' tones where they show the same; elsewhere it is continued smoothly from there. So
where only one picture sees a thing, light is evened out and content is cut hard: no dark fringe, no ghost. Beyond the
band every pixel keeps its bits.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane, strips
from ..raster.pull_push import expanded, pulled, pulled_weights, push, reduced
from ..system.threads import each
from .options import BANDS


def bands_for(canvas: NDArray[Any]) -> int:
    """How many bands a canvas (H, W, …) is blended in."""
    width = BANDS.coarsest_width * math.hypot(canvas.shape[0], canvas.shape[1])
    return int(np.clip(np.rint(math.log2(width)), BANDS.min_bands, BANDS.max_bands))


def correction(
    difference: NDArray[np.float32], same: NDArray[np.bool_], chosen: NDArray[np.bool_],
    shown: NDArray[np.bool_], bands: int,
) -> NDArray[np.float32]:
    """What is to be added to the tones of two pictures cut hard along a seam, so that they blend.

    Parameters
    ----------
    difference : (h, w, C) float32 array
        Tones of the added layer minus those of the panorama before. Overwritten with the result.
    same : (h, w) bool array
        Where both show the same, so that the difference is one of light.
    chosen : (h, w) bool array
        What comes from the added layer.
    shown : (h, w) bool array
        Where anything is shown.
    bands : int

    Returns
    -------
    (h, w, C) float32 array
        0 beyond the coarsest band.
    """
    # channel by channel: all at once would be the peak of a stitch's memory
    channels = range(difference.shape[2])
    weights = pulled_weights(same.astype(np.float32))
    for k in channels:
        # continued beyond where both show the same
        difference[..., k] = push(pulled(difference[..., k] * weights[0], weights), weights)
    del weights
    # a pixel wide on either side, so that the finest band has no hard edge
    share = cv2.blur(_from_nearest(chosen, shown).astype(np.float32), (3, 3), borderType=cv2.BORDER_REPLICATE)
    shares = [share]
    while len(shares) <= bands and min(shares[-1].shape) > 2:
        shares.append(reduced(shares[-1]))
    for k in channels:
        light = np.ascontiguousarray(difference[..., k])
        blended = _masked_bands(light, shares)

        def put(rows: slice, light: Plane = light, blended: Plane = blended, k: int = k) -> None:
            change, full, added = blended[rows], light[rows], chosen[rows]
            change -= added * full
            # bands overshoot: tones are held between those of the two pictures
            full = np.where(added, -full, full)
            np.clip(change, np.minimum(full, 0), np.maximum(full, 0), out=change)
            change[np.abs(change) < BANDS.negligible_tone] = 0
            difference[rows, :, k] = change

        each(put, strips(blended.shape))
    return difference


def _from_nearest(values: NDArray[np.bool_], known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Values (h, w) where known (h, w), elsewhere those of the nearest known pixel."""
    if known.all() or not known.any():
        return values
    _, nearest = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    by_label = np.zeros(int(nearest.max()) + 1, bool)
    by_label[nearest[known]] = values[known]
    nearest_values: NDArray[np.bool_] = by_label[nearest]
    return nearest_values


def _masked_bands(light: Plane, shares: list[Plane]) -> Plane:
    """The sum of the Laplacian bands of light (h, w), each weighted by its level of a Gaussian pyramid of shares."""
    share, *smoother = shares
    if not smoother:
        return light * share
    coarser = reduced(light)
    band = expanded(coarser, light.shape)
    np.subtract(light, band, out=band)
    band *= share
    band += expanded(_masked_bands(coarser, smoother), light.shape)
    return band
