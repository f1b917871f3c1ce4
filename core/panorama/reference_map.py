"""Where the reference is seen on a canvas. That needs no field: the panorama has the reference's viewpoint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..raster.arrays import Box, strips
from ..raster.picture_map import PictureMap, falls_inside
from .canvas import Canvas


@dataclass(frozen=True)
class ReferenceMap:
    """The reference's map of a canvas, worked out where it is read; camera: the reference's."""

    canvas: Canvas
    camera: Camera

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the reference."""
        return self.camera.size

    @property
    def pasted(self) -> bool:
        """Whether the canvas is the reference's own plane, in which it lies pixel for pixel."""
        return self.canvas.projection is None

    def arrays(self) -> PictureMap:
        """The map as arrays."""
        canvas = self.canvas
        shape = (canvas.height, canvas.width)
        if self.pasted:
            x, y = np.broadcast_to(canvas.xs[None, :], shape), np.broadcast_to(canvas.ys[:, None], shape)
            return PictureMap(x.astype(np.float32), y.astype(np.float32), self.size)
        x, y = (np.empty(shape, np.float32) for _ in range(2))
        for strip in strips(shape):
            places, _ = canvas.on_reference(canvas.xs, canvas.ys[strip], self.camera)
            x[strip], y[strip] = places[..., 0], places[..., 1]
        return PictureMap(x, y, self.size)

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the canvas lies in the reference's frame."""
        if not self.pasted:
            return self.arrays().inside()
        columns, rows = (falls_inside(axis, axis, (side, side)) for axis, side in (
            (self.canvas.xs, self.size[0]), (self.canvas.ys, self.size[1])
        ))  # fmt: skip
        return rows[:, None] & columns[None, :]

    def within(self, box: Box, in_place: bool = False) -> ReferenceMap:
        """The map of a box (left, top, width, height) of the canvas; in_place: see `PictureMap.within`."""
        return ReferenceMap(self.canvas.within(box), self.camera)
