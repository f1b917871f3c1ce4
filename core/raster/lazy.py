"""Lazy images: light computed for the rows and columns that are asked for, so that no canvas is held in float.

An image has a shape (H, W, C) and returns float32 scene-linear light for slices of rows and columns: an array does, and
so do the classes below, which wrap others. They return the same bits however the picture is cut up. Planes (H, W) of
numbers are treated alike.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..system.threads import each, in_order
from .arrays import Part, for_each_channel, meet, shown_only, strips, within
from .colour import Curve, decode


class LazyImage(ABC):
    """A picture (H, W, C) that is worked out part by part."""

    dtype = np.dtype(np.float32)

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""

    @abstractmethod
    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        """The light (h, w, C) of rows and columns."""


AnyImage: TypeAlias = "NDArray[np.float32] | LazyImage"


def whole(light: AnyImage) -> NDArray[np.float32]:
    """All of it as an array."""
    if isinstance(light, np.ndarray):
        return light
    return part_of(light, (slice(0, light.shape[0]), slice(0, light.shape[1])))


def part_of(light: AnyImage, part: Part) -> NDArray[np.float32]:
    """The light of rows and columns as an array of its own, worked out by several threads."""
    rows, columns = within(part, light.shape)
    out = np.empty((rows.stop - rows.start, columns.stop - columns.start, *light.shape[2:]), np.float32)

    def put(strip: slice) -> None:
        out[strip] = light[rows.start + strip.start : rows.start + strip.stop, columns]

    each(put, strips(out.shape))
    return out


def extent(light: AnyImage) -> tuple[float, float]:
    """The least and the most of all its values."""
    if isinstance(light, Coded):
        # curves never fall; one axis after the other, for NumPy is slow along two at once
        ends_of = (how(how(light.levels, axis=0, keepdims=True), axis=1, keepdims=True) for how in (np.min, np.max))
        low, high = (decode(levels, light.curves) for levels in ends_of)
        return float(low.min()), float(high.max())
    if isinstance(light, np.ndarray):
        return float(light.min()), float(light.max())
    ends = list(in_order(lambda rows: extent(light[rows, 0 : light.shape[1]]), strips(light.shape)))
    return min(low for low, _ in ends), max(high for _, high in ends)


@dataclass(frozen=True, eq=False)
class Coded(LazyImage):
    """Display-encoded levels (H, W, C) uint8 or uint16, and the curves that make light of them (see `decode`)."""

    levels: NDArray[Any]
    curves: tuple[Curve, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.levels.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        return decode(self.levels[part], self.curves)


@dataclass(frozen=True, eq=False)
class Weighed(LazyImage):
    """Light times a weight (H, W) of each pixel."""

    light: AnyImage
    weight: NDArray[np.float32] | NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        light, weight = self.light[part], self.weight[part]
        if weight.dtype != bool:
            return light * for_each_channel(weight, light.shape[2])
        return light if weight.all() else shown_only(light, weight.astype(bool, copy=False))


@dataclass(frozen=True, eq=False)
class Rooted(LazyImage):
    """The square root of light, with its sign: nearly even steps to the eye, and no scale of its own."""

    light: AnyImage

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        light = self.light[part]
        root = np.sqrt(np.abs(light))
        return np.copysign(root, light, out=root)


@dataclass(frozen=True, eq=False)
class Placed(LazyImage):
    """Light whose first pixel lies at `at` (row, column) of a larger or smaller frame of `size` (H, W); black, or
    `beyond`, where it does not reach."""

    light: AnyImage
    at: tuple[int, int]
    size: tuple[int, int]
    beyond: float = 0.0

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return *self.size, *self.light.shape[2:]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        height, width = (one.stop - one.start for one in within(part, self.shape))
        meeting = meet(part, self.shape, self.at, self.light.shape)
        light = None if meeting is None else self.light[meeting[1]]
        if light is not None and light.shape[:2] == (height, width):
            return light
        out = np.zeros((height, width, *self.shape[2:]), np.float32)  # untouched memory is free
        if self.beyond:
            out[:] = self.beyond
        if meeting is not None and light is not None:
            out[meeting[0]] = light
        return out


@dataclass(frozen=True, eq=False)
class SideBySide(LazyImage):
    """The columns of one light before `column`, and from there on those of another of the same size."""

    left: AnyImage
    right: AnyImage
    column: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.left.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        if columns.stop <= self.column:
            return self.left[rows, columns]
        if columns.start >= self.column:
            return self.right[rows, columns]
        before, after = slice(columns.start, self.column), slice(self.column, columns.stop)
        return np.concatenate([self.left[rows, before], self.right[rows, after]], axis=1)


@dataclass(frozen=True, eq=False)
class Retouched(LazyImage):
    """Light of which some pixels are made anew: those touched (h, w), from `at` (row, column) on."""

    light: AnyImage
    at: tuple[int, int]
    touched: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    @abstractmethod
    def anew(self, before: NDArray[np.float32], there: Part) -> NDArray[np.float32]:
        """The touched pixels (n, C) of rows and columns of `touched`, row by row; before (n, C): what they were."""

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        out = self.light[part]
        meeting = meet(part, self.shape, self.at, self.touched.shape)
        if meeting is None:
            return out
        here, there = meeting
        touched = self.touched[there]
        if not touched.any():
            return out
        out = out.copy()
        out[here][touched] = self.anew(out[here][touched], there)
        return out


@dataclass(frozen=True, eq=False)
class Held(LazyImage):
    """Light of which a part, from `at` (row, column) on, is kept as an array, for it is asked for more than once."""

    light: AnyImage
    at: tuple[int, int]
    kept: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        (top, left), (height, width) = self.at, self.kept.shape[:2]
        if top <= rows.start and left <= columns.start and rows.stop <= top + height and columns.stop <= left + width:
            return self.kept[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        return self.light[part]
