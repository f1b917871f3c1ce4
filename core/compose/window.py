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
from ..raster.arrays import Box, Part
from ..raster.lazy import AnyImage, Placed
from ..raster.picture_map import CanvasMap, PictureMap
from .wraparound import WrappedImage


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
    def parts(self) -> list[tuple[Part, Part]]:
        """Rows and columns of the canvas, and which of the window's they are: one pair, or two across ±180°."""
        left, top, width, height = self.box
        rows, first = slice(top, top + height), min(width, self.size[0] - left)
        found = [((rows, slice(left, left + first)), (slice(0, height), slice(0, first)))]
        if first < width:
            found.append(((rows, slice(0, width - first)), (slice(0, height), slice(first, width))))
        return found

    def plane(self, values: NDArray[Any]) -> NDArray[Any]:
        """The part of an array (H, W, …); a view of it, but not across ±180°."""
        found = [values[there] for there, _ in self.parts]
        return found[0] if len(found) == 1 else np.concatenate(found, axis=1)

    def image(self, values: AnyImage) -> AnyImage:
        """The part of an image (H, W, …)."""
        left, top, width, _ = self.box
        if self.is_whole:
            return values
        if isinstance(values, np.ndarray):
            return self.plane(values)
        if left + width <= self.size[0]:
            return Placed(values, (-top, -left), self.shape)
        return Placed(WrappedImage(values, left), (-top, 0), self.shape)

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
        if len(found) == 1:
            return found[0]
        x, y = (np.concatenate([getattr(one, name) for one in found], axis=1) for name in ("x", "y"))
        return PictureMap(x, y, picture_map.size)

    def canvas(self, canvas: Canvas) -> Canvas:
        """The part of the canvas; across ±180° only its size means anything."""
        return canvas if self.is_whole else canvas.within(self.box)

    def put(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Writes the window's values (h, w, …) into an array (H, W, …)."""
        for there, here in self.parts:
            out[there] = values[here]

    def spread(self, values: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """A mask (h, w) as one of the whole canvas."""
        if self.is_whole:
            return values
        out = np.zeros(self.size[::-1], bool)
        self.put(values, out)
        return out

    def with_margin(self, margin: int) -> Window:
        """The same with so many px more on every side: all columns where it goes round, none beyond the edges else."""
        (left, top, width, height), (across, down) = self.box, self.size
        first, last = max(0, top - margin), min(down, top + height + margin)
        if not self.round:
            begin, end = max(0, left - margin), min(across, left + width + margin)
        elif width + 2 * margin < across:
            begin = (left - margin) % across
            end = begin + width + 2 * margin
        else:
            begin, end = 0, across
        return replace(self, box=(begin, first, end - begin, last - first))


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
