"""Where two layers both show something, and how they differ there: what seam and blending go by."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...raster.arrays import beside, bounds, dilated, shown_only, small_strips, strips
from ...raster.log_encoding import log_encode
from ...raster.robust import NORMAL_MEDIAN
from ...system.threads import each
from ..options import OVERLAP


@dataclass(frozen=True)
class Overlap:
    """The part of the canvas in which both layers show something.

    Attributes
    ----------
    box : (slice, slice)
        Rows and columns of the canvas.
    both : (h, w) bool array
        Where both show something.
    difference : (h, w, C) float32 array
        Tones of the added picture minus those of the panorama before, 0 elsewhere.
    same : (h, w) bool array
        Where they also show the same thing, so that the difference is one of light, which may be blended, and not of
        content, which must not be.
    """

    box: tuple[slice, slice]
    both: NDArray[np.bool_]
    difference: NDArray[np.float32]
    same: NDArray[np.bool_]


def overlap_of(before: Layer, layer: Layer, hidden: NDArray[np.bool_]) -> Overlap | None:
    """The overlap of the panorama before and an added layer, None where they do not meet.

    hidden (H, W): what the added picture cannot see.
    """
    both = (before.alpha > 0) & (layer.alpha > 0)
    box = bounds(both)
    if box is None:
        return None
    both = both[box]
    difference = np.empty((*both.shape, before.light.shape[2]), np.float32)

    def put(rows: slice) -> None:
        part = slice(box[0].start + rows.start, box[0].start + rows.stop), box[1]
        tones = log_encode(layer.light[part])
        tones -= log_encode(before.light[part])
        difference[rows] = shown_only(tones, both[rows])

    each(put, small_strips(difference.shape))
    same = both & ~dilated(hidden[box] & both, OVERLAP.hidden_margin_px)
    return Overlap(box, both, difference, same & _alike(difference, same))


def _alike(difference: NDArray[np.float32], shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) the difference is close to its median over what is `shown` (h, w)."""
    count = np.count_nonzero(shown)
    if not count:
        return shown
    every, before, samples = max(1, count // OVERLAP.sample_pixels), 0, []
    for rows in strips(shown.shape):  # numbers of all pixels would be as large as two of three channels
        places = np.flatnonzero(shown[rows])
        samples.append(difference[rows].reshape(-1, difference.shape[2])[places[-before % every :: every]])
        before += places.size
    sample = np.concatenate(samples)
    middle = np.median(sample, axis=0)
    sigma = np.median(np.abs(sample - middle), axis=0) / NORMAL_MEDIAN
    most = np.maximum(OVERLAP.same_sigmas * sigma, OVERLAP.same_tone)
    alike = np.empty(shown.shape, bool)

    def put(rows: slice) -> None:
        near, here = beside(rows, 1, len(difference))
        # blurred, since noise is no content
        blurred = cv2.blur(difference[near], (3, 3)).reshape(difference[near].shape)[here]
        within = [np.abs(blurred[..., k] - middle[k]) <= most[k] for k in range(len(most))]
        alike[rows] = np.logical_and.reduce(within)

    each(put, small_strips(difference.shape))
    return alike
