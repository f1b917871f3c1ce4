"""The plane the panorama lives in: its size and where the reference lies in it; grids of nodes over it.

Canvas pixels are pixels of that plane moved by whole numbers. The plane is the reference's own, so that the reference
is pasted exactly, or that of a round panorama (see `projection`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..cameras.camera import Camera
from ..cameras.lens import distort, undistort
from ..cameras.projective import ahead_of_camera, homogeneous, inverse_intrinsics
from ..raster.arrays import Array, Box
from ..raster.grid import Grid
from ..raster.picture_map import falls_inside
from ..system.errors import OutputTooLarge
from .options import CANVAS
from .projection import Projection, extent


@dataclass(frozen=True)
class Canvas:
    """width, height px; offset: canvas pixel (x, y) of the plane's pixel (0, 0), in a flat panorama the reference's;
    cropped: part of the pictures runs off the canvas; projection: of a round panorama, None for a flat one."""

    width: int
    height: int
    offset: tuple[int, int]
    cropped: bool = False
    projection: Projection | None = None

    @property
    def xs(self) -> Array:
        """x of the columns, px of the plane."""
        return np.arange(-self.offset[0], self.width - self.offset[0], dtype=np.float64)

    @property
    def ys(self) -> Array:
        """y of the lines, px of the plane."""
        return np.arange(-self.offset[1], self.height - self.offset[1], dtype=np.float64)

    @property
    def whole(self) -> Box:
        """The whole panorama in px of the canvas: itself, but of a sphere all of it."""
        sphere = None if self.projection is None else self.projection.sphere
        if sphere is None:
            return 0, 0, self.width, self.height
        return sphere[0] + self.offset[0], sphere[1] + self.offset[1], sphere[2], sphere[3]

    def within(self, box: Box) -> Canvas:
        """The canvas of a box (left, top, width, height) of it."""
        left, top, width, height = box
        return replace(self, width=width, height=height, offset=(self.offset[0] - left, self.offset[1] - top))

    def of_reference(self, points: Array, camera: Camera | None = None) -> Array:
        """Canvas px (…, 2) of raw pixels (…, 2) of the reference; camera: its, if its lens matters."""
        if self.projection is not None:
            points = self.projection.of_reference(points if camera is None else undistort(points, camera))
        return points + np.array(self.offset, np.float64)

    def project_rows(self, rows: Array, xs: Array, ys: Array, camera: Camera | None = None) -> list[Array]:
        """rows (k, 3) times canvas points p, each (len(ys), len(xs)), for columns xs and lines ys in px of the plane.
        camera: the reference's, if its lens matters.

        p is the homogeneous ideal pixel of the reference, with p_3 = 1 in a flat panorama and |K⁻¹ p| = 1 in a round
        one (see `projection`): what lies ahead of the reference camera has p_3 > 0.
        """
        if self.projection is not None:
            return self.projection.project_rows(rows, xs, ys)
        if camera is not None and camera.distortion.any():
            raw = np.stack(np.broadcast_arrays(xs[None, :], ys[:, None]), axis=-1)
            return list(np.moveaxis(homogeneous(undistort(raw, camera)) @ rows.T, -1, 0))
        return [(row[0] * xs)[None, :] + (row[1] * ys[:, None] + row[2]) for row in rows]

    def on_reference(self, xs: Array, ys: Array, camera: Camera | None = None) -> tuple[Array, Array]:
        """Raw pixels (len(ys), len(xs), 2) of the reference at columns xs and lines ys in px of the plane, NaN behind
        its camera; and p_3 there."""
        a, b, c = self.project_rows(np.eye(3), xs, ys, camera)
        c = np.where(ahead_of_camera(a, b, c), c, np.nan)
        ideal = np.stack([a / c, b / c], axis=-1)
        return ideal if camera is None else distort(ideal, camera), c


def bounding_canvas(
    pictures_at: Callable[[Grid], Sequence[Array]], reference: Box, sizes: Sequence[tuple[int, int]], reach: Array,
    projection: Projection | None = None,
) -> Canvas:  # fmt: skip
    """A canvas, small to within a cell, that holds the reference and every well-behaved part of the further pictures.

    pictures_at(grid) gives for each of these its pixels (rows, columns, 2), NaN behind its camera; reference: where the
    reference lies, sizes: (W, H) of the further pictures, reach (4,): left, top, right, bottom that they are expected
    to reach (see `expected_reach`), all in px of the plane. Raises OutputTooLarge.
    """
    left, top, right, bottom = reach
    limits = np.array([-np.inf, -np.inf, np.inf, np.inf]) if projection is None else projection.limits
    # a sphere has no far side that grows without end
    max_stretch = np.inf if projection is not None and projection.sphere else CANVAS.max_stretch
    cropped = False
    for _ in range(2):  # the second pass looks closer at what the first found
        width, height = max(1, int(right - left)), max(1, int(bottom - top))
        grid = Grid.over(int(left), int(top), width, height, nodes=CANVAS.search_nodes)
        useful, any_stretched = np.zeros((grid.rows, grid.columns), bool), False
        for places, size in zip(pictures_at(grid), sizes, strict=True):
            seen = falls_inside(places[..., 0], places[..., 1], size)
            stretched = seen & (_area_ratio(places, grid.step) < 1 / max_stretch**2)
            useful |= seen & ~stretched
            any_stretched |= bool(stretched.any())
        new = np.array([reference[0], reference[1], reference[0] + reference[2], reference[1] + reference[3]])
        if useful.any():
            rows, columns = np.flatnonzero(useful.any(axis=1)), np.flatnonzero(useful.any(axis=0))
            xs, ys, margin = grid.xs, grid.ys, grid.step
            # a node sees its own cell; the picture's edge lies between it and its neighbour
            new = np.array(
                [xs[columns[0]] - margin, ys[rows[0]] - margin, xs[columns[-1]] + margin, ys[rows[-1]] + margin]
            )
        left, top, right, bottom = _union(new, reference, limits)
        cropped = cropped or any_stretched
    canvas = Canvas(right - left, bottom - top, (-left, -top), cropped, projection)
    _, _, width, height = canvas.whole
    if width * height > CANVAS.max_pixels:
        raise OutputTooLarge(
            f"the panorama would have {width}×{height} pixels, {CANVAS.max_pixels // 1_000_000} million at most: "
            "use smaller pictures, or --scale"
        )
    return canvas


def expected_reach(
    outlines: Sequence[Array], size: tuple[int, int], sizes: Sequence[tuple[int, int]]
) -> tuple[Array, bool]:
    """A rectangle (left, top, right, bottom) that holds the reference and the further pictures' outlines, bounded; and
    whether it was cut.

    outlines, each (N, 2): in the reference's plane, NaN where they lie behind the reference camera; size, sizes: (W, H)
    of the reference and of the others.
    """
    points = np.concatenate(outlines)
    width, height = size
    far = CANVAS.max_reach * max(max(one) for one in (size, *sizes))
    finite = points[np.isfinite(points).all(axis=1)]
    cut = len(finite) < len(points)
    lowest = np.array([0.0, 0.0])
    highest = np.array([width, height], np.float64)
    if cut:  # the outline runs to infinity somewhere: look everywhere within reach
        lowest, highest = lowest - far, highest + far
    elif len(finite):
        margin = CANVAS.margin * max(width, height)
        lowest, highest = (
            np.minimum(lowest, finite.min(axis=0) - margin),
            np.maximum(highest, finite.max(axis=0) + margin),
        )
    limit_low, limit_high = np.array([-far, -far]), np.array([width + far, height + far])
    cut = cut or bool((lowest < limit_low).any() or (highest > limit_high).any())
    return np.concatenate([np.maximum(lowest, limit_low), np.minimum(highest, limit_high)]), cut


def round_reach(
    projection: Projection, planes: Sequence[Array], outlines: Sequence[Array], cameras: Sequence[Camera]
) -> tuple[Box, Array, bool]:
    """Where a round panorama's plane holds the reference, and all pictures (left, top, right, bottom), with a margin;
    and whether it cuts them.

    planes (3, 3): from the reference to each further picture by a plane; outlines (N, 3): of these, as canvas points p
    by it; cameras: of all pictures, the reference's first.
    """
    to_ray = inverse_intrinsics(projection.K)

    def shows(matrix: Array, picture: Camera) -> Callable[[Array], bool]:
        def shown(ray: Array) -> bool:
            x, y = _raw(matrix @ projection.K @ ray, picture)
            return bool(falls_inside(x, y, picture.size))

        return shown

    own = homogeneous(undistort(border(cameras[0].size), cameras[0]))
    extents = [
        extent(projection, outline @ to_ray.T, shows(matrix, picture))
        for outline, matrix, picture in zip((own, *outlines), (np.eye(3), *planes), cameras, strict=True)
    ]
    limits = projection.limits
    margin = CANVAS.margin * max(cameras[0].size)
    low, high = np.min(extents, axis=0)[:2], np.max(extents, axis=0)[2:]
    cut = projection.sphere is None and bool((low < limits[:2]).any() or (high > limits[2:]).any())
    reach = np.concatenate([np.maximum(low - margin, limits[:2]), np.minimum(high + margin, limits[2:])])
    left, top = np.floor(np.maximum(extents[0][:2], limits[:2])).astype(int)
    right, bottom = np.ceil(np.minimum(extents[0][2:], limits[2:])).astype(int) + 1
    return (int(left), int(top), int(right - left), int(bottom - top)), reach, cut


def border(size: tuple[int, int]) -> Array:
    """Points (N, 2) all around a picture of (W, H) px, in order."""
    width, height = size
    u = np.linspace(0, 1, CANVAS.outline_points, endpoint=False)
    around = [np.column_stack(p) for p in ((u, 0 * u), (0 * u + 1, u), (1 - u, 0 * u + 1), (0 * u, 1 - u))]
    points: Array = np.concatenate(around) * np.array([width - 1.0, height - 1.0])
    return points


def _raw(point: Array, camera: Camera) -> Array:
    """The raw pixel (2,) of a canvas point's image p (3,), NaN behind the camera."""
    return distort(point[:2] / point[2], camera) if ahead_of_camera(*point) else np.full(2, np.nan)


def _union(box: Array, reference: Box, limits: Array) -> tuple[int, int, int, int]:
    """left, top, right, bottom of what holds both a box given so and the reference, as far as the plane goes."""
    left, top, width, height = reference
    low = np.maximum(np.minimum([left, top], np.floor(box[:2])), limits[:2])
    high = np.minimum(np.maximum([left + width, top + height], np.ceil(box[2:]) + 1), limits[2:])
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _area_ratio(places: Array, step: int) -> Array:
    """Picture pixels per canvas pixel, from differences between nodes."""
    dx, dy = np.gradient(places, step, axis=1), np.gradient(places, step, axis=0)
    with np.errstate(invalid="ignore"):
        ratio: Array = np.nan_to_num(np.abs(dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]), nan=np.inf)
    return ratio
