"""Blending across a seam in several bands (Burt and Adelson, ACM TOG 1983): fine detail changes over within a pixel or
two, broad light over as many as the coarsest band is wide.

What is blended is the *difference* of the two pictures, in tones, where they show the same; elsewhere it is continued
smoothly from there. So a picture's border, a hole or a thing that only one of them sees leaves no dark fringe and no
ghost: across it light is evened out and content is cut hard. Beyond the band every pixel stays bit for bit what it was.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from .light import for_each_channel, strips
from .threads import each

# Tones less than this away from what they were are what they were.
NOTHING = 1e-5
# The width of the coarsest band, as a share of the canvas's diagonal.
WIDTH = 1 / 50
FEWEST, MOST = 3, 7


def bands_for(canvas: NDArray) -> int:
    """How many bands a canvas (H, W, …) is blended in."""
    return int(np.clip(np.rint(math.log2(WIDTH * math.hypot(canvas.shape[0], canvas.shape[1]))), FEWEST, MOST))


def correction(
    difference: NDArray[np.float32], same: NDArray[np.bool_], from_target: NDArray[np.bool_],
    shown: NDArray[np.bool_], bands: int,
) -> NDArray[np.float32]:
    """What is to be added to the tones (h, w, C) of pictures cut hard along a seam, so that they blend.

    difference (h, w, C): target's tones less the reference's, where `same`; from_target (h, w): which side of the seam
    a pixel lies on, where anything is `shown`. The difference is written over.
    """
    # on the far side of the seam: what the picture of this side would show there, had it the other's light
    _weigh(difference, same.astype(np.float32))
    light = _filled(difference, same.astype(np.float32))
    del difference  # as large as the overlap: the peak of memory is here
    # a pixel's width to either side, or else the finest band is cut with a pair of scissors
    share = cv2.blur(_from_nearest(from_target, shown).astype(np.float32), (3, 3), borderType=cv2.BORDER_REPLICATE)
    share = share[..., None]
    blended = _masked_bands(light, share, bands)

    def put(rows: slice) -> None:
        part, whole = blended[rows], light[rows]
        over = for_each_channel(from_target[rows].astype(np.float32), part.shape[2])
        part -= over * whole
        # the bands of a pyramid overshoot: no pixel leaves what lies between the two pictures
        whole = whole * (1 - 2 * over)
        np.clip(part, np.minimum(whole, 0), np.maximum(whole, 0), out=part)
        part[np.abs(part) < NOTHING] = 0

    each(put, strips(blended.shape))
    return blended


def _weigh(values: NDArray[np.float32], weight: NDArray[np.float32]) -> None:
    """Multiplies values (h, w, C) by a weight (h, w), in place."""

    def put(rows: slice) -> None:
        values[rows] *= for_each_channel(weight[rows], values.shape[2])

    each(put, strips(values.shape))


def _from_nearest(values: NDArray[np.bool_], known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Values (h, w) where known, elsewhere those of the nearest pixel that is."""
    if known.all() or not known.any():
        return values
    _, nearest = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    by_label = np.zeros(int(nearest.max()) + 1, bool)
    by_label[nearest[known]] = values[known]
    return by_label[nearest]


def filled(
    values: NDArray[np.float32], known: NDArray[np.bool_] | NDArray[np.float32]
) -> NDArray[np.float32]:
    """Values (h, w, C) where known, or by how well (0..1), continued smoothly elsewhere (pull and push: means over ever
    larger cells fill what smaller ones leave open; Gortler et al., SIGGRAPH 1996, section 3.4)."""
    weight = known.astype(np.float32)
    return _filled(values * for_each_channel(weight, values.shape[2]), weight)


def _filled(sums: NDArray[np.float32], weight: NDArray[np.float32]) -> NDArray[np.float32]:
    # sums are written over, for there is little else as large in memory
    whole = weight if weight.max(initial=0) <= 1 else np.minimum(weight, 1)
    if min(weight.shape) <= 2 or whole.min() == 1:
        own = sums / np.maximum(weight, np.float32(1e-6))[..., None]
        mean = sums.sum(axis=(0, 1)) / max(float(weight.sum()), 1e-6)
        return own * whole[..., None] + mean.astype(np.float32) * (1 - whole)[..., None]
    # weights grow on the way up: a cell with a quarter of it known is known
    channels = sums.shape[2]
    coarser = _filled(4 * _down(sums), 4 * _down(weight[..., None])[..., 0])
    out = _up(coarser, weight.shape)

    def put(rows: slice) -> None:
        known = whole[rows]
        out[rows] *= for_each_channel(1 - known, channels)
        sums[rows] *= for_each_channel(known / np.maximum(weight[rows], np.float32(1e-6)), channels)
        out[rows] += sums[rows]

    each(put, strips(out.shape))
    return out


def _masked_bands(light: NDArray[np.float32], share: NDArray[np.float32], bands: int) -> NDArray[np.float32]:
    """The sum of the Laplacian bands of `light`, each weighed by the Gaussian level of `share` that goes with it."""
    if bands == 0 or min(light.shape[:2]) <= 2:
        return light * share
    coarser, smooth = _down(light), _down(share)
    band = _up(coarser, light.shape[:2])
    np.subtract(light, band, out=band)
    _weigh(band, share[..., 0])
    below = _masked_bands(coarser, smooth, bands - 1)
    for k in range(band.shape[2]):  # one channel at a time: all at once would be as large as the overlap
        band[..., k] += _up(np.ascontiguousarray(below[..., k : k + 1]), light.shape[:2])[..., 0]
    return band


def _down(values: NDArray[np.float32]) -> NDArray[np.float32]:
    out = cv2.pyrDown(values, borderType=cv2.BORDER_REFLECT_101)
    return out.reshape(*out.shape[:2], values.shape[2])


def _up(values: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    out = cv2.pyrUp(values, dstsize=(shape[1], shape[0]))
    return out.reshape(shape[0], shape[1], values.shape[2])
