"""Values of a small picture at the pixels of the same picture with a whole number of times as many a side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Box, Part, within
from .lazy import AnyImage, LazyImage


@dataclass(frozen=True)
class Enlargement:
    """A part of an enlarged picture, and the small picture's pixels that lie about it.

    Each value is worked out of the same four, by the same steps, however the picture is cut up.

    Attributes
    ----------
    part : Part
        Rows and columns of the enlarged picture.
    times : int
        How many of its px lie along one of the small picture's; the outer edges of both meet.
    size : (int, int)
        (h, w) px of the small picture.
    """

    part: Part
    times: int
    size: tuple[int, int]

    @property
    def cells(self) -> Part:
        """Rows and columns of the small picture that `of` takes: those on either side of each pixel of the part."""
        rows, columns = (self._cells(axis) for axis in (0, 1))
        return rows, columns

    def of(self, values: NDArray[np.float32], goes_on: bool = False) -> NDArray[np.float32]:
        """Values (h, w, …) in `cells` as those of the part, bilinear.

        goes_on: beyond the middle of the outermost pixels values go on in a straight line; else they stay the same.
        """
        for axis in (0, 1):
            values = self._along(np.moveaxis(values, axis, 0), axis, goes_on)
            values = np.moveaxis(values, 0, axis)
        return values

    def _cells(self, axis: int) -> slice:
        """The same of one axis; at either end of the picture at least two, which a straight line goes through."""
        (first, last), side = self._about(self.part[axis]), self.size[axis]
        start = min(first, side - 2) if last >= side else first
        stop = max(last + 1, 2) if first < 0 else last + 1
        return slice(max(0, start), min(side, stop))

    def _about(self, some: slice) -> tuple[int, int]:
        """The first and the last small pixel about some pixels of one axis; they may lie beyond the picture."""
        first, last = ((2 * pixel + 1 - self.times) // (2 * self.times) for pixel in (some.start, some.stop - 1))
        return first, last + 1

    def _along(self, values: NDArray[np.float32], axis: int, goes_on: bool) -> NDArray[np.float32]:
        """Values along their first axis, which is the small picture's `axis`."""
        some, times, (first, last) = self.part[axis], self.times, self._about(self.part[axis])
        begin = self._cells(axis).start - (first < 0)
        ends = []
        for beyond, end, inner in ((first < 0, 0, 1), (last > self.size[axis] - 1, -1, -2)):
            straight = goes_on and len(values) > 1
            outer = 2 * values[end] - values[inner] if straight else values[end]
            ends.append(outer[None] if beyond else values[:0])
        values = np.concatenate([ends[0], values, ends[1]])
        out = np.empty((some.stop - some.start, *values.shape[1:]), np.float32)
        for at in range(min(times, len(out))):
            offset = 2 * (some.start + at) + 1 - times
            near = offset // (2 * times) - begin
            share = np.float32((offset % (2 * times)) / (2 * times))
            pixels = out[at::times]
            before, after = values[near : near + len(pixels)], values[near + 1 : near + 1 + len(pixels)]
            np.multiply(before, 1 - share, out=pixels)
            pixels += after * share
        return out


@dataclass(frozen=True, eq=False)
class EnlargedImage(LazyImage):
    """Values (h, w, …) with so many times as many px a side, bilinear, worked out where they are read."""

    image: AnyImage
    times: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, …)."""
        height, width, *more = self.image.shape
        return self.times * height, self.times * width, *more

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        height, width = self.image.shape[:2]
        here = Enlargement(within(part, self.shape), self.times, (height, width))
        return here.of(np.asarray(self.image[here.cells]))


def repeated(values: NDArray[Any], times: int) -> NDArray[Any]:
    """Values (h, w), each so many times a side: masks and numbers, between which nothing lies."""
    return np.repeat(np.repeat(values, times, axis=1), times, axis=0)


def enlarged_box(box: Box, times: int) -> Box:
    """A box (left, top, width, height) in px of which so many lie along one."""
    left, top, width, height = (times * side for side in box)
    return left, top, width, height


def reduced_box(box: Box, times: int) -> Box:
    """The smallest box that holds another whose px are so many times smaller."""
    left, top, width, height = box
    x, y = left // times, top // times
    return x, y, -(-(left + width) // times) - x, -(-(top + height) // times) - y
