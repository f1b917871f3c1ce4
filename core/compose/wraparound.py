"""Composing across ±180°, where the canvas of a whole sphere ends.

Its columns are rolled so that the canvas ends where the pictures do not meet, and rolled back when they are blended.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..panorama.canvas import Canvas
from ..panorama.layers import Layer
from ..raster.arrays import Part, within
from ..raster.lazy import AnyImage, LazyImage
from ..raster.picture_map import PictureMap


def roll_for(canvas: Canvas, before: Layer, layer: Layer) -> int:
    """By how many columns to the left a canvas is rolled before it is composed.

    Then it ends in the middle of the widest gap: where neither the panorama before nor the added picture shows
    anything, else (around a pole) where the two overlap least.

    Parameters
    ----------
    canvas : Canvas
    before, layer : Layer
        The panorama before, and the added picture's layer.

    Returns
    -------
    int
        0 if the canvas is no whole sphere, or ends already where nothing is shown.
    """
    if canvas.projection is None or canvas.projection.sphere is None or canvas.width < canvas.whole[2]:
        return 0
    shown = [one.alpha > 0 for one in (before, layer)]
    crowd = np.logical_and(*shown).sum(axis=0) * (canvas.height + 1) + np.logical_or(*shown).sum(axis=0)
    if crowd[0] == crowd[-1] == 0:
        return 0
    return middle_of_widest(crowd == crowd.min())


def middle_of_widest(columns: NDArray[np.bool_]) -> int:
    """The middle of the longest run of those columns (W,) that are True, at least one, also across the end."""
    found = np.flatnonzero(columns)
    gaps = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1)
    if len(gaps) > 1 and gaps[0][0] == 0 and gaps[-1][-1] == len(columns) - 1:
        gaps[0] = np.concatenate([gaps.pop(), gaps[0] + len(columns)])
    widest = max(gaps, key=len)
    return int(widest[len(widest) // 2]) % len(columns)


def rolled(values: NDArray[Any], columns: int) -> NDArray[Any]:
    """An array (H, W, …) rolled to the left by so many columns; the same object for 0."""
    return np.roll(values, -columns, axis=1) if columns else values


def rolled_layer(layer: Layer, columns: int) -> Layer:
    """A layer, rolled likewise."""
    if not columns:
        return layer
    return Layer(WrappedImage(layer.light, columns % layer.alpha.shape[1]), rolled(layer.alpha, columns))


def rolled_map(picture_map: PictureMap, columns: int) -> PictureMap:
    """A map, rolled likewise."""
    return PictureMap(rolled(picture_map.x, columns), rolled(picture_map.y, columns), picture_map.size)


@dataclass(frozen=True, eq=False)
class WrappedImage(LazyImage):
    """Light rolled to the left by 0 to W − 1 columns, read where it is asked for."""

    light: AnyImage
    columns: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, across = within(part, self.shape)
        width = self.shape[1]
        begin, end = across.start + self.columns, across.stop + self.columns
        pieces = [(begin, min(end, width)), (max(begin, width) - width, end - width)]
        found = [self.light[rows, slice(low, high)] for low, high in pieces if low < high]
        return found[0] if len(found) == 1 else np.concatenate(found or [self.light[rows, slice(0, 0)]], axis=1)
