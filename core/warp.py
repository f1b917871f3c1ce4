"""The backward map: for every canvas pixel the target pixel to fetch; and fetching it.

Between nodes only d is interpolated (and slack, which is smoother still); H_inf p + d e' is evaluated at every pixel,
so that a field without slack keeps every pixel on its epipolar line exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .canvas import NODES, Box, Canvas, Grid, border, bounding_canvas, expected_reach, round_reach
from .displacement import Field, FieldValues, slid
from .epipolar import Array, homogeneous, project
from .errors import BadRequest, NoOverlap
from .lens import distort, undistort
from .light import (
    AnyLight,
    Held,
    Light,
    Part,
    Placed,
    Weighed,
    bounds,
    extent,
    part_of,
    shown_only,
    strips,
    whole,
    within,
)  # fmt: skip
from .projection import Projection
from .threads import each
from .two_view import TwoView

if TYPE_CHECKING:
    from .images import Picture
    from .relief import Relief

# cv2.remap wants every side below 32767; tiles also keep its working memory small.
TILE = 1024
REMAP_LIMIT = 32000
# Where less than this of a pixel is shown, its colour is rounding.
LEAST_ALPHA = 1e-2
# Fields fade out within so many pictures beside the reference, for round panoramas at least.
MAX_FADE = 3.0


@dataclass(frozen=True)
class Warp:
    """map_x, map_y (H, W) float32: raw target pixel of each canvas pixel, NaN behind the camera; depth (H, W) float32:
    the inverse depth, NaN where the field knows none; sureness (H, W) float32, 0..1, of what dense refinement found
    there, None without it. These two are worked out where they are asked for (see `light`)."""

    canvas: Canvas
    map_x: NDArray[np.float32]
    map_y: NDArray[np.float32]
    depth: AnyLight
    sureness: AnyLight | None = None

    @property
    def inverse_depth(self) -> NDArray[np.float32]:
        """All of the inverse depth (H, W) float32."""
        return whole(self.depth)

    @property
    def confidence(self) -> NDArray[np.float32] | None:
        """All of the confidence (H, W) float32, None without dense refinement."""
        return None if self.sureness is None else whole(self.sureness)

    def within(self, box: Box, in_place: bool = False) -> Warp:
        """The part in a box (left, top, width, height) of the canvas; NaN, and no confidence, where that reaches over
        its edges. in_place: the box lies on the canvas, and the whole, whose memory the part takes, is lost."""
        left, top, width, height = box
        map_x, map_y = (
            _cut_in_place(values, box) if in_place else cut(values, box, np.nan) for values in (self.map_x, self.map_y)
        )
        depth = Placed(self.depth, (-top, -left), (height, width), np.nan)
        sureness = None if self.sureness is None else Placed(self.sureness, (-top, -left), (height, width))
        return Warp(self.canvas.within(box), map_x, map_y, depth, sureness)

    def inside(self, target_size: tuple[int, int]) -> NDArray[np.bool_]:
        """Where the map falls inside a target of (W, H) px."""
        return _inside(self.map_x, self.map_y, target_size)


def jacobian(x: NDArray, y: NDArray) -> NDArray:
    """Area (H, W) that a map's (x, y) takes up for each of its pixels, by central differences; its sign changes where
    the map turns over. NaN beside what is not finite."""
    return np.gradient(x, axis=1) * np.gradient(y, axis=0) - np.gradient(x, axis=0) * np.gradient(y, axis=1)


def cell_areas(x: NDArray, y: NDArray) -> NDArray:
    """Signed area (H − 1, W − 1) that a map (x, y) (H, W) spans between each pixel and its right and lower neighbours;
    its sign changes where the map turns over. NaN beside what is not finite."""
    turn: NDArray = (x[:-1, 1:] - x[:-1, :-1]) * (y[1:, :-1] - y[:-1, :-1])
    return turn - (x[1:, :-1] - x[:-1, :-1]) * (y[:-1, 1:] - y[:-1, :-1])


@dataclass(frozen=True)
class Layer:
    """One picture on the canvas: light (H, W, C) float32 scene-linear, as an array or worked out where it is asked for
    (see `light`); straight alpha (H, W), float32 in [0, 1] or, where nothing is half seen through, bool; 0 where it
    shows nothing."""

    light: AnyLight
    alpha: NDArray[np.float32] | NDArray[np.bool_]

    @property
    def pixels(self) -> NDArray[np.float32]:
        """All of its light as an array."""
        return whole(self.light)

    def within(self, box: Box) -> Layer:
        """The part in a box (left, top, width, height) of the canvas; nothing where that reaches over its edges."""
        left, top, width, height = box
        if (left, top, height, width) == (0, 0, *self.alpha.shape):
            return self
        return Layer(Placed(self.light, (-top, -left), (height, width)), cut(self.alpha, box))

    def held(self, part: Part) -> Layer:
        """The same, with the light of a part, which is asked for more than once, kept as an array."""
        return Layer(Held(self.light, (part[0].start, part[1].start), part_of(self.light, part)), self.alpha)


def cut(array: NDArray, box: Box, beyond: float = 0.0) -> NDArray:
    """The part of an array (H, W, …) in a box (left, top, width, height); `beyond` where that reaches over its edges.
    """
    left, top, width, height = box
    right, bottom = left + width, top + height
    if left >= 0 and top >= 0 and right <= array.shape[1] and bottom <= array.shape[0]:
        return np.ascontiguousarray(array[top:bottom, left:right])
    out = np.zeros((height, width, *array.shape[2:]), array.dtype)  # a sphere is mostly empty: memory untouched is free
    if beyond:
        out[:] = beyond
    part = array[max(0, top) : bottom, max(0, left) : right]
    y, x = max(0, -top), max(0, -left)
    out[y : y + part.shape[0], x : x + part.shape[1]] = part
    return out


def build_warp(
    field: Field, two_view: TwoView, camera: Camera, camera_prime: Camera, projection: Projection | None = None,
    relief: Relief | None = None,
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
        infinite = plane.through(two_view.H_inf, grid.xs, grid.ys, camera)
        target = np.stack(slid(two_view, infinite, values.inverse_depth), axis=-1)
        return distort(target if values.shift is None else target + values.shift, camera_prime)

    canvas = bounding_canvas(target_at, reference, camera_prime.size, reach, projection)
    warp = build_map(field, two_view, replace(canvas, cropped=canvas.cropped or cropped), camera, camera_prime, relief)
    return _trimmed(warp, camera, camera_prime.size)


def build_map(
    field: Field, two_view: TwoView, canvas: Canvas, camera: Camera, camera_prime: Camera, relief: Relief | None = None
) -> Warp:
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
        x, y = slid(two_view, canvas.through(two_view.H_inf, xs, ys[start:stop], camera), d)
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
    return Warp(canvas, map_x, map_y, depth, None if relief is None else Sureness(canvas, camera, relief))


@dataclass(frozen=True, eq=False)
class Depth(Light):
    """The inverse depth (H, W) of a canvas, from a field's at the nodes of a grid and a relief."""

    canvas: Canvas
    camera: Camera
    grid: Grid
    nodes: Array
    relief: Relief | None

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
class Sureness(Light):
    """How sure (H, W) a relief is on a canvas."""

    canvas: Canvas
    camera: Camera
    relief: Relief

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
    relief: Relief, canvas: Canvas, xs: Array, ys: Array, camera: Camera
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
    flat = Grid.over(-margin, -margin, across, down, int(share * NODES))
    ideal = undistort(flat.points, camera)
    values = field.on_grid(flat, ideal if camera.distortion.any() else None)
    if values.far is None:
        raise BadRequest(
            f"the field {field.name!r} knows the reference's plane only: use slack or strict, or a perspective panorama"
        )
    places, ahead = canvas.on_reference(grid.xs, grid.ys, camera)
    left_over = flat.at(values.inverse_depth - homogeneous(ideal) @ values.far, places)
    (base,) = canvas.through(values.far[None], grid.xs, grid.ys, camera)
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
    points[points[:, 2] <= 1e-6 * np.abs(points[:, :2]).max(axis=1)] = np.nan
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


def _cut_in_place(array: NDArray[np.float32], box: Box) -> NDArray[np.float32]:
    """The part of an array (H, W) in a box (left, top, width, height) of it, moved to the front of its memory."""
    left, top, width, height = box
    flat = array.reshape(-1)
    for row in range(height):
        start = (top + row) * array.shape[1] + left
        flat[row * width : (row + 1) * width] = flat[start : start + width]
    return flat[: width * height].reshape(height, width)


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


def reference_layer(picture: Picture, canvas: Canvas, camera: Camera | None = None) -> Layer:
    """The reference on the canvas: pasted pixel for pixel on a flat one, fetched like the target on a round one.

    camera: the reference's, if its lens matters.
    """
    if canvas.projection is not None:
        return _fetched_layer(picture, *reference_map(canvas, camera))
    height, width, _ = picture.light.shape
    x, y = canvas.offset
    alpha = np.zeros((canvas.height, canvas.width), bool if picture.alpha is None else np.float32)
    alpha[y : y + height, x : x + width] = True if picture.alpha is None else picture.alpha
    return Layer(Placed(picture.light, (y, x), (canvas.height, canvas.width)), alpha)


def target_layer(picture: Picture, warp: Warp) -> Layer:
    """The target fetched through the map; alpha by what it was in the picture, 0 outside it."""
    return _fetched_layer(picture, warp.map_x, warp.map_y)


def _fetched_layer(picture: Picture, map_x: NDArray[np.float32], map_y: NDArray[np.float32]) -> Layer:
    """A picture through a map of its raw pixels (H, W)."""
    height, width, channels = picture.light.shape
    inside = _inside(map_x, map_y, (width, height))
    box = bounds(inside)
    if box is None:
        return Layer(np.broadcast_to(np.float32(0), (*inside.shape, channels)), inside)
    light, alpha = Fetched.through(picture, map_x[box], map_y[box], inside[box])
    placed = Placed(light, (box[0].start, box[1].start), (inside.shape[0], inside.shape[1]))
    if picture.alpha is None:
        return Layer(placed, inside)
    whole_alpha = np.zeros(inside.shape, np.float32)
    whole_alpha[box] = alpha
    return Layer(placed, whole_alpha)


@dataclass(frozen=True, eq=False)
class Fetched(Light):
    """A picture (h, w, C) through a map of its raw pixels (H, W), bicubic in scene-linear float.

    Colours are weighted by alpha while interpolating, so that transparent pixels never bleed. Bicubic overshoot is held
    to the range of the picture itself: a black edge never turns negative. shows (H, W): where it shows anything.
    """

    picture: Picture
    map_x: NDArray[np.float32]
    map_y: NDArray[np.float32]
    shows: NDArray[np.bool_]
    range: tuple[float, float]

    @staticmethod
    def through(
        picture: Picture, map_x: NDArray[np.float32], map_y: NDArray[np.float32], inside: NDArray[np.bool_]
    ) -> tuple[Fetched, NDArray]:
        """A picture through a map, and its alpha (H, W); inside (H, W): where the map falls inside the picture."""
        alpha: NDArray = inside
        if picture.alpha is not None:
            fetched = fetch(picture.alpha[..., None], map_x, map_y)[..., 0]
            alpha = inside * np.where(fetched > LEAST_ALPHA, np.minimum(fetched, 1.0), np.float32(0))
        shows = inside if picture.alpha is None else alpha > 0
        return Fetched(picture, map_x, map_y, shows, extent(picture.light)), alpha

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return *self.map_x.shape, self.picture.light.shape[2]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        alpha, shows = self.picture.alpha, self.shows[part]
        if not shows.any():
            return np.zeros((*shows.shape, self.shape[2]), np.float32)
        map_x, map_y = self.map_x[part], self.map_y[part]
        pixels = fetch(self.picture.light if alpha is None else Weighed(self.picture.light, alpha), map_x, map_y)
        if alpha is not None:
            # both overshoot alike: divided before alpha is clipped
            pixels /= np.maximum(fetch(alpha[..., None], map_x, map_y)[..., 0], LEAST_ALPHA)[..., None]
        np.clip(pixels, *self.range, out=pixels)
        return pixels if shows.all() else shown_only(pixels, shows)


def fetch(
    source: NDArray | Light, map_x: NDArray[np.float32], map_y: NDArray[np.float32],
    interpolation: int = cv2.INTER_CUBIC,
) -> NDArray:
    """Samples (H, W, C) of a source (h, w, C) at map positions, in tiles, of the source's type; 0 where the map leaves
    the picture."""
    out = np.zeros((*map_x.shape, source.shape[2]), source.dtype)
    tops, lefts = (range(0, side, TILE) for side in map_x.shape)
    each(
        lambda tile: _fetch_tile(source, map_x[tile], map_y[tile], out[tile], interpolation),
        [(slice(top, top + TILE), slice(left, left + TILE)) for top in tops for left in lefts],
    )
    return out


def _fetch_tile(
    source: NDArray | Light, x: NDArray[np.float32], y: NDArray[np.float32], out: NDArray, interpolation: int
) -> None:
    height, width = source.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    if not inside.any():
        return
    x0, x1 = max(0, int(x[inside].min()) - 2), min(width, int(x[inside].max()) + 4)
    y0, y1 = max(0, int(y[inside].min()) - 2), min(height, int(y[inside].max()) + 4)
    if max(x1 - x0, y1 - y0) > REMAP_LIMIT and max(out.shape[:2]) > 1:  # a tile that shrinks a huge picture: quarter it
        half = (max(1, out.shape[0] // 2), max(1, out.shape[1] // 2))
        for rows in (slice(None, half[0]), slice(half[0], None)):
            for columns in (slice(None, half[1]), slice(half[1], None)):
                if out[rows, columns].size:
                    _fetch_tile(source, x[rows, columns], y[rows, columns], out[rows, columns], interpolation)
        return
    part = np.ascontiguousarray(source[y0:y1, x0:x1])
    x, y = x - np.float32(x0), y - np.float32(y0)
    whole_tile = bool(inside.all())
    if not whole_tile:
        x[~inside] = y[~inside] = -9
    # one picture's own border repeated: bicubic needs a pixel beyond the last
    sampled = cv2.remap(part, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE).reshape(out.shape)
    if whole_tile:
        out[:] = sampled
    else:
        copied_where(inside, sampled, out)


def copied_where(mask: NDArray[np.bool_], source: NDArray, out: NDArray) -> None:
    """Puts the pixels (H, W, C) of a source where a mask (H, W) says so; `np.copyto` takes several times as long."""
    cv2.copyTo(source, np.ascontiguousarray(mask).view(np.uint8), out)
