"""Where the pixels of a canvas are seen in one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Box, Part, cut, cut_in_place


class CanvasMap(Protocol):
    """The map of a canvas to one picture, as arrays or worked out where it is asked for."""

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the picture."""
        ...

    def arrays(self) -> PictureMap:
        """The map as arrays."""
        ...

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the map falls inside the picture."""
        ...

    def within(self, box: Box, in_place: bool = False) -> CanvasMap:
        """The part in a box (left, top, width, height) of the canvas, see `PictureMap.within`."""
        ...


@dataclass(frozen=True)
class PictureMap:
    """x, y (H, W) float32: raw pixel of a picture that each canvas pixel shows, also where it falls outside; NaN behind
    its camera. size (W, H): px of the picture."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    size: tuple[int, int]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W) of the canvas."""
        return self.x.shape

    def arrays(self) -> PictureMap:
        """The map as arrays: this one."""
        return self

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the map falls inside the picture."""
        return falls_inside(self.x, self.y, self.size)

    def from_middle(self, part: Part) -> NDArray[np.float32]:
        """How far (h, w) rows and columns of the canvas are from the middle of the picture, squared: 1 at its corners,
        and at most 1 beyond them, where the map is NaN too."""
        middle_x, middle_y = ((side - 1) / 2 for side in self.size)
        squared = (self.x[part] - np.float32(middle_x)) ** 2
        squared += (self.y[part] - np.float32(middle_y)) ** 2
        squared *= np.float32(1 / max(middle_x**2 + middle_y**2, 1.0))
        return np.fmin(squared, np.float32(1), out=squared)

    def between(self, at: Array) -> Array:
        """The pixels (N, 2) that the map has at places (N, 2) px of the canvas, bilinear; NaN outside it."""
        if not self.x.size:  # a picture that lies beyond the canvas
            return np.full(at.shape, np.nan)
        limit = np.array(self.shape[::-1]) - 1
        outside = ~((at >= 0) & (at <= limit)).all(axis=1)
        at = np.where(outside[:, None], 0.0, at)
        corner = np.clip(np.floor(at).astype(int), 0, np.maximum(limit - 1, 0))
        (u, v), (column, row) = (at - corner).T, corner.T
        next_column, next_row = np.minimum(column + 1, limit[0]), np.minimum(row + 1, limit[1])
        out = []
        for values in (self.x, self.y):
            upper = values[row, column] * (1 - u) + values[row, next_column] * u
            lower = values[next_row, column] * (1 - u) + values[next_row, next_column] * u
            out.append(np.where(outside, np.nan, upper * (1 - v) + lower * v))
        return np.column_stack(out)

    def within(self, box: Box, in_place: bool = False) -> PictureMap:
        """The part in a box (left, top, width, height) of the canvas; NaN where that reaches over its edges.

        in_place: the box lies on the canvas, and the whole, whose memory the part takes, is lost.
        """
        x, y = (cut_in_place(values, box) if in_place else cut(values, box, np.nan) for values in (self.x, self.y))
        return PictureMap(x, y, self.size)


@dataclass(frozen=True)
class MapPart:
    """A map in a box of the canvas, whose first pixel lies at `corner` (x, y) of it."""

    inner: PictureMap
    corner: tuple[int, int]

    @property
    def box(self) -> Box:
        """The box (left, top, width, height) of the canvas."""
        return *self.corner, self.inner.shape[1], self.inner.shape[0]

    def canvas_box(self, shape: tuple[int, int]) -> Box:
        """A canvas of (H, W) px as a box of the inner map."""
        return -self.corner[0], -self.corner[1], shape[1], shape[0]

    def within(self, box: Box) -> MapPart:
        """The part in a box (left, top, width, height) of the canvas; nothing is copied."""
        (x, y), (left, top, width, height) = self.corner, box
        moved = x - left, y - top
        right, bottom = (
            min(corner + side, end)
            for corner, side, end in zip(moved, self.inner.shape[::-1], (width, height), strict=True)
        )
        first = max(moved[0], 0), max(moved[1], 0)
        inner = (first[0] - moved[0], first[1] - moved[1], max(0, right - first[0]), max(0, bottom - first[1]))
        return MapPart(self.inner.within(inner), first)


@dataclass(frozen=True)
class BoxedMap:
    """A map that is known in some boxes of the canvas only: beyond, the picture is not shown.

    parts: from left to right; two of a picture that goes on at the other end of a sphere; shape: (H, W) of the canvas.
    """

    parts: tuple[MapPart, ...]
    shape: tuple[int, int]

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the picture."""
        return self.parts[0].inner.size

    def arrays(self) -> PictureMap:
        """The map of the whole canvas as arrays, NaN beyond the boxes."""
        return self._over((0, 0, self.shape[1], self.shape[0]))

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the map falls inside the picture."""
        shown = [cut(part.inner.inside(), part.canvas_box(self.shape)) for part in self.parts]
        return np.logical_or.reduce(shown) if len(shown) > 1 else shown[0]

    def within(self, box: Box, in_place: bool = False) -> BoxedMap:
        """The part in a box (left, top, width, height) of the canvas; nothing is copied.

        in_place: see `PictureMap.within`.
        """
        parts = [part.within(box) for part in self.parts]
        known = [part for part in parts if part.inner.x.size]
        return BoxedMap(tuple(known or parts[:1]), (box[3], box[2]))

    def known(self) -> MapPart:
        """The map in one box that holds all, NaN in what lies between."""
        boxes = [part.box for part in self.parts]
        left, top = (min(box[axis] for box in boxes) for axis in (0, 1))
        right, bottom = (max(box[axis] + box[axis + 2] for box in boxes) for axis in (0, 1))
        return MapPart(self._over((left, top, right - left, bottom - top)), (left, top))

    def _over(self, box: Box) -> PictureMap:
        """The map in a box of the canvas, NaN where it is not known."""
        left, top, width, height = box
        found = [
            part.inner.within((left - part.corner[0], top - part.corner[1], width, height)) for part in self.parts
        ]
        if len(found) == 1:
            return found[0]
        # they have no pixel in common, and fmax takes what is known
        return PictureMap(
            np.fmax.reduce([one.x for one in found]), np.fmax.reduce([one.y for one in found]), self.size
        )


def falls_inside(x: NDArray[Any], y: NDArray[Any], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Where pixels x, y (…) lie inside a picture of (W, H) px; NaN lies outside."""
    with np.errstate(invalid="ignore"):
        return (x >= 0) & (y >= 0) & (x <= size[0] - 1) & (y <= size[1] - 1)
