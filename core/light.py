"""Light that is worked out where it is asked for, so that no canvas is ever held in float.

Whatever has a shape (H, W, C) and gives float32 scene-linear light for slices of rows and columns will do: an array,
or one of the kinds below, which are made of others. They give the same bits however the picture is cut up. Planes
(H, W) of numbers are treated alike.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from .colour import Curve, decode
from .threads import each, in_order

# Pixels that are worked out at a time.
STRIP = 1_000_000

# Rows and columns, with bounds that lie in the picture.
Part: TypeAlias = tuple[slice, slice]


class Light(ABC):
    """A picture (H, W, C) that is worked out part by part."""

    dtype = np.dtype(np.float32)

    @property
    @abstractmethod
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""

    @abstractmethod
    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        """The light (h, w, C) of rows and columns."""


AnyLight: TypeAlias = "NDArray[np.float32] | Light"


def strips(shape: tuple[int, ...]) -> Iterator[slice]:
    """The rows of a picture (H, W, …), some at a time."""
    rows = max(1, STRIP // max(1, shape[1]))
    for top in range(0, shape[0], rows):
        yield slice(top, min(shape[0], top + rows))


def beside(rows: slice, margin: int, height: int) -> tuple[slice, slice]:
    """Some rows of `height` with so many more on either side, as far as there are; and which of those they are."""
    near = slice(max(0, rows.start - margin), min(height, rows.stop + margin))
    return near, slice(rows.start - near.start, rows.stop - near.start)


def bounds(mask: NDArray[np.bool_]) -> Part | None:
    """Rows and columns of the smallest box that holds all of a mask (H, W); None where it is empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return None
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def within(part: Part, shape: tuple[int, ...]) -> Part:
    """The same rows and columns of a picture (H, W, …), none beyond its edges."""
    rows, columns = (slice(*one.indices(side)[:2]) for one, side in zip(part, shape, strict=False))
    return rows, columns


def around(part: Part, margin: int, shape: tuple[int, ...]) -> Part:
    """The same rows and columns and a margin around them, none beyond the edges of a picture (H, W, …)."""
    rows, columns = (slice(max(0, one.start - margin), one.stop + margin) for one in part)
    return within((rows, columns), shape)


def meet(
    part: Part, shape: tuple[int, ...], at: tuple[int, int], inner: tuple[int, ...]
) -> tuple[Part, Part] | None:
    """Where a part of a picture (H, W, …) meets another (h, w, …) whose first pixel lies `at` (row, column) of it: rows
    and columns of what the part gives, and of the other; None where they do not meet."""
    part = within(part, shape)
    ends = [(max(p.start, a), min(p.stop, a + side)) for p, a, side in zip(part, at, inner, strict=False)]
    if any(low >= high for low, high in ends):
        return None
    (rows, columns), (rows_there, columns_there) = (
        [slice(low - start, high - start) for (low, high), start in zip(ends, starts, strict=True)]
        for starts in ((part[0].start, part[1].start), at)
    )
    return (rows, columns), (rows_there, columns_there)


def whole(light: AnyLight) -> NDArray[np.float32]:
    """All of it as an array."""
    if isinstance(light, np.ndarray):
        return light
    return part_of(light, (slice(0, light.shape[0]), slice(0, light.shape[1])))


def part_of(light: AnyLight, part: Part) -> NDArray[np.float32]:
    """The light of rows and columns as an array of its own, worked out by several threads."""
    rows, columns = within(part, light.shape)
    out = np.empty((rows.stop - rows.start, columns.stop - columns.start, *light.shape[2:]), np.float32)

    def put(strip: slice) -> None:
        out[strip] = light[rows.start + strip.start : rows.start + strip.stop, columns]

    each(put, strips(out.shape))
    return out


def shown_only(pixels: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Pixels (H, W, C) where a mask (H, W) says so, 0 elsewhere; NumPy's products of the two take twice as long."""
    return cv2.copyTo(pixels, np.ascontiguousarray(mask).view(np.uint8)).reshape(pixels.shape)


def for_each_channel(values: NDArray, channels: int) -> NDArray[np.float32]:
    """Values (H, W) once for each channel (H, W, C): what NumPy spreads by itself takes four times as long."""
    return cv2.merge([values] * channels).reshape(*values.shape, channels)


def in_any_channel(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (H, W) something holds in any channel (H, W, C); NumPy's own `any` takes several times as long over so few.
    """
    return np.logical_or.reduce([holds[..., k] for k in range(holds.shape[2])])


def extent(light: AnyLight) -> tuple[float, float]:
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
class Coded(Light):
    """Display-encoded levels (H, W, C) uint8 or uint16, and the curves that make light of them (see `decode`)."""

    levels: NDArray
    curves: tuple[Curve, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.levels.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        return decode(self.levels[part], self.curves)


@dataclass(frozen=True, eq=False)
class Weighed(Light):
    """Light times a weight (H, W) of each pixel."""

    light: AnyLight
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
class Placed(Light):
    """Light whose first pixel lies at `at` (row, column) of a larger or smaller frame of `size` (H, W); black, or
    `beyond`, where it does not reach."""

    light: AnyLight
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
class Retouched(Light):
    """Light of which some pixels are made anew: those touched (h, w), from `at` (row, column) on."""

    light: AnyLight
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
class Held(Light):
    """Light of which a part, from `at` (row, column) on, is kept as an array, for it is asked for more than once."""

    light: AnyLight
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
