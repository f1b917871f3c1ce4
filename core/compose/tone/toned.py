"""What is done to a picture's light before it is composed, pixel by pixel and where it is read.

In this order: what the lens took off towards the corners is given back, a curve raises the dark by more or less than
the bright, each channel gets its gain, and highlights roll off: what is not clipped stays below white, and what is
clipped stays as white as it is. Each step rises with the light, so that no order of tones is turned round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Part, Plane, for_each_channel, within
from ...raster.lazy import AnyImage, LazyImage
from ...raster.picture_map import CanvasMap
from ..options import EXPOSURE
from .clipped import ClippedLight, clipped_by
from .tone_options import TONE

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

    def at(self, radius_squared: NDArray[Any]) -> NDArray[Any]:
        """The logarithm (…) of what is left of the light at squared distances (…) from the middle."""
        linear, square = 4 * self.halfway - self.corner, 2 * self.corner - 4 * self.halfway
        lost: NDArray[Any] = radius_squared * linear + radius_squared**2 * square
        return lost


@dataclass(frozen=True)
class ToneCurve:
    """A gain that changes with the tone, the same in all channels: linear in the logarithm of light, constant beyond.

    Attributes
    ----------
    slope : float
        Of the gain's logarithm, above −1: so the curve always rises.
    dark, bright : float
        Logarithms of light between which the gain changes, none above what is clipped. Halfway between them the curve
        changes nothing.
    """

    slope: float
    dark: float
    bright: float

    def at(self, log_light: Plane) -> Plane:
        """The logarithm (…) of the gain at logarithms of light (…)."""
        change = np.clip(log_light, np.float32(self.dark), np.float32(self.bright))
        change -= np.float32((self.dark + self.bright) / 2)
        change *= np.float32(self.slope)
        return change

    @property
    def of_white(self) -> float:
        """The gain from the bright end on."""
        return math.exp(self.slope * (self.bright - self.dark) / 2)


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

    keeps_white: whether highlights roll off below white and white stays white; clipped: what is known of clipped
    channels.
    """

    light: AnyImage
    gain: Channels
    vignetting: Vignetting
    curve: ToneCurve | None
    keeps_white: bool
    picture_map: CanvasMap
    clipped: ClippedLight | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        own = self.light[rows, columns]
        out = np.empty_like(own)
        # few rows at a time, which stay in the processor's cache from one step to the next
        at_once = max(1, TONE.pixels_at_once // max(1, columns.stop - columns.start))
        for top in range(0, len(own), at_once):
            some = slice(top, min(len(own), top + at_once))
            out[some] = self._toned(own[some], (slice(rows.start + some.start, rows.start + some.stop), columns))
        return out

    def _toned(self, own: NDArray[np.float32], part: Part) -> NDArray[np.float32]:
        """Own light (h, w, C) of rows and columns as it is shown."""
        gain: NDArray[np.float32] = np.tile(self.gain, own.shape[1]).reshape(own.shape[1:])
        if self.vignetting:
            gain = for_each_channel(self._given_back(part), self.shape[2]) * gain
        out: NDArray[np.float32] = own * gain
        if self.curve is not None:
            # the gain of a channel does not count: the curve was fitted on light before it
            light = np.maximum(out / self.gain, np.float32(math.exp(self.curve.dark)))
            out *= np.exp(self.curve.at(np.log(light, out=light)))
        if self.keeps_white:
            of_white = np.float32(1.0 if self.curve is None else self.curve.of_white)
            rolled_off(out, gain if of_white == 1 else gain * of_white)
            if self.clipped is not None:
                self.clipped.restore(own, out)
            white = own if self.clipped is None else self.clipped.white_at(own, part)
            white_kept(own, out, white, self.gain * of_white)
        return out

    def _given_back(self, part: Part) -> Plane:
        """What the light (h, w) of rows and columns is multiplied by to undo vignetting."""
        rows, columns = part
        box = columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start
        lost = self.vignetting.at(self.picture_map.within(box).arrays().from_middle(np.s_[:, :]))
        given_back: Plane = np.exp(-lost).astype(np.float32, copy=False)
        return given_back


def times(light: NDArray[np.float32], gain: Channels) -> NDArray[np.float32]:
    """Light (h, w, C) times a gain (C,)."""
    height, width, channels = light.shape
    # along whole rows: along a pixel's channels alone NumPy is slow
    return (light.reshape(height, width * channels) * np.tile(gain, width)).reshape(light.shape)


def rolled_off(light: NDArray[np.float32], gain: NDArray[np.float32]) -> None:
    """Compresses highlights (h, w, C) in place, channel by channel, so that what is just not clipped stays neutral.

    Below the knee nothing changes; from there light follows a hyperbola that leaves the knee with slope 1 and arrives
    just below white at what is just not clipped. gain (C,) or (h, w, C): what white was multiplied by.
    """
    if light.max(initial=0) <= TONE.knee:
        return
    above = light - np.float32(TONE.knee)
    np.maximum(above, 0, out=above)
    room = np.float32(TONE.below_white - TONE.knee)
    reach = np.maximum(np.float32(EXPOSURE.clipped_light) * gain - np.float32(TONE.knee), room)
    # above / (1 + bend · above) is what is left of it: so much less
    less = above * (1 / room - 1 / reach)
    above *= less
    less += 1
    above /= less
    light -= above


def white_kept(
    own: NDArray[np.float32], light: NDArray[np.float32], white: NDArray[np.float32], gain: Channels
) -> None:
    """Where a picture's own light (h, w, C) comes near to clipping, `light` does not fall below `white`, in place.

    That begins the earlier the more white is darkened, so that bright noise is not spread. white (h, w, C): what is
    clipped; gain (C,): of white.
    """
    start = near_white(gain)
    if own.max(initial=0) <= start:
        return
    smallest: Plane = reduce(cv2.min, cv2.split(own))
    if smallest.max() <= start:
        return
    weight = clipped_by(smallest, start)
    lacking = white - light
    np.maximum(lacking, 0, out=lacking)
    lacking *= for_each_channel(weight, own.shape[2])
    light += lacking


def near_white(gain: Channels) -> np.float32:
    """Light from which on white is kept, for a gain (C,) of white."""
    root = np.float32(min(1.0, float(gain.min()))) ** np.float32(1 / TONE.display_gamma)
    clipped = np.float32(EXPOSURE.clipped_light) ** np.float32(1 / TONE.display_gamma)
    # the straight line from the darkened tone to the tone of white is so many times as steep as the tones were
    start = clipped * (TONE.steepest - 1) / (TONE.steepest - root)
    return np.float32(np.clip(start**TONE.display_gamma, TONE.least_near_white, TONE.most_near_white))
