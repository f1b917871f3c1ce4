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
from .canvas import Box, Canvas, Grid, bounding_canvas, expected_reach
from .displacement import Field, target_points
from .epipolar import Array, homogeneous, project
from .errors import NoOverlap
from .lens import distort, undistort
from .two_view import TwoView

if TYPE_CHECKING:
    from .images import Picture

# cv2.remap wants every side below 32767; tiles also keep its working memory small.
TILE = 1024
REMAP_LIMIT = 32000
# Where less than this of a pixel is shown, its colour is rounding.
LEAST_ALPHA = 1e-2


@dataclass(frozen=True)
class Warp:
    """map_x, map_y (H, W) float32: raw target pixel of each canvas pixel, NaN behind the camera; inverse_depth (H, W)
    float32, NaN where the field knows none."""

    canvas: Canvas
    map_x: NDArray[np.float32]
    map_y: NDArray[np.float32]
    inverse_depth: NDArray[np.float32]

    def within(self, box: Box) -> Warp:
        """The part in a box (left, top, width, height) of the canvas."""
        left, top, width, height = box
        offset = self.canvas.offset[0] - left, self.canvas.offset[1] - top
        canvas = Canvas(width, height, offset, self.canvas.cropped)
        return Warp(canvas, *(cut(a, box) for a in (self.map_x, self.map_y, self.inverse_depth)))

    def inside(self, target_size: tuple[int, int]) -> NDArray[np.bool_]:
        """Where the map falls inside a target of (W, H) px."""
        with np.errstate(invalid="ignore"):
            return (
                (self.map_x >= 0) & (self.map_y >= 0)
                & (self.map_x <= target_size[0] - 1) & (self.map_y <= target_size[1] - 1)
            )  # fmt: skip


@dataclass(frozen=True)
class Layer:
    """One picture on the canvas: pixels (H, W, C) float32 scene-linear, straight alpha (H, W) in [0, 1], 0 where it
    shows nothing."""

    pixels: NDArray[np.float32]
    alpha: NDArray[np.float32]

    def within(self, box: Box) -> Layer:
        """The part in a box (left, top, width, height) of the canvas."""
        return Layer(cut(self.pixels, box), cut(self.alpha, box))


def cut(array: NDArray, box: Box) -> NDArray:
    """The part of an array (H, W, …) in a box (left, top, width, height)."""
    left, top, width, height = box
    return np.ascontiguousarray(array[top : top + height, left : left + width])


def build_warp(field: Field, two_view: TwoView, camera: Camera, camera_prime: Camera) -> Warp:
    """The canvas that holds both pictures, and its map. Raises NoOverlap or OutputTooLarge."""
    size, target_size = camera.size, camera_prime.size

    def target_at(grid: Grid) -> Array:
        ideal = _ideal_nodes(grid, camera)
        points = grid.points if ideal is None else ideal
        values = field.on_grid(grid, ideal)
        target = target_points(two_view, points, values.inverse_depth)
        return distort(target if values.shift is None else target + values.shift, camera_prime)

    reach, cut = expected_reach(_outline(field, two_view, camera_prime), size, target_size)
    canvas = bounding_canvas(target_at, size, target_size, reach)
    warp = build_map(field, two_view, replace(canvas, cropped=canvas.cropped or cut), camera, camera_prime)
    return _trimmed(warp, size, target_size)


def build_map(field: Field, two_view: TwoView, canvas: Canvas, camera: Camera, camera_prime: Camera) -> Warp:
    """The map of a given canvas, evaluated in strips."""
    left, top = -canvas.offset[0], -canvas.offset[1]
    grid = Grid.over(left, top, canvas.width, canvas.height)
    values = field.on_grid(grid, _ideal_nodes(grid, camera))
    shape = (canvas.height, canvas.width)
    map_x, map_y, inverse_depth = (np.empty(shape, np.float32) for _ in range(3))
    xs = np.arange(left, left + canvas.width, dtype=np.float64)
    H, e = two_view.H_inf, two_view.e_prime
    rows = max(1, 1_000_000 // canvas.width)
    for start in range(0, canvas.height, rows):
        stop = min(canvas.height, start + rows)
        # float64 from here on: NumPy 1 and 2 differ in what float32 times a scalar is
        strip = (left, top + start, canvas.width, stop - start)
        d = grid.to_pixels(values.inverse_depth, *strip).astype(np.float64)
        slide = d if e.any() else np.zeros_like(d)  # where nothing slides, depth may be unknown (NaN)
        ys = np.arange(top + start, top + stop, dtype=np.float64)[:, None]
        if camera.distortion.any():
            raw = np.stack(np.broadcast_arrays(xs[None, :], ys), axis=-1)
            ray = homogeneous(undistort(raw, camera)) @ H.T
            a, b, c = (ray[..., k] + slide * e[k] for k in range(3))
        else:
            a, b, c = ((H[k, 0] * xs)[None, :] + (H[k, 1] * ys + H[k, 2]) + slide * e[k] for k in range(3))
        c[c <= 1e-6 * np.maximum(np.abs(a), np.abs(b))] = np.nan
        x, y = a / c, b / c
        if values.shift is not None:
            x += grid.to_pixels(values.shift[..., 0], *strip)
            y += grid.to_pixels(values.shift[..., 1], *strip)
        if camera_prime.distortion.any():
            x, y = np.moveaxis(distort(np.stack([x, y], axis=-1), camera_prime), -1, 0)
        map_x[start:stop], map_y[start:stop], inverse_depth[start:stop] = x, y, d
    return Warp(canvas, map_x, map_y, inverse_depth)


def _ideal_nodes(grid: Grid, camera: Camera) -> Array | None:
    return undistort(grid.points, camera) if camera.distortion.any() else None


def _outline(field: Field, two_view: TwoView, camera_prime: Camera) -> Array:
    """The target's border (N, 2) in the reference's plane by the field's own plane, NaN where that lies behind the
    reference camera."""
    width, height = camera_prime.size
    u = np.linspace(0, 1, 33)
    edges = np.concatenate([np.column_stack(p) for p in ((u, 0 * u), (u, 0 * u + 1), (0 * u, u), (0 * u + 1, u))])
    H_plane = two_view.H_inf + np.outer(two_view.e_prime, field.plane)
    ideal = undistort(edges * np.array([width - 1.0, height - 1.0]), camera_prime)
    back = homogeneous(ideal) @ np.linalg.inv(H_plane).T
    back[back[:, 2] <= 1e-6 * np.abs(back[:, :2]).max(axis=1)] = np.nan
    return project(back)


def _trimmed(warp: Warp, size: tuple[int, int], target_size: tuple[int, int]) -> Warp:
    """Without rim lines that neither picture reaches."""
    seen = warp.inside(target_size)
    x, y = warp.canvas.offset
    if not seen.any():
        raise NoOverlap("the warp brings the target nowhere near the reference: the matches may be chance look-alikes")
    seen[y : y + size[1], x : x + size[0]] = True
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    return warp.within((left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top))


def reference_layer(picture: Picture, canvas: Canvas) -> Layer:
    """The reference pasted on the canvas, pixel for pixel."""
    height, width, channels = picture.pixels.shape
    x, y = canvas.offset
    pixels = np.zeros((canvas.height, canvas.width, channels), np.float32)
    alpha = np.zeros((canvas.height, canvas.width), np.float32)
    pixels[y : y + height, x : x + width] = picture.pixels
    alpha[y : y + height, x : x + width] = 1.0 if picture.alpha is None else picture.alpha
    return Layer(pixels, alpha)


def target_layer(picture: Picture, warp: Warp) -> Layer:
    """The target fetched through the map, bicubic in scene-linear float; alpha by what it was in the picture, 0 outside
    it.

    Colours are weighted by alpha while interpolating, so that transparent pixels never bleed. Bicubic overshoot is held
    to the range of the picture itself: a black edge never turns negative.
    """
    height, width = picture.pixels.shape[:2]
    source = picture.pixels if picture.alpha is None else picture.pixels * picture.alpha[..., None]
    pixels = fetch(source, warp.map_x, warp.map_y)
    alpha = warp.inside((width, height)).astype(np.float32)
    if picture.alpha is not None:
        # both overshoot alike: divided before alpha is clipped
        fetched = fetch(picture.alpha[..., None], warp.map_x, warp.map_y)[..., 0]
        pixels /= np.maximum(fetched, LEAST_ALPHA)[..., None]
        alpha *= np.where(fetched > LEAST_ALPHA, np.minimum(fetched, 1.0), 0)
    np.clip(pixels, float(picture.pixels.min()), float(picture.pixels.max()), out=pixels)
    np.multiply(pixels, (alpha > 0)[..., None], out=pixels)
    return Layer(pixels, alpha)


def fetch(
    source: NDArray, map_x: NDArray[np.float32], map_y: NDArray[np.float32], interpolation: int = cv2.INTER_CUBIC
) -> NDArray:
    """Samples (H, W, C) of a source (h, w, C) at map positions, in tiles, of the source's type; 0 where the map leaves
    the picture."""
    out = np.zeros((*map_x.shape, source.shape[2]), source.dtype)
    for top in range(0, map_x.shape[0], TILE):
        for left in range(0, map_x.shape[1], TILE):
            tile = (slice(top, top + TILE), slice(left, left + TILE))
            _fetch_tile(source, map_x[tile], map_y[tile], out[tile], interpolation)
    return out


def _fetch_tile(
    source: NDArray, x: NDArray[np.float32], y: NDArray[np.float32], out: NDArray, interpolation: int
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
    # one picture's own border repeated: bicubic needs a pixel beyond the last
    sampled = cv2.remap(
        part,
        np.where(inside, x - x0, -9),
        np.where(inside, y - y0, -9),
        interpolation,
        borderMode=cv2.BORDER_REPLICATE,
    )
    np.copyto(out, sampled.reshape(out.shape), where=inside[..., None])
