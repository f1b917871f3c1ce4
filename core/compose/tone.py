"""What is done to a picture's light before it is composed, pixel by pixel and where it is read.

In this order: what the lens took off towards the corners is given back, a curve raises the dark by more or less than
the bright, each channel gets its gain, and highlights roll off: what is not clipped stays below white, and what is
clipped stays as white as it is. Each step rises with the light, so that no order of tones is turned round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Part, Plane, for_each_channel, within
from ..raster.lazy import AnyImage, LazyImage
from ..raster.picture_map import CanvasMap
from .options import EXPOSURE, TONE
from .tone_blocks import radius_squared

Channels = NDArray[np.float32]


@dataclass(frozen=True)
class Vignetting:
    """The light that a lens takes off: its logarithm is a polynomial of r² without a constant; r is 1 at the corners.

    Attributes
    ----------
    halfway, corner : float
        Its values where r² is 1/2 and 1, 0 or below.
    """

    halfway: float = 0.0
    corner: float = 0.0

    def __bool__(self) -> bool:
        return (self.halfway, self.corner) != (0, 0)

    def at(self, radius_squared: NDArray[np.floating]) -> NDArray[np.floating]:
        """The logarithm (…) of what is left of the light at squared distances (…) from the middle."""
        linear, square = 4 * self.halfway - self.corner, 2 * self.corner - 4 * self.halfway
        lost: NDArray[np.floating] = radius_squared * linear + radius_squared**2 * square
        return lost


@dataclass(frozen=True)
class ToneCurve:
    """A gain that changes with the tone, for each channel: linear in the logarithm of light, constant beyond its ends.

    Attributes
    ----------
    slope : (C,) float32 array
        Of the gain's logarithm, above −1: so the curve always rises.
    dark, bright : (C,) float32 arrays
        Logarithms of light between which the gain changes. Halfway between them the curve changes nothing.
    """

    slope: Channels
    dark: Channels
    bright: Channels

    def at(self, log_light: Plane) -> Plane:
        """The logarithm (…, C) of the gain at logarithms of light (…, C)."""
        within_ends = np.clip(log_light, self.dark, self.bright)
        within_ends -= (self.dark + self.bright) / 2
        within_ends *= self.slope
        return within_ends

    @property
    def darkest(self) -> Channels:
        """Light (C,) below which the gain stays the same."""
        return np.exp(self.dark)


NO_VIGNETTING = Vignetting()


@dataclass(frozen=True, eq=False)
class Exposed(LazyImage):
    """Light times a gain (C,)."""

    light: AnyImage
    gain: Channels

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        return times(self.light[part], self.gain)


@dataclass(frozen=True, eq=False)
class Toned(LazyImage):
    """Light with vignetting, curve and gain (C,) applied; picture_map: where the canvas shows the picture.

    keeps_white: whether highlights roll off below white and white stays white.
    """

    light: AnyImage
    gain: Channels
    vignetting: Vignetting
    curve: ToneCurve | None
    keeps_white: bool
    picture_map: CanvasMap

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        own = self.light[part]
        out, given_back = times(own, self.gain), None
        if self.vignetting:
            given_back = self._given_back(part)
            out *= for_each_channel(given_back, out.shape[2])
        if self.curve is not None:
            light = own if given_back is None else own * for_each_channel(given_back, out.shape[2])
            out *= np.exp(self.curve.at(np.log(np.maximum(light, self.curve.darkest))))
        if self.keeps_white:
            brightest = self._brightest_gain()
            rolled_off(out, brightest if given_back is None else brightest * given_back)
            white_kept(own, out, self._gain_of_white())
        return out

    def _given_back(self, part: Part) -> Plane:
        """What the light (h, w) of rows and columns is multiplied by to undo vignetting."""
        rows, columns = within(part, self.shape)
        box = columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start
        places = self.picture_map.within(box).arrays()
        lost = self.vignetting.at(radius_squared(places.x, places.y, places.size))
        given_back: Plane = np.exp(-lost).astype(np.float32, copy=False)
        return given_back

    def _gain_of_white(self) -> Channels:
        """What white (C,) is multiplied by in the middle of the picture."""
        if self.curve is None:
            return self.gain
        gain: Channels = self.gain * np.exp(self.curve.at(np.zeros_like(self.gain)))
        return gain

    def _brightest_gain(self) -> np.float32:
        return np.float32(self._gain_of_white().max())


def times(light: NDArray[np.float32], gain: Channels) -> NDArray[np.float32]:
    """Light (h, w, C) times a gain (C,)."""
    height, width, channels = light.shape
    # along whole rows: along a pixel's channels alone NumPy is slow
    return (light.reshape(height, width * channels) * np.tile(gain, width)).reshape(light.shape)


def rolled_off(light: NDArray[np.float32], brightest: np.float32 | Plane) -> None:
    """Compresses highlights (h, w, C) in place, all channels of a pixel by one factor.

    Below the knee nothing changes; from there the largest channel follows a hyperbola that leaves the knee with slope 1
    and arrives just below white at what is just not clipped. brightest: what white was multiplied by, one number or
    (h, w).
    """
    knee = np.float32(TONE.knee)
    largest = reduce(np.maximum, (light[..., k] for k in range(light.shape[2])))
    above = largest - knee
    if above.max(initial=0) <= 0:
        return
    np.maximum(above, 0, out=above)
    reach = np.maximum(np.float32(EXPOSURE.clipped_light) * brightest - knee, np.float32(TONE.below_white - TONE.knee))
    bend = np.float32(1 / (TONE.below_white - TONE.knee)) - 1 / reach
    # above / (1 + bend · above) is what is left of it
    factor = above * bend
    factor *= above
    factor /= 1 + above * bend
    factor /= np.maximum(largest, knee)
    np.subtract(1, factor, out=factor)
    light *= for_each_channel(factor, light.shape[2])


def white_kept(own: NDArray[np.float32], light: NDArray[np.float32], gain: Channels) -> None:
    """Where a picture's own light (h, w, C) comes near to clipping, `light` does not fall below it, in place.

    That begins the earlier the more white is darkened, so that bright noise is not spread; gain (C,): of white.
    """
    start = near_white(gain)
    smallest = reduce(np.minimum, (own[..., k] for k in range(own.shape[2])))
    near = smallest > start
    if not near.any():
        return
    weight = np.clip((smallest[near] - start) / np.float32(EXPOSURE.clipped_light - start), 0, 1)
    weight *= weight * (3 - 2 * weight)
    lacking = np.maximum(own[near] - light[near], 0)
    light[near] += lacking * weight[:, None]


def near_white(gain: Channels) -> np.float32:
    """Light from which on white is kept, for a gain (C,) of white."""
    root = np.float32(min(1.0, float(gain.min()))) ** np.float32(1 / TONE.display_gamma)
    clipped = np.float32(EXPOSURE.clipped_light) ** np.float32(1 / TONE.display_gamma)
    # the straight line from the darkened tone to the tone of white is so many times as steep as the tones were
    start = clipped * (TONE.steepest - 1) / (TONE.steepest - root)
    return np.float32(np.clip(start**TONE.display_gamma, TONE.least_near_white, TONE.most_near_white))
