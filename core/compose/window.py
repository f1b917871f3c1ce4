"""The part of a canvas in which a picture is added: on a whole sphere it goes on across ±180°.

A picture of a large set covers a small part of the canvas. What is worked out when it is added is worked out there, and
put back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..panorama.canvas import Canvas
from ..panorama.layers import Layer
from ..raster.arrays import Box, Part, within
from ..raster.lazy import AnyImage, LazyImage
from ..raster.picture_map import CanvasMap, PictureMap


@dataclass(frozen=True)
class Window:
    """Rows and columns of a canvas.

    Attributes
    ----------
    box : Box
        left, top, width, height, px; it may go on with the first column after the last.
    size : (int, int)
        (W, H) of the canvas.
    round : bool
        Whether the canvas goes round, so that its last column lies beside its first.
    """

    box: Box
    size: tuple[int, int]
    round: bool = False

    @staticmethod
    def whole(canvas: Canvas) -> Window:
        """All of a canvas."""
        return Window((0, 0, canvas.width, canvas.height), (canvas.width, canvas.height), goes_round(canvas))

    @property
    def is_whole(self) -> bool:
        """Whether it is all of the canvas."""
        return self.box == (0, 0, *self.size)

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w)."""
        return self.box[3], self.box[2]

    @property
    def overhang(self) -> int:
        """Columns at either end that show again what the other end shows, of a window that goes all round."""
        return max(0, (self.box[2] - self.size[0]) // 2)

    @property
    def parts(self) -> list[tuple[Part, Part]]:
        """Rows and columns of the canvas, and which of the window's they are: more than one pair across ±180°."""
        return self._parts(0, self.box[2])

    @property
    def own_parts(self) -> list[tuple[Part, Part]]:
        """The same, each column of the canvas once."""
        return self._parts(self.overhang, self.box[2] - self.overhang)

    def _parts(self, first: int, last: int) -> list[tuple[Part, Part]]:
        """The same of some columns of the window."""
        left, top, _, height = self.box
        return [
            ((slice(top, top + height), there), (slice(0, height), here))
            for there, here in pieces(left, slice(first, last), self.size[0])
        ]

    def plane(self, values: NDArray[Any]) -> NDArray[Any]:
        """The part of an array (H, W, …); a view of it, but not across ±180°."""
        return _joined([values[there] for there, _ in self.parts])

    def image(self, values: AnyImage) -> AnyImage:
        """The part of an image (H, W, …)."""
        if self.is_whole:
            return values
        return self.plane(values) if isinstance(values, np.ndarray) else WindowImage(values, self)

    def layer(self, layer: Layer) -> Layer:
        """The part of a layer."""
        return layer if self.is_whole else Layer(self.image(layer.light), self.plane(layer.alpha))

    def map(self, picture_map: CanvasMap) -> PictureMap:
        """The part of a map."""
        if self.is_whole:
            return picture_map.arrays()
        boxes = [
            (columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
            for (rows, columns), _ in self.parts
        ]
        found = [picture_map.within(box).arrays() for box in boxes]
        return PictureMap(_joined([one.x for one in found]), _joined([one.y for one in found]), picture_map.size)

    def put(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Writes the window's values (h, w, …) into an array (H, W, …)."""
        for there, here in self.own_parts:
            out[there] = values[here]

    def closed(self, values: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """A mask (h, w) whose overhangs show the same as the other end."""
        if self.overhang:
            values = values.copy()
            for there, here in ((self.size[0], 0), (self.overhang, self.size[0] + self.overhang)):
                values[:, here : here + self.overhang] = values[:, there : there + self.overhang]
        return values

    def spread(self, values: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """A mask (h, w) as one of the whole canvas."""
        if self.is_whole:
            return values
        out = np.zeros(self.size[::-1], bool)
        self.put(values, out)
        return out

    def with_margin(self, margin: int) -> Window:
        """The same with so many px more on every side, none beyond the canvas's edges; all round, and so far beyond its
        own ends, where that leaves no gap on a canvas that goes round."""
        (left, top, width, height), (across, down) = self.box, self.size
        first, last = max(0, top - margin), min(down, top + height + margin)
        if not self.round:
            begin, end = max(0, left - margin), min(across, left + width + margin)
        else:
            begin = (left - margin) % across
            end = begin + 2 * margin + (width if width + 2 * margin < across else across)
        return replace(self, box=(begin, first, end - begin, last - first))


@dataclass(frozen=True, eq=False)
class WindowImage(LazyImage):
    """An image (H, W, …) in a window, read where it is asked for."""

    image: AnyImage
    window: Window

    @property
    def shape(self) -> tuple[int, ...]:
        """(h, w, …)."""
        return *self.window.shape, *self.image.shape[2:]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        (rows, columns), (left, top, _, _) = within(part, self.shape), self.window.box
        lines = slice(top + rows.start, top + rows.stop)
        return _joined([self.image[lines, there] for there, _ in pieces(left, columns, self.window.size[0])])


def pieces(left: int, columns: slice, width: int) -> list[tuple[slice, slice]]:
    """Some columns of a window that begins at `left` of a canvas of so many columns: those of the canvas, and of the
    window, in one pair or more. No columns are one pair, too."""
    found: list[tuple[slice, slice]] = []
    first = columns.start
    while first < columns.stop or not found:
        there = (left + first) % width
        count = min(columns.stop - first, width - there)
        found.append((slice(there, there + count), slice(first, first + count)))
        first += count
    return found


def _joined(values: list[NDArray[Any]]) -> NDArray[Any]:
    """Arrays (h, …, …) side by side; a single one itself."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)


def window_of(canvas: Canvas, shows: NDArray[np.bool_]) -> Window | None:
    """The smallest window that holds what a picture shows (H, W); None if it shows nothing."""
    rows = np.flatnonzero(shows.any(axis=1))
    if not rows.size:
        return None
    top, bottom = int(rows[0]), int(rows[-1]) + 1
    columns = np.flatnonzero(shows[top:bottom].any(axis=0))
    left, right = int(columns[0]), int(columns[-1]) + 1
    if goes_round(canvas):
        # what is left out is the widest gap between columns that show something
        gaps = np.diff(columns, append=columns[0] + canvas.width) - 1
        widest = int(np.argmax(gaps))
        left = int(columns[(widest + 1) % len(columns)])
        right = left + canvas.width - int(gaps[widest])
        if left and right == left + canvas.width:
            left, right = 0, canvas.width
    return Window((left, top, right - left, bottom - top), (canvas.width, canvas.height), goes_round(canvas))


def goes_round(canvas: Canvas) -> bool:
    """Whether a canvas's last column lies beside its first."""
    sphere = None if canvas.projection is None else canvas.projection.sphere
    return sphere is not None and canvas.width == sphere[2]
