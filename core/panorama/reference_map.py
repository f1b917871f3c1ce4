"""Where the reference is seen on a canvas in its own plane: pixel for pixel, so that nothing has to be kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..raster.arrays import Box
from ..raster.picture_map import PictureMap, falls_inside
from .canvas import Canvas


@dataclass(frozen=True)
class ReferenceMap:
    """The reference's map of a canvas in its own plane, worked out where it is read; camera: the reference's."""

    canvas: Canvas
    camera: Camera

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the reference."""
        return self.camera.size

    def arrays(self) -> PictureMap:
        """The map as arrays."""
        canvas = self.canvas
        shape = (canvas.height, canvas.width)
        x, y = np.broadcast_to(canvas.xs[None, :], shape), np.broadcast_to(canvas.ys[:, None], shape)
        return PictureMap(x.astype(np.float32), y.astype(np.float32), self.size)

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the canvas lies in the reference's frame."""
        columns, rows = (falls_inside(axis, axis, (side, side)) for axis, side in (
            (self.canvas.xs, self.size[0]), (self.canvas.ys, self.size[1])
        ))  # fmt: skip
        return rows[:, None] & columns[None, :]

    def within(self, box: Box, in_place: bool = False) -> ReferenceMap:
        """The map of a box (left, top, width, height) of the canvas; in_place: see `PictureMap.within`."""
        return ReferenceMap(self.canvas.within(box), self.camera)
