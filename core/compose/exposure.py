"""Exposure and white balance: one gain per channel, in scene-linear light, matches a picture to the panorama so far.

The gain is a median of ratios between means over small blocks: the means forgive an alignment that is a pixel off, the
median forgives what moved. The panorama so far keeps its values.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import Part, bounds
from ..raster.lazy import AnyImage, LazyImage
from ..raster.options import PARTS
from ..system.threads import in_order
from .options import EXPOSURE, OVERLAP


@dataclass(frozen=True)
class Exposure:
    """A measured gain.

    Attributes
    ----------
    gain : (C,) float32 array
        What a picture's light is multiplied by.
    spread : (C,) float32 array
        Median absolute deviation of the blocks' log ratios; NaN where the gain is unknown.
    blocks : int
        How many blocks were measured; 0 where the gain is unknown and taken for 1.
    """

    gain: NDArray[np.float32]
    spread: NDArray[np.float32]
    blocks: int

    def applied(self, layer: Layer) -> Layer:
        """A picture's layer as the reference's camera would have exposed it."""
        if (self.gain == 1).all():
            return layer
        return Layer(Exposed(layer.light, self.gain), layer.alpha)


@dataclass(frozen=True, eq=False)
class Exposed(LazyImage):
    """Light times a gain (C,)."""

    light: AnyImage
    gain: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        light = self.light[part]
        height, width, channels = light.shape
        # along whole rows: along a pixel's channels alone NumPy is slow
        return (light.reshape(height, width * channels) * np.tile(self.gain, width)).reshape(light.shape)


def unchanged(channels: int) -> Exposure:
    """The exposure that changes nothing."""
    return Exposure(np.ones(channels, np.float32), np.full(channels, np.nan, np.float32), 0)


def match_exposure(
    before: Layer, layer: Layer, hidden: NDArray[np.bool_], floats: tuple[bool, bool]
) -> Exposure:
    """Measure the gain per channel on what the panorama before and an added layer both show.

    Parameters
    ----------
    before, layer : Layer
        On the same canvas.
    hidden : (H, W) bool array
        What the added picture cannot see, and so shows something else.
    floats : (bool, bool)
        Whether the two come from float pictures, which do not clip.

    Returns
    -------
    Exposure
        `unchanged` where too little is known, or where the light differs beyond what exposure explains.
    """
    channels = before.light.shape[2]
    shown = (before.alpha > OVERLAP.opaque_alpha) & (layer.alpha > OVERLAP.opaque_alpha) & ~hidden
    box = bounds(shown)
    if box is None:
        return unchanged(channels)
    block = EXPOSURE.block_px
    # whole blocks of the canvas
    rows, columns = (slice(part.start - part.start % block, part.stop + -part.stop % block) for part in box)
    at_once = block * max(1, PARTS.strip_pixels // (block * (columns.stop - columns.start)))

    def means_of(top: int) -> list[NDArray[np.float64]]:
        part = slice(top, min(rows.stop, top + at_once)), columns
        pixels, counts = [one.light[part] for one in (before, layer)], shown[part]
        for light, unclipped in zip(pixels, floats, strict=True):
            if not unclipped:
                for k in range(channels):
                    counts = counts & (light[..., k] < EXPOSURE.clipped_light)
        return [_block_means(light, counts) for light in pixels]

    parts = list(in_order(means_of, range(rows.start, rows.stop, at_once)))
    means_before, means = (np.concatenate(one) for one in zip(*parts, strict=True))
    bright = _bright(means_before) & _bright(means)
    if bright.sum() < EXPOSURE.min_blocks:
        return unchanged(channels)
    ratios = np.log(means_before[bright]) - np.log(means[bright])
    # errors count as the eye sees them: tones grow about as the root of light
    weights = np.sqrt(means_before[bright].mean(axis=1))
    middle = np.array([_weighted_median(ratios[:, k], weights) for k in range(channels)])
    spread = np.median(np.abs(ratios - middle), axis=0)
    if np.abs(middle).max() > np.log(EXPOSURE.max_gain):
        return unchanged(channels)
    return Exposure(np.exp(middle).astype(np.float32), spread.astype(np.float32), int(bright.sum()))


def pooled(exposures: list[Exposure]) -> Exposure:
    """The median of the exposures of several frames of fixed cameras."""
    known = [exposure for exposure in exposures if exposure.blocks]
    if not known:
        return exposures[0]
    gain, spread = (np.median([getattr(e, name) for e in known], axis=0) for name in ("gain", "spread"))
    return Exposure(gain.astype(np.float32), spread.astype(np.float32), sum(e.blocks for e in known))


def _block_means(pixels: NDArray[np.float32], shown: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means (N, C) over the blocks, of what is shown, where enough of a block is."""
    block = EXPOSURE.block_px
    height, width = (block * (side // block) for side in shown.shape)
    if not height or not width:
        return np.zeros((0, pixels.shape[2]))
    size = (width // block, height // block)
    weight = shown[:height, :width].astype(np.float32)
    share = cv2.resize(weight, size, interpolation=cv2.INTER_AREA)
    enough = share >= EXPOSURE.min_block_share
    means = [
        cv2.resize(pixels[:height, :width, k] * weight, size, interpolation=cv2.INTER_AREA)[enough] / share[enough]
        for k in range(pixels.shape[2])
    ]
    stacked: NDArray[np.float64] = np.stack(means, axis=-1).astype(np.float64)
    return stacked


def _bright(means: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which blocks (N,) have no channel that is dark compared with the median block."""
    typical = float(np.median(means.mean(axis=1))) if len(means) else 0.0
    bright: NDArray[np.bool_] = means.min(axis=1, initial=np.inf) > max(EXPOSURE.min_brightness * typical, 0.0)
    return bright


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])
