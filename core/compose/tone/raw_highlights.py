"""Clipped light of camera RAW is taken from a picture that was exposed shorter, where one shows the place.

All RAW pictures of a set have one scale, so that the longer one was exposed, the less light it clips at: there it says
too little, gray beside the white of the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...pictures.options import DECODING
from ...raster.arrays import bounds, dilated, in_any_channel, strips
from ...raster.lazy import Weighed
from .tone_options import HIGHLIGHTS


def without_clipped(layers: Sequence[Layer], hidden: Sequence[NDArray[np.bool_]]) -> list[Layer]:
    """The layers without what is clipped in them and shown by one that clips at more light.

    Parameters
    ----------
    layers : sequence of Layer
        All on the same canvas.
    hidden : sequence of (H, W) bool arrays
        What each picture cannot see, and so shows something else.

    Returns
    -------
    list of Layer
        Those of which nothing is left out as they are.
    """
    out = []
    for layer in layers:
        least = layer.clips_at * 2**DECODING.longer_stops
        others = [k for k, other in enumerate(layers) if np.isfinite(least) and other.clips_at >= least]
        shown = [layers[k].shows & ~hidden[k] for k in others]
        out.append(_without(layer, np.logical_or.reduce(shown)) if shown else layer)
    return out


def _without(layer: Layer, told: NDArray[np.bool_]) -> Layer:
    """The layer without what is clipped where others tell (H, W) more."""
    box = bounds(told & layer.shows)
    if box is None:
        return layer
    rows, columns = box
    limit = np.float32(DECODING.raw_clipped * layer.clips_at)
    clipped = np.zeros((rows.stop - rows.start, columns.stop - columns.start), np.float32)
    for strip in strips(clipped.shape):
        part = slice(rows.start + strip.start, rows.start + strip.stop), columns
        clipped[strip] = in_any_channel(layer.light[part] >= limit)
    if not clipped.any():
        return layer
    # glints stay, and no leaf before a clipped sky is cut out of it
    mostly = cv2.blur(clipped, (HIGHLIGHTS.window_px, HIGHLIGHTS.window_px)) > HIGHLIGHTS.least_share
    kept = np.ones(layer.alpha.shape, bool)
    kept[box] = ~(dilated(mostly, HIGHLIGHTS.margin_px) & told[box])
    alpha = np.where(kept, layer.alpha, layer.alpha.dtype.type(0))
    return replace(layer, light=Weighed(layer.light, kept), alpha=alpha)
