"""Nodes of the reference, their target pixels by the fitted field, and moves along their epipolar lines from there.

Dense refinement works on these. Inverse depth d and moves in px are related by `EpipolarLines.depth_per_px`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.lens import distort, undistort
from ..cameras.projective import ahead_of_camera
from ..cameras.two_view import TwoView
from ..field.field import Field
from ..field.transfer import target_points
from ..raster.arrays import Array, Box, Plane
from ..raster.grid import Grid
from ..raster.resizing import resized_points
from ..system.threads import each
from .options import LINES

Places = NDArray[np.intp]


@dataclass(frozen=True)
class SparseMap:
    """A field on every `step`th raw pixel of a box around the reference.

    start (x, y): the first pixel; inverse_depth (h, w); shift (h, w, 2) target px, None if the field has none.
    """

    two_view: TwoView
    camera: Camera
    camera_prime: Camera
    start: tuple[int, int]
    step: int
    inverse_depth: Plane
    shift: Plane | None

    @staticmethod
    def over_reference(
        field: Field, two_view: TwoView, camera: Camera, camera_prime: Camera, margin: int, step: int = 1
    ) -> SparseMap:
        """The field on the reference and `margin` px around it, on every `step`th pixel."""
        width, height = camera.size
        box = (-margin, -margin, width + 2 * margin, height + 2 * margin)
        grid = Grid.over(*box)
        values = field.on_grid(grid, undistort(grid.points, camera) if camera.bent else None)
        inverse_depth = np.ascontiguousarray(grid.to_pixels(values.inverse_depth, *box, step))
        shift = None
        if values.shift is not None:
            shift = cv2.merge([np.ascontiguousarray(grid.to_pixels(values.shift[..., k], *box, step)) for k in (0, 1)])
        return SparseMap(two_view, camera, camera_prime, box[:2], step, inverse_depth, shift)

    def smoothed(self, sigma: float, plane: Array) -> SparseMap:
        """The field without details of d finer than about sigma px; plane m (3,): the affine part of d, which stays."""
        if sigma < 1:
            return self
        height, width = self.inverse_depth.shape
        small = max(8, round(8 * width * self.step / sigma)), max(8, round(8 * height * self.step / sigma))

        def affine(columns: int, rows: int) -> tuple[Plane, Plane]:
            """m·p as a part (columns,) by x and a part (rows, 1) by y, at the centres of cells over the map."""
            xs, ys = (resized_points(np.arange(n), n, all_of) for n, all_of in ((columns, width), (rows, height)))
            xs, ys = xs * self.step + self.start[0], ys * self.step + self.start[1]
            return (plane[0] * xs + plane[2]).astype(np.float32), (plane[1] * ys).astype(np.float32)[:, None]

        bend = cv2.resize(self.inverse_depth, small, interpolation=cv2.INTER_AREA)
        for part in affine(*small):
            bend -= part
        bend = cv2.GaussianBlur(bend, (0, 0), 8.0, borderType=cv2.BORDER_REPLICATE)
        bend = cv2.resize(bend, (width, height), interpolation=cv2.INTER_CUBIC)
        for part in affine(width, height):
            bend += part
        return replace(self, inverse_depth=bend)

    def at(self, raw: Array) -> tuple[Plane, Plane]:
        """Inverse depth (…) and shift (…, 2), bilinear, at raw points (rows, columns, 2) px."""
        return self.between(raw[..., 0], raw[..., 1])

    def between(self, x: NDArray[Any], y: NDArray[Any]) -> tuple[Plane, Plane]:
        """The same as `at` for x and y (rows, columns)."""
        x, y = (
            np.ascontiguousarray((at - start) / self.step, np.float32)
            for at, start in zip((x, y), self.start, strict=True)
        )
        inverse_depth = cv2.remap(self.inverse_depth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        if self.shift is None:
            return inverse_depth, np.broadcast_to(np.float32(0), (*x.shape, 2))
        return inverse_depth, cv2.remap(self.shift, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    def over(self, xs: Array, ys: Array) -> tuple[Plane, Plane]:
        """The same where evenly spaced columns xs (W,) and rows ys (H,) of raw px cross."""
        places = [(at - start) / self.step for at, start in zip((xs, ys), self.start, strict=True)]
        sides = self.inverse_depth.shape[::-1]
        if all(_whole(at, side) for at, side in zip(places, sides, strict=True)):
            (left, top), (width, height) = (int(at[0]) for at in places), (at.size for at in places)
            part = slice(top, top + height), slice(left, left + width)
            shift = np.broadcast_to(np.float32(0), (height, width, 2)) if self.shift is None else self.shift[part]
            return self.inverse_depth[part], shift
        x, y = np.meshgrid(xs.astype(np.float32), ys.astype(np.float32))
        return self.between(x, y)

    def target(self, ideal: Array) -> Array:
        """Ideal target px (…, 2), shift included, of ideal points (rows, columns, 2); NaN behind the target camera."""
        inverse_depth, shift = self.at(distort(ideal, self.camera))
        return target_points(self.two_view, ideal, inverse_depth.astype(np.float64)) + shift


@dataclass(frozen=True)
class EpipolarLines:
    """Nodes (h, w) of the reference, `step` raw px apart, each with its epipolar line in the target.

    ideal (h, w, 2): ideal px of the nodes, float64, the rest float32; inverse_depth (h, w): of the field; base
    (h, w, 2): π(H_inf p + d e') at that d; shift (h, w, 2): px to be added; direction (h, w, 2): unit vector along the
    line, towards larger d; depth_per_px (h, w): change of d that moves the target pixel by one px; w_rate (h, w): the
    relative change of x'₃ with it. NaN behind the target camera.
    """

    box: Box | tuple[float, float, float, float]
    step: float
    ideal: Array
    inverse_depth: Plane
    base: Plane
    shift: Plane
    depth_per_px: Plane
    direction: Plane
    w_rate: Plane
    camera_prime: Camera

    @staticmethod
    def over(sparse: SparseMap, box: Box | tuple[float, float, float, float], step: float) -> EpipolarLines:
        """The lines of the nodes at the centres of cells, step × step px, of a box (left, top, width, height) px."""
        rows, columns = max(1, round(box[3] / step)), max(1, round(box[2] / step))
        xs, ys = _middles(box, (rows, columns))
        ideal = np.empty((rows, columns, 2))
        ideal[..., 0], ideal[..., 1] = xs, ys[:, None]
        inverse_depth, shift = sparse.over(xs, ys)
        ideal = undistort(ideal, sparse.camera)
        depth_per_px, w_rate = np.empty((2, rows, columns), np.float32)
        base, direction = (np.moveaxis(np.empty((2, rows, columns), np.float32), 0, -1) for _ in range(2))
        H, e = sparse.two_view.H_inf, sparse.two_view.e_prime

        def fill_strip(top: int) -> None:
            part = slice(top, top + LINES.strip_rows)
            u, v, d = ideal[part, :, 0], ideal[part, :, 1], inverse_depth[part].astype(np.float64)
            ray = [H[k, 0] * u + H[k, 1] * v + (H[k, 2] + e[k] * d) for k in range(3)]
            ray[2][~ahead_of_camera(*ray)] = np.nan
            near = 1 / ray[2]
            x, y = ray[0] * near, ray[1] * near
            slope_x, slope_y = (e[0] - x * e[2]) * near, (e[1] - y * e[2]) * near
            per_px = 1 / np.maximum(np.sqrt(slope_x * slope_x + slope_y * slope_y), 1e-12)
            base[part, :, 0], base[part, :, 1] = x, y
            direction[part, :, 0], direction[part, :, 1] = slope_x * per_px, slope_y * per_px
            depth_per_px[part], w_rate[part] = per_px, e[2] * near * per_px

        each(fill_strip, range(0, rows, LINES.strip_rows))
        return EpipolarLines(
            box, step, ideal, inverse_depth, base, shift, depth_per_px, direction, w_rate, sparse.camera_prime
        )  # fmt: skip

    @property
    def shape(self) -> tuple[int, int]:
        """(h, w)."""
        return self.depth_per_px.shape[0], self.depth_per_px.shape[1]

    def at(self, field: SparseMap) -> Plane:
        """Inverse depth (h, w) of a field at the nodes."""
        return field.over(*_middles(self.box, self.shape))[0]

    @property
    def nodes(self) -> tuple[Plane, Plane]:
        """x and y (h, w) of the nodes, raw reference px."""
        xs, ys = _middles(self.box, self.shape)
        x, y = np.meshgrid(xs.astype(np.float32), ys.astype(np.float32))
        return x, y

    @cached_property
    def _start(self) -> tuple[Plane, Plane]:
        """x and y (h, w): ideal target px of nodes that are not moved."""
        return self.base[..., 0] + self.shift[..., 0], self.base[..., 1] + self.shift[..., 1]

    def target(
        self, along: Plane, across: Plane | None = None, part: slice | tuple[Places, Places] = slice(None)
    ) -> tuple[Plane, Plane]:
        """Raw target px x, y (h, w) after moves (h, w) px along and across the lines; NaN behind the target camera.

        A move t along a line changes d by t · depth_per_px and leads to base + t direction / (1 + t w_rate): t is in px
        where the line starts. part: only these rows, or only the nodes (n,) with these row and column indices.
        """
        along = along[part]
        length = along * self.w_rate[part]
        length += 1
        np.divide(along, length, out=length)
        direction = self.direction[part]
        x, y = direction[..., 0] * length, direction[..., 1] * length
        x += self._start[0][part]
        y += self._start[1][part]
        if across is not None:
            x -= across[part] * direction[..., 1]
            y += across[part] * direction[..., 0]
        if self.camera_prime.bent:
            raw = distort(np.stack([x, y], axis=-1).astype(np.float64), self.camera_prime).astype(np.float32)
            x, y = raw[..., 0], raw[..., 1]
        return x, y

    def along(self, px: Plane, part: slice = slice(None)) -> Plane:
        """The moves (h, w) that lead px (h, w) pixels along the lines: the inverse of the map in `target`; part: only
        these rows."""
        return px / (1 - px * self.w_rate[part])


def _middles(box: Box | tuple[float, float, float, float], shape: tuple[int, int]) -> tuple[Array, Array]:
    """x and y of the centres of shape (rows, columns) cells that fill a box (left, top, width, height)."""
    left, top, width, height = box
    rows, columns = shape
    xs = left + (np.arange(columns) + 0.5) * (width / columns) - 0.5
    return xs, top + (np.arange(rows) + 0.5) * (height / rows) - 0.5


def _whole(places: Array, count: int) -> bool:
    """Whether places are consecutive integers within 0 … count − 1."""
    inside = 0 <= places[0] and places[-1] <= count - 1
    return bool(inside and np.array_equal(places, int(places[0]) + np.arange(places.size)))
