"""The backward map: for every canvas pixel the target pixel to fetch; and fetching it.

Between nodes only d is interpolated (and slack, which is smoother still); H_inf p + d e' is evaluated at every pixel,
so that a field without slack keeps every pixel on its epipolar line exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.lens import distort, undistort
from ..cameras.projective import ahead_of_camera, homogeneous, project
from ..cameras.two_view import TwoView
from ..field.field import Field, FieldValues
from ..field.transfer import transfer
from ..raster.arrays import Array, Box, Part, cut, cut_in_place, strips, within
from ..raster.grid import Grid
from ..raster.lazy import AnyImage, LazyImage, Placed, whole
from ..raster.options import GRID
from ..system.errors import BadRequest, NoOverlap
from ..system.threads import each
from .canvas import Canvas, border, bounding_canvas, expected_reach, round_reach
from .projection import Projection

if TYPE_CHECKING:
    from ..field.refined_depth import RefinedDepth

# Fields fade out within so many pictures beside the reference, for round panoramas at least.
MAX_FADE = 3.0


@dataclass(frozen=True)
class Warp:
    """map_x, map_y (H, W) float32: raw target pixel of each canvas pixel, NaN behind the camera; depth (H, W) float32:
    the inverse depth, NaN where the field knows none; lazy_confidence (H, W) float32, 0..1, of what dense refinement
    found there, None without it. These two are worked out where they are asked for (see `raster.lazy`)."""

    canvas: Canvas
    map_x: NDArray[np.float32]
    map_y: NDArray[np.float32]
    depth: AnyImage
    lazy_confidence: AnyImage | None = None

    @property
    def inverse_depth(self) -> NDArray[np.float32]:
        """All of the inverse depth (H, W) float32."""
        return whole(self.depth)

    @property
    def confidence(self) -> NDArray[np.float32] | None:
        """All of the confidence (H, W) float32, None without dense refinement."""
        return None if self.lazy_confidence is None else whole(self.lazy_confidence)

    def within(self, box: Box, in_place: bool = False) -> Warp:
        """The part in a box (left, top, width, height) of the canvas; NaN, and no confidence, where that reaches over
        its edges. in_place: the box lies on the canvas, and the whole, whose memory the part takes, is lost."""
        left, top, width, height = box
        map_x, map_y = (
            cut_in_place(values, box) if in_place else cut(values, box, np.nan) for values in (self.map_x, self.map_y)
        )
        depth = Placed(self.depth, (-top, -left), (height, width), np.nan)
        confidence = None
        if self.lazy_confidence is not None:
            confidence = Placed(self.lazy_confidence, (-top, -left), (height, width))
        return Warp(self.canvas.within(box), map_x, map_y, depth, confidence)

    def inside(self, target_size: tuple[int, int]) -> NDArray[np.bool_]:
        """Where the map falls inside a target of (W, H) px."""
        return _inside(self.map_x, self.map_y, target_size)


def build_warp(
    field: Field, two_view: TwoView, camera: Camera, camera_prime: Camera, projection: Projection | None = None,
    relief: RefinedDepth | None = None,
) -> Warp:  # fmt: skip
    """The canvas that holds both pictures, flat or of a round projection, and its map, refined by a relief.

    Raises NoOverlap, OutputTooLarge, or BadRequest for a field that knows the reference's plane only.
    """
    outline = _outline(field, two_view, camera_prime)
    if projection is None:
        reference: Box = (0, 0, *camera.size)
        reach, cropped = expected_reach(_in_plane(outline), camera.size, camera_prime.size)
    else:
        reference, reach, cropped = round_reach(projection, _plane_map(field, two_view), outline, camera, camera_prime)
    plane = Canvas(0, 0, (0, 0), projection=projection)

    def target_at(grid: Grid) -> Array:
        values = _node_values(field, grid, plane, camera)
        infinite = plane.project_rows(two_view.H_inf, grid.xs, grid.ys, camera)
        target = np.stack(transfer(two_view, infinite, values.inverse_depth), axis=-1)
        return distort(target if values.shift is None else target + values.shift, camera_prime)

    canvas = bounding_canvas(target_at, reference, camera_prime.size, reach, projection)
    warp = build_map(field, two_view, replace(canvas, cropped=canvas.cropped or cropped), camera, camera_prime, relief)
    return _trimmed(warp, camera, camera_prime.size)


def build_map(
    field: Field, two_view: TwoView, canvas: Canvas, camera: Camera, camera_prime: Camera,
    relief: RefinedDepth | None = None,
) -> Warp:  # fmt: skip
    """The map of a given canvas, evaluated in strips."""
    left, top = -canvas.offset[0], -canvas.offset[1]
    grid = Grid.over(left, top, canvas.width, canvas.height)
    values = _node_values(field, grid, canvas, camera)
    shape = (canvas.height, canvas.width)
    map_x, map_y = (np.empty(shape, np.float32) for _ in range(2))
    xs, ys = canvas.xs, canvas.ys
    depth = Depth(canvas, camera, grid, values.inverse_depth, relief)

    def put(part: slice) -> None:
        start, stop = part.start, part.stop
        strip = (left, top + start, canvas.width, stop - start)
        d, sideways = depth.strip(part)
        x, y = transfer(two_view, canvas.project_rows(two_view.H_inf, xs, ys[start:stop], camera), d)
        if values.shift is not None:
            x += grid.to_pixels(values.shift[..., 0], *strip)
            y += grid.to_pixels(values.shift[..., 1], *strip)
        if sideways is not None:
            x += sideways[..., 0]
            y += sideways[..., 1]
        if camera_prime.distortion.any():
            x, y = np.moveaxis(distort(np.stack([x, y], axis=-1), camera_prime), -1, 0)
        map_x[part], map_y[part] = x, y

    each(put, strips(shape))
    return Warp(canvas, map_x, map_y, depth, None if relief is None else Confidence(canvas, camera, relief))


@dataclass(frozen=True, eq=False)
class Depth(LazyImage):
    """The inverse depth (H, W) of a canvas, from a field's at the nodes of a grid and a relief."""

    canvas: Canvas
    camera: Camera
    grid: Grid
    nodes: Array
    relief: RefinedDepth | None

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W)."""
        return self.canvas.height, self.canvas.width

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        out = np.empty((rows.stop - rows.start, columns.stop - columns.start), np.float32)
        # whole strips, as the map was made of: BLAS has other last bits for other shapes
        for strip in strips(self.shape):
            low, high = max(rows.start, strip.start), min(rows.stop, strip.stop)
            if low < high:
                d = self._alone(strip)
                out[low - rows.start : high - rows.start] = d[low - strip.start : high - strip.start, columns]
        return out

    def strip(self, rows: slice) -> tuple[Array, NDArray[np.float32] | None]:
        """Whole rows of it, and px that the relief adds in the target."""
        canvas, d = self.canvas, self._of_field(rows)
        if self.relief is None:
            return d, None
        more, sideways, _ = _relief_at(self.relief, canvas, canvas.xs, canvas.ys[rows], self.camera)
        return d + more, sideways

    def _alone(self, rows: slice) -> Array:
        """Whole rows of it."""
        canvas, relief = self.canvas, self.relief
        if relief is None or canvas.projection is not None:
            return self.strip(rows)[0]
        return self._of_field(rows) + relief.part_over(relief.inverse_depth, canvas.xs, canvas.ys[rows])

    def _of_field(self, rows: slice) -> Array:
        left, top = -self.canvas.offset[0], rows.start - self.canvas.offset[1]
        # float64 from here on: NumPy 1 and 2 differ in what float32 times a scalar is
        values = self.grid.to_pixels(self.nodes, left, top, self.canvas.width, rows.stop - rows.start)
        return values.astype(np.float64)


@dataclass(frozen=True, eq=False)
class Confidence(LazyImage):
    """How sure (H, W) a relief is on a canvas."""

    canvas: Canvas
    camera: Camera
    relief: RefinedDepth

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W)."""
        return self.canvas.height, self.canvas.width

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        xs, ys = self.canvas.xs[columns], self.canvas.ys[rows]
        if self.canvas.projection is None:
            return self.relief.part_over(self.relief.confidence, xs, ys)
        return _relief_at(self.relief, self.canvas, xs, ys, self.camera)[2]


def _relief_at(
    relief: RefinedDepth, canvas: Canvas, xs: Array, ys: Array, camera: Camera
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """What a relief adds to inverse depth and to target pixels at canvas columns xs and lines ys, and its
    confidence."""
    if canvas.projection is None:  # canvas pixels are the reference's
        return relief.over(xs, ys)
    places, ahead = canvas.on_reference(xs, ys, camera)
    more, sideways, confidence = relief.at(places[..., 0], places[..., 1])
    return more * np.nan_to_num(ahead).astype(np.float32), sideways, confidence


def _node_values(field: Field, grid: Grid, canvas: Canvas, camera: Camera) -> FieldValues:
    """A field's values at the nodes of a grid over the canvas's plane.

    In a round panorama they come from a grid over the reference's plane, where fields live: what d has there beside the
    plane it ends in, times p_3; and that plane alone where the reference camera does not look.
    """
    if canvas.projection is None:
        return field.on_grid(grid, undistort(grid.points, camera) if camera.distortion.any() else None)
    width, height = camera.size
    margin = int(np.ceil(min(field.fit.fade_px, MAX_FADE * max(camera.size))))
    across, down = width + 2 * margin, height + 2 * margin
    share = min(4.0, max(1.0, across * down / (2 * width * height)))
    flat = Grid.over(-margin, -margin, across, down, int(share * GRID.nodes))
    ideal = undistort(flat.points, camera)
    values = field.on_grid(flat, ideal if camera.distortion.any() else None)
    if values.far is None:
        raise BadRequest(
            f"the field {field.name!r} knows the reference's plane only: use slack or strict, or a perspective panorama"
        )
    places, ahead = canvas.on_reference(grid.xs, grid.ys, camera)
    left_over = flat.at(values.inverse_depth - homogeneous(ideal) @ values.far, places)
    (base,) = canvas.project_rows(values.far[None], grid.xs, grid.ys, camera)
    shift = values.shift
    if shift is not None:
        shift = np.stack([flat.at(shift[..., k], places) for k in (0, 1)], axis=-1)
    return FieldValues(base + np.nan_to_num(ahead) * left_over, shift)


def _plane_map(field: Field, two_view: TwoView) -> Array:
    """The homography (3, 3) from the reference to the target of the field's own plane."""
    return two_view.H_inf + np.outer(two_view.e_prime, field.plane)


def _outline(field: Field, two_view: TwoView, camera_prime: Camera) -> Array:
    """The target's border (N, 3), in order, as canvas points p by the field's own plane."""
    ideal = undistort(border(camera_prime.size), camera_prime)
    return homogeneous(ideal) @ np.linalg.inv(_plane_map(field, two_view)).T


def _in_plane(points: Array) -> Array:
    """Reference pixels (N, 2) of canvas points (N, 3), NaN behind the reference camera."""
    points = points.copy()
    points[~ahead_of_camera(*points.T)] = np.nan
    return project(points)


def _trimmed(warp: Warp, camera: Camera, target_size: tuple[int, int]) -> Warp:
    """Without rim lines that neither picture reaches."""
    seen = warp.inside(target_size)
    if not seen.any():
        raise NoOverlap("the warp brings the target nowhere near the reference: the matches may be chance look-alikes")
    seen |= reference_shown(warp.canvas, camera)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    box = left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top
    return warp.within(box, in_place=True)


def reference_map(canvas: Canvas, camera: Camera | None = None) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """x, y (H, W): the reference's raw pixel that each pixel of a round panorama shows, NaN behind its camera."""
    map_x, map_y = (np.empty((canvas.height, canvas.width), np.float32) for _ in range(2))
    rows = max(1, 1_000_000 // canvas.width)
    for start in range(0, canvas.height, rows):
        strip = slice(start, start + rows)
        places, _ = canvas.on_reference(canvas.xs, canvas.ys[strip], camera)
        map_x[strip], map_y[strip] = places[..., 0], places[..., 1]
    return map_x, map_y


def reference_box(canvas: Canvas, camera: Camera) -> Box:
    """Where the reference lies on the canvas: left, top, width, height."""
    if canvas.projection is None:
        return (*canvas.offset, *camera.size)
    seen = reference_shown(canvas, camera)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1] - columns[0]) + 1, int(rows[-1] - rows[0]) + 1


def reference_shown(canvas: Canvas, camera: Camera) -> NDArray[np.bool_]:
    """Where (H, W) the canvas lies in the reference's frame."""
    if canvas.projection is not None:
        return _inside(*reference_map(canvas, camera), camera.size)
    shown = np.zeros((canvas.height, canvas.width), bool)
    left, top = canvas.offset
    shown[top : top + camera.size[1], left : left + camera.size[0]] = True
    return shown


def _inside(
    map_x: NDArray[np.float32], map_y: NDArray[np.float32], size: tuple[int, int]
) -> NDArray[np.bool_]:
    """Where a map falls inside a picture of (W, H) px."""
    with np.errstate(invalid="ignore"):
        return (map_x >= 0) & (map_y >= 0) & (map_x <= size[0] - 1) & (map_y <= size[1] - 1)
