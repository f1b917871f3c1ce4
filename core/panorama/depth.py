"""Inverse depth on a canvas, its confidence, and nearness to a picture's camera, as images that are read lazily."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.view import View
from ..field.refined_depth import RefinedDepth
from ..field.refined_sphere import RefinedSphere
from ..field.visibility import nearness_of
from ..raster.arrays import Array, Part, strips, within
from ..raster.grid import Grid
from ..raster.lazy import AnyImage, LazyImage
from .canvas import Canvas
from .continued_depth import ContinuedDepth

if TYPE_CHECKING:
    from .rig_viewpoint import RigViewpoint


@dataclass(frozen=True, eq=False)
class OnCanvas(LazyImage):
    """Values (H, W) of the pixels of a canvas; camera: the reference's."""

    canvas: Canvas
    camera: Camera

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W)."""
        return self.canvas.height, self.canvas.width


@dataclass(frozen=True, eq=False)
class AtNodes(OnCanvas):
    """Values (H, W) between those at the nodes of a grid."""

    grid: Grid
    nodes: Array

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        (rows, columns), (x, y) = within(part, self.shape), self.canvas.offset
        size = columns.stop - columns.start, rows.stop - rows.start
        return self.grid.to_pixels(self.nodes, columns.start - x, rows.start - y, *size)


@dataclass(frozen=True, eq=False)
class Strip:
    """Inverse depth (h, W) of whole rows of a canvas.

    sideways (h, W, 2), confidence (h, W): px that dense refinement adds in its picture, and its confidence, None
    without it; share (h, W): what the field counts, in depth and in px beside the epipolar lines, None if all of it;
    places (h, W, 2): raw px of the reference, None on its own plane.
    """

    depth: Array
    sideways: NDArray[np.float32] | None
    confidence: NDArray[np.float32] | None
    share: Array | None
    places: Array | None


@dataclass(frozen=True, eq=False)
class Depth(OnCanvas):
    """The inverse depth (H, W) of a canvas, from a field's at the nodes of a grid, its dense refinement, and what
    continues both beyond the overlap."""

    grid: Grid
    nodes: Array
    refined: RefinedDepth | None
    continued: ContinuedDepth | None = None

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        out = np.empty((rows.stop - rows.start, columns.stop - columns.start), np.float32)
        # the same strips as in `build_map`: BLAS rounds differently for other shapes
        for strip in strips(self.shape):
            low, high = max(rows.start, strip.start), min(rows.stop, strip.stop)
            if low < high:
                d = self._depth(strip)
                out[low - rows.start : high - rows.start] = d[low - strip.start : high - strip.start, columns]
        return out

    def strip(self, rows: slice) -> Strip:
        """All that is known of whole rows."""
        canvas, d, sideways, confidence = self.canvas, self._of_field(rows), None, None
        xs, ys = canvas.xs, canvas.ys[rows]
        places, ahead = (None, None) if canvas.projection is None else canvas.on_reference(xs, ys, self.camera)
        if self.refined is not None:
            if places is None or ahead is None:  # canvas pixels are the reference's
                more, sideways, confidence = self.refined.over(xs, ys)
            else:
                more, sideways, confidence = _refined_at(self.refined, places, ahead)
            d = d + more
        if self.continued is None:
            return Strip(d, sideways, confidence, None, places)
        beyond, share = self.continued.strip(rows, places)
        return Strip(_taken_over(d, beyond, share), sideways, confidence, share, places)

    def _depth(self, rows: slice) -> Array:
        """Whole rows of inverse depth, without what dense refinement adds in its picture."""
        canvas, refined = self.canvas, self.refined
        if refined is None or canvas.projection is not None:
            return self.strip(rows).depth
        d = self._of_field(rows) + refined.part_over(refined.inverse_depth, canvas.xs, canvas.ys[rows])
        return d if self.continued is None else _taken_over(d, *self.continued.strip(rows, None))

    def _of_field(self, rows: slice) -> Array:
        """Whole rows of the field's inverse depth."""
        left, top = -self.canvas.offset[0], rows.start - self.canvas.offset[1]
        # float64 from here on: NumPy 1 and 2 differ in what float32 times a scalar is
        values = self.grid.to_pixels(self.nodes, left, top, self.canvas.width, rows.stop - rows.start)
        return values.astype(np.float64)


@dataclass(frozen=True, eq=False)
class Confidence(OnCanvas):
    """Confidence (H, W) of dense refinement on a canvas, 0..1."""

    refined: RefinedDepth

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        xs, ys = self.canvas.xs[columns], self.canvas.ys[rows]
        if self.canvas.projection is None:
            return self.refined.part_over(self.refined.confidence, xs, ys)
        return _refined_at(self.refined, *self.canvas.on_reference(xs, ys, self.camera))[2]


@dataclass(frozen=True, eq=False)
class OfSphere(OnCanvas):
    """What dense refinement found on the sphere, at the pixels (H, W) of a canvas.

    K (3, 3): the first picture's; what: confidence or the standard deviation of inverse depth.
    """

    K: Array
    refined: RefinedSphere
    what: Literal["confidence", "deviation"]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        rays, length = self.canvas.rays_at(self.K, self.canvas.xs[columns], self.canvas.ys[rows], self.camera)
        _, confidence, deviation = self.refined.at(rays)
        return confidence if self.what == "confidence" else deviation * length.astype(np.float32)


@dataclass(frozen=True, eq=False)
class Nearness(OnCanvas):
    """Baselines per distance (H, W) from a view's camera (see `visibility.nearness_of`); camera: the reference's.

    slide (H, W): that of each pixel's viewpoint, None if all are seen from the reference's place; nearer: by how much
    nearer the view's camera is to the place of the target than to that of the reference, along its axis; viewpoint: of
    more than two pictures, if it slides, and the first one's K.
    """

    view: View
    depth: AnyImage
    slide: AnyImage | None = None
    nearer: float = 0.0
    viewpoint: tuple[Array, RigViewpoint] | None = None

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        xs, ys = self.canvas.xs[columns], self.canvas.ys[rows]
        (infinite,) = self.canvas.project_rows(self.view.H_inf[2:], xs, ys, self.camera)
        d = np.asarray(self.depth[part])
        with np.errstate(invalid="ignore", divide="ignore"):
            ahead = d * np.float32(self.view.e_prime[2]) + infinite.astype(np.float32)
            if self.viewpoint is not None:
                K, viewpoint = self.viewpoint
                places = viewpoint.place(self.canvas.rays_at(K, xs, ys, self.camera)[0])
                ahead += d * (places @ (K.T @ self.view.H_inf[2])).astype(np.float32)
            if self.slide is not None:
                ahead += d * np.asarray(self.slide[part]) * np.float32(self.nearer)
            return nearness_of(d, ahead)


def _taken_over(d: Array, beyond: Array, share: Array) -> Array:
    """Inverse depth d (h, W) with its share, what continues it with the rest; d itself where that is all."""
    return np.where(share < 1, beyond + share * (d - beyond), d)


def _refined_at(
    refined: RefinedDepth, places: Array, ahead: Array
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """What dense refinement adds to inverse depth and to its picture's pixels at raw px (…, 2) of the reference with
    p_3 = ahead (…), and its confidence."""
    more, sideways, confidence = refined.at(places[..., 0], places[..., 1])
    return more * np.nan_to_num(ahead).astype(np.float32), sideways, confidence
