"""How the continuation beyond the overlap takes over from the field on a canvas, across the reference's border."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..cameras.camera import Camera
from ..cameras.projective import inverse_intrinsics
from ..field.fade import fading
from ..field.field import FieldValues
from ..raster.arrays import Array
from ..raster.grid import Grid

if TYPE_CHECKING:
    from ..continuation.continuation import Continuation
    from .canvas import Canvas


@dataclass(frozen=True, eq=False)
class ContinuedDepth:
    """Continued inverse depth on a canvas: nodes (rows, columns) of a grid; camera: the reference's; takeover_px: see
    `Continuation`."""

    canvas: Canvas
    camera: Camera
    grid: Grid
    nodes: Array
    takeover_px: float

    @staticmethod
    def over(continuation: Continuation | None, canvas: Canvas, camera: Camera, grid: Grid) -> ContinuedDepth | None:
        """The continuation at the nodes of a grid; None without one."""
        if continuation is None:
            return None
        to_ray = inverse_intrinsics(continuation.K)
        rays = np.stack(canvas.project_rows(to_ray, grid.xs, grid.ys, camera), axis=-1)
        length = np.linalg.norm(rays, axis=-1)
        nodes = continuation.at(rays / length[..., None]) * length
        return ContinuedDepth(canvas, camera, grid, nodes, continuation.takeover_px)

    def strip(self, rows: slice) -> tuple[Array, Array]:
        """Whole rows of continued inverse depth, and of the field's share (see `field_share`)."""
        canvas = self.canvas
        left, top = -canvas.offset[0], rows.start - canvas.offset[1]
        values = self.grid.to_pixels(self.nodes, left, top, canvas.width, rows.stop - rows.start)
        share = field_share(canvas, self.camera, canvas.xs, canvas.ys[rows], self.takeover_px)
        return values.astype(np.float64), share

    def blended(self, values: FieldValues) -> FieldValues:
        """The field's values at the nodes, where it has its share, and the continuation's beyond."""
        share = field_share(self.canvas, self.camera, self.grid.xs, self.grid.ys, self.takeover_px)
        depth = self.nodes + share * (values.inverse_depth - self.nodes)
        shift = None if values.shift is None else values.shift * share[..., None]
        return replace(values, inverse_depth=depth, shift=shift)


def field_share(canvas: Canvas, camera: Camera, xs: Array, ys: Array, width_px: float) -> Array:
    """What the field counts (len(ys), len(xs)) at columns xs and lines ys, px of the plane: 1 where the reference lies,
    falling smoothly to 0 over width_px around it; camera: the reference's."""
    if canvas.projection is None:  # canvas pixels are the reference's
        x, y = xs[None, :], ys[:, None]
    else:
        x, y = np.moveaxis(canvas.on_reference(xs, ys, camera)[0], -1, 0)
    width, height = camera.size
    across, down = np.maximum(np.maximum(-x, x - (width - 1)), 0), np.maximum(np.maximum(-y, y - (height - 1)), 0)
    distance = np.nan_to_num(np.hypot(across, down), nan=np.inf)  # behind the camera
    return fading(distance, width_px)
