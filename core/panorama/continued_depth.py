"""How the continuation beyond the overlap takes over from the field on a canvas, across the reference's border."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..cameras.camera import Camera
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
        rays, length = canvas.rays_at(continuation.K, grid.xs, grid.ys, camera)
        nodes = continuation.at(rays) * length
        return ContinuedDepth(canvas, camera, grid, nodes, continuation.takeover_px)

    def strip(self, rows: slice, places: Array | None) -> tuple[Array, Array]:
        """Whole rows of continued inverse depth, and of the field's share (see `field_share`); places (h, W, 2): raw px
        of the reference there, None on its own plane."""
        canvas = self.canvas
        left, top = -canvas.offset[0], rows.start - canvas.offset[1]
        values = self.grid.to_pixels(self.nodes, left, top, canvas.width, rows.stop - rows.start)
        if places is None:  # canvas pixels are the reference's
            share = field_share(canvas.xs[None, :], canvas.ys[rows][:, None], self.camera.size, self.takeover_px)
        else:
            share = field_share(places[..., 0], places[..., 1], self.camera.size, self.takeover_px)
        return values.astype(np.float64), share

    def blended(self, values: FieldValues) -> FieldValues:
        """The field's values at the nodes, where it has its share, and the continuation's beyond."""
        x, y = self.grid.xs[None, :], self.grid.ys[:, None]
        if self.canvas.projection is not None:
            x, y = np.moveaxis(self.canvas.on_reference(self.grid.xs, self.grid.ys, self.camera)[0], -1, 0)
        share = field_share(x, y, self.camera.size, self.takeover_px)
        depth = self.nodes + share * (values.inverse_depth - self.nodes)
        shift = None if values.shift is None else values.shift * share[..., None]
        return replace(values, inverse_depth=depth, shift=shift)


def field_share(x: Array, y: Array, size: tuple[int, int], width_px: float) -> Array:
    """What the field counts (…) at raw px x, y (…) of a reference of (W, H) px: 1 within it, falling smoothly to 0 over
    width_px around it; NaN, behind its camera, lies beyond."""
    width, height = size
    across, down = np.maximum(np.maximum(-x, x - (width - 1)), 0), np.maximum(np.maximum(-y, y - (height - 1)), 0)
    distance = np.nan_to_num(np.hypot(across, down), nan=np.inf)
    return fading(distance, width_px)
