"""What a picture's clipped light was, learnt from what the other picture shows in its place.

A sky that clips in blue alone turns green once its exposure is matched: blue stays at the most that the sensor told.
Where both pictures show it, the other tells by how much more there was. That is kept in a table over the colour in the
two channels that are not clipped, and so it is known for sky that the other picture does not show, too.

What is clipped in all channels has no colour to go by. It becomes what the other picture shows around there, if that
has most of it unclipped; else it is white.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array, Part, Plane, bounds
from ...raster.lazy import AnyImage
from ...raster.pull_push import filled
from ..options import EXPOSURE
from .tone_options import CLIPPED, TONE


@dataclass(frozen=True)
class ClippedLight:
    """What is known of a picture's clipped light.

    Attributes
    ----------
    factors : tuple of (n, n) float32 array or None
        For each channel, by how much more light than was told there is where it is clipped, by the square roots of the
        next channel's and the one after that's own light; None where too little is known. Below 1 counts as 1.
    white : (h, w, C) float32 array or None
        What is clipped in all channels, at the middles of cells of the canvas; None where it is white.
    times : int
        By how many times as many px a side it is asked for as it was learnt on.
    corner : (int, int)
        Row and column of the canvas, in those px, at which what is asked for begins.
    """

    factors: tuple[NDArray[np.float32] | None, ...]
    white: NDArray[np.float32] | None = None
    times: int = 1
    corner: tuple[int, int] = (0, 0)

    def restore(self, own: NDArray[np.float32], light: NDArray[np.float32]) -> None:
        """Raise the channels of light (h, w, C) that are clipped in a picture's own light (h, w, C), in place."""
        if own.max(initial=0) <= CLIPPED.begins:
            return
        owns, lights = own.reshape(-1, own.shape[2]), light.reshape(-1, own.shape[2])
        for k, factors in enumerate(self.factors):
            if factors is None:
                continue
            clipped = np.flatnonzero(owns[:, k] > CLIPPED.begins)
            if not clipped.size:
                continue
            colours, told = owns[clipped], lights[clipped, k]
            weight = clipped_by(colours[:, k])
            weight *= 1 - clipped_by(colours.min(axis=1))  # all channels: no colour is left
            raised = told * factors.reshape(-1)[_cells(colours, k, len(factors))]
            np.minimum(raised, np.float32(TONE.below_white), out=raised)  # another channel may be unclipped
            lights[clipped, k] = told + weight * np.maximum(raised - told, 0)

    def white_at(self, own: NDArray[np.float32], part: Part) -> NDArray[np.float32]:
        """What own light (h, w, C) of rows and columns of the canvas is where it is clipped."""
        if self.white is None:
            return own
        rows, columns = (
            _between(np.arange(first + one.start, first + one.stop), side, self.times * CLIPPED.cell_px)
            for first, one, side in zip(self.corner, part, self.white.shape[:2], strict=True)
        )
        upper, lower, down = rows
        left, right, across = columns
        lines = self.white[upper] * (1 - down[:, None, None]) + self.white[lower] * down[:, None, None]
        white = lines[:, left] * (1 - across[:, None]) + lines[:, right] * across[:, None]
        # what is not clipped stays below white
        told: NDArray[np.float32] = np.minimum(white, np.maximum(own, np.float32(TONE.below_white)))
        return told


@dataclass(frozen=True, eq=False)
class ToldLight:
    """What another picture tells of one's clipped light.

    Attributes
    ----------
    own : (H, W, C) image
        The picture's own light.
    light : (H, W, C) image
        The same with its exposure matched to the other's.
    other : (H, W, C) image
        What the other picture shows there, with its exposure matched.
    shown : (H, W) bool array
        Where both show the same.
    """

    own: AnyImage
    light: AnyImage
    other: AnyImage
    shown: NDArray[np.bool_]


def clipped_light(told: Iterable[ToldLight]) -> ClippedLight | None:
    """Learn what clipped light was.

    Parameters
    ----------
    told : iterable of ToldLight
        All on one canvas: of a picture one, of a sphere one for each of its views.

    Returns
    -------
    ClippedLight or None
        None where nothing is known.
    """
    learned: tuple[_Table, _White] | None = None
    for one in told:
        if one.shown.any():
            channels = one.own.shape[2]
            learned = learned or (_Table(channels), _White(one.shown.shape, channels))
            _learn(one, *learned)
    if learned is None:
        return None
    found = ClippedLight(learned[0].factors(), learned[1].field())
    return found if found.white is not None or any(one is not None for one in found.factors) else None


def _learn(told: ToldLight, table: _Table, white: _White) -> None:
    """Gather what another picture tells."""
    box, channels = bounds(told.shown), told.own.shape[2]
    assert box is not None
    rows, columns = box
    for top in range(rows.start, rows.stop, CLIPPED.cell_px):
        part = slice(top, min(rows.stop, top + CLIPPED.band_rows)), columns
        before, after, other, both = told.own[part], told.light[part], told.other[part], told.shown[part]
        clipped = before >= EXPOSURE.clipped_light
        if channels == 3:
            colour = both & (before.min(axis=2) < CLIPPED.begins)
            for k in range(channels):
                table.learn(k, before, after, other, colour & clipped[..., k])
        white.learn(part, other, both & clipped.all(axis=2))


class _Table:
    """Gathers `ClippedLight.factors`."""

    def __init__(self, channels: int) -> None:
        self._sums, self._counts = np.zeros((2, channels, CLIPPED.cells**2))

    def learn(
        self, k: int, own: NDArray[np.float32], light: NDArray[np.float32], told: NDArray[np.float32],
        clipped: NDArray[np.bool_],
    ) -> None:  # fmt: skip
        """Take in pixels (h, w, C) whose channel k is clipped (h, w)."""
        cells = _cells(own[clipped], k, CLIPPED.cells)
        ratio = np.log(np.maximum(told[..., k][clipped], CLIPPED.least_light) / light[..., k][clipped])
        self._sums[k] += np.bincount(cells, ratio, CLIPPED.cells**2)
        self._counts[k] += np.bincount(cells, minlength=CLIPPED.cells**2)

    def factors(self) -> tuple[NDArray[np.float32] | None, ...]:
        """A table for each channel that enough is known of."""
        return tuple(_factors(*one) for one in zip(self._sums, self._counts, strict=True))


class _White:
    """Gathers `ClippedLight.white`; shape: (H, W) of the canvas."""

    def __init__(self, shape: tuple[int, ...], channels: int) -> None:
        self._shape = -(-shape[0] // CLIPPED.cell_px), -(-shape[1] // CLIPPED.cell_px)
        self._sums, self._counts = np.zeros((channels, *self._shape)), np.zeros(self._shape)
        self._unclipped = 0

    def learn(self, part: Part, told: NDArray[np.float32], clipped: NDArray[np.bool_]) -> None:
        """Take in pixels (h, w, C) that are clipped (h, w) in all channels."""
        row = (part[0].start + part[0].stop) // 2 // CLIPPED.cell_px
        cells = (part[1].start + np.nonzero(clipped)[1]) // CLIPPED.cell_px
        pixels = told[clipped]
        self._unclipped += int((pixels.max(axis=1, initial=0) <= TONE.below_white).sum())
        self._counts[row] += np.bincount(cells, minlength=self._shape[1])
        for k, sums in enumerate(self._sums):
            sums[row] += np.bincount(cells, pixels[:, k], self._shape[1])

    def field(self) -> NDArray[np.float32] | None:
        """What clipped light is everywhere; None if it is white as far as is known."""
        total = self._counts.sum()
        if total < CLIPPED.min_pixels or self._unclipped <= CLIPPED.min_unclipped_share * total:
            return None
        means = np.moveaxis(self._sums / np.maximum(self._counts, 1), 0, -1)
        return filled(means.astype(np.float32), _known(self._counts))


def clipped_by(light: Plane, begins: float | np.float32 = CLIPPED.begins) -> Plane:
    """How much light (…) counts as clipped, 0 to 1; begins: the light from which on it does."""
    share = (light - np.float32(begins)) * np.float32(1 / (EXPOSURE.clipped_light - begins))
    np.clip(share, 0, 1, out=share)
    share *= share * (3 - 2 * share)
    return share


def _cells(colours: NDArray[np.float32], channel: int, size: int) -> NDArray[np.intp]:
    """Cells (N,) of a channel's table of `size` a side, row by row, for colours (N, 3)."""
    row, column = (
        np.minimum(np.sqrt(np.maximum(colours[:, (channel + k) % 3], 0)) * size, size - 1).astype(np.intp)
        for k in (1, 2)
    )
    cells: NDArray[np.intp] = row * size + column
    return cells


def _factors(sums: Array, counts: Array) -> NDArray[np.float32] | None:
    """A fine table of factors (m, m) by the sums of logarithms (n²,) and counts in a coarse one; None with too few."""
    if counts.sum() < CLIPPED.min_pixels:
        return None
    sums, counts = (one.reshape(CLIPPED.cells, CLIPPED.cells) for one in (sums, counts))
    means = sums / np.maximum(counts, 1)
    logs = filled(means.astype(np.float32)[..., None], _known(counts))[..., 0]
    fine = cv2.resize(logs, None, fx=CLIPPED.fineness, fy=CLIPPED.fineness, interpolation=cv2.INTER_LINEAR)
    factors: NDArray[np.float32] = np.exp(fine)
    return factors


def _known(counts: Array) -> Plane:
    """How well (…) cells are known, 0 to 1, by the pixels in them."""
    known: Plane = (counts / (counts + CLIPPED.sure_pixels)).astype(np.float32)
    return known


def _between(
    pixels: NDArray[np.intp], cells: int, cell_px: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], Plane]:
    """The cells (N,) on either side of pixels of one axis, and how near (N,) the pixels are to the second."""
    place = np.clip((pixels + 0.5) / cell_px - 0.5, 0, cells - 1)
    first = np.minimum(place.astype(np.intp), max(cells - 2, 0))
    return first, np.minimum(first + 1, cells - 1), (place - first).astype(np.float32)
