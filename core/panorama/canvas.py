"""The canvas: the part of a plane that the panorama covers, and where the pictures lie in it.

The plane is the reference's own, so that the reference is pasted exactly, or that of a round panorama (see
`projection`). Canvas pixels are pixels of the plane shifted by whole numbers.
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
from .projection import Projection, extent, focal_of


@dataclass(frozen=True)
class Canvas:
    """A canvas.

    Attributes
    ----------
    width, height : int
        px.
    offset : (int, int)
        Canvas pixel (x, y) of the plane's pixel (0, 0), which is the reference's first in a flat panorama.
    cropped : bool
        Part of the pictures lies beyond the canvas.
    projection : Projection or None
        Of a round panorama; None for a flat one.
    step : int
        px of the plane from one pixel to the next, of a canvas that is looked at more coarsely than it is shown.
    """

    width: int
    height: int
    offset: tuple[int, int]
    cropped: bool = False
    projection: Projection | None = None
    step: int = 1

    @property
    def xs(self) -> Array:
        """x of the columns, px of the plane."""
        return np.arange(self.width, dtype=np.float64) * self.step - self.offset[0]

    @property
    def ys(self) -> Array:
        """y of the lines, px of the plane."""
        return np.arange(self.height, dtype=np.float64) * self.step - self.offset[1]

    @property
    def whole(self) -> Box:
        """The whole panorama in canvas px: the canvas itself, but in a spherical panorama the whole sphere."""
        sphere = None if self.projection is None else self.projection.sphere
        if sphere is None:
            return 0, 0, self.width, self.height
        return sphere[0] + self.offset[0], sphere[1] + self.offset[1], sphere[2], sphere[3]

    def within(self, box: Box) -> Canvas:
        """The part of the canvas in a box (left, top, width, height) of it."""
        left, top, width, height = box
        return replace(self, width=width, height=height, offset=(self.offset[0] - left, self.offset[1] - top))

    def enlarged(self, times: int, K: Array) -> Canvas:
        """The same of a round panorama with so many times as many px a side; K (3, 3): of the reference, enlarged."""
        if self.projection is None:
            raise ValueError("the plane of a picture has the size of that picture")
        width, height, x, y = (times * side for side in (self.width, self.height, *self.offset))
        return replace(self, width=width, height=height, offset=(x, y), projection=self.projection.enlarged(times, K))

    def of_reference(self, points: Array, camera: Camera | None = None) -> Array:
        """Canvas px (…, 2) of raw pixels (…, 2) of the reference; camera: the reference's, if its lens matters."""
        if self.projection is not None:
            points = self.projection.of_reference(points if camera is None else undistort(points, camera))
        return points + np.array(self.offset, np.float64)

    def project_rows(self, rows: Array, xs: Array, ys: Array, camera: Camera | None = None) -> list[Array]:
        """Multiply the rows of a matrix by all canvas points p of some columns and lines.

        p is the homogeneous ideal pixel of the reference, with p_3 = 1 in a flat panorama and |K⁻¹ p| = 1 in a round
        one (docs/method.md, 6). Points ahead of the reference camera have p_3 > 0.

        Parameters
        ----------
        rows : (k, 3) array
        xs, ys : (w,) and (h,) arrays
            Columns and lines, px of the plane.
        camera : Camera, optional
            The reference's, if its lens matters.

        Returns
        -------
        list of k (h, w) arrays
        """
        if self.projection is not None:
            return self.projection.project_rows(rows, xs, ys)
        if camera is not None and camera.bent:
            raw = np.stack(np.broadcast_arrays(xs[None, :], ys[:, None]), axis=-1)
            return list(np.moveaxis(homogeneous(undistort(raw, camera)) @ rows.T, -1, 0))
        return [(row[0] * xs)[None, :] + (row[1] * ys[:, None] + row[2]) for row in rows]

    def rays_at(self, K: Array, xs: Array, ys: Array, camera: Camera | None = None) -> tuple[Array, Array]:
        """Unit rays (len(ys), len(xs), 3) in the reference's frame at columns xs and lines ys in px of the plane, and
        the lengths of K⁻¹ p there; K (3, 3): of the reference; camera: see `project_rows`."""
        rays = np.stack(self.project_rows(inverse_intrinsics(K), xs, ys, camera), axis=-1)
        length = np.linalg.norm(rays, axis=-1)
        return rays / length[..., None], length

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
    """The smallest canvas, to within a cell, of the reference and every part of the others that is not overstretched.

    Parameters
    ----------
    pictures_at : callable
        Gives, for a grid over the plane, where each further picture is seen: (rows, columns, 2) px, NaN behind its
        camera.
    reference : Box
        Where the reference lies, px of the plane.
    sizes : sequence of (int, int)
        (W, H) px of the further pictures.
    reach : (4,) array
        left, top, right, bottom, px of the plane, that is searched (see `expected_reach`).
    projection : Projection, optional
        Of a round panorama.

    Returns
    -------
    Canvas

    Raises
    ------
    OutputTooLarge
        It would have more than `CanvasOptions.max_pixels`.
    """
    left, top, right, bottom = reach
    limits = np.array([-np.inf, -np.inf, np.inf, np.inf]) if projection is None else projection.limits
    max_stretch = CANVAS.max_stretch
    if projection is not None:  # nothing stretches without end on a sphere
        max_stretch = np.inf if projection.sphere else max_stretch * projection.focal / focal_of(projection.K)
    cropped = False
    for _ in range(2):  # the second pass has a finer grid over what the first found
        width, height = max(1, int(right - left)), max(1, int(bottom - top))
        grid = Grid.over(int(left), int(top), width, height, nodes=CANVAS.search_nodes)
        useful, any_stretched = np.zeros((grid.rows, grid.columns), bool), False
        for places, size in zip(pictures_at(grid), sizes, strict=True):
            shown = falls_inside(places[..., 0], places[..., 1], size)
            stretched = shown & (_area_ratio(places, grid.step) < 1 / max_stretch**2)
            useful |= shown & ~stretched
            any_stretched |= bool(stretched.any())
        new = np.array([reference[0], reference[1], reference[0] + reference[2], reference[1] + reference[3]])
        if useful.any():
            rows, columns = np.flatnonzero(useful.any(axis=1)), np.flatnonzero(useful.any(axis=0))
            xs, ys, margin = grid.xs, grid.ys, grid.step
            # the picture ends somewhere between its last node and the next
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
    """Where to look for the pictures in a flat panorama.

    Parameters
    ----------
    outlines : sequence of (N, 2) arrays
        Of the further pictures, px of the reference's plane, NaN behind the reference camera.
    size : (int, int)
        (W, H) px of the reference.
    sizes : sequence of (int, int)
        The same of the further pictures.

    Returns
    -------
    (4,) array
        left, top, right, bottom of a bounded rectangle that holds the reference and the outlines.
    bool
        Whether the outlines reach beyond its bounds.
    """
    points = np.concatenate(outlines)
    width, height = size
    far = CANVAS.max_reach * max(max(one) for one in (size, *sizes))
    finite = points[np.isfinite(points).all(axis=1)]
    cut = len(finite) < len(points)
    lowest = np.array([0.0, 0.0])
    highest = np.array([width, height], np.float64)
    if cut:  # an outline runs to infinity: look everywhere within reach
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
    projection: Projection, outlines: Sequence[Array], shows: Sequence[Callable[[Array], bool]], camera: Camera
) -> tuple[Box, Array, bool]:
    """Where to look for the pictures in a round panorama.

    Parameters
    ----------
    projection : Projection
    outlines : sequence of (N, 3) arrays
        Of all pictures, the reference's first: canvas points p in order.
    shows : sequence of callables
        For each, whether it shows a canvas point (3,).
    camera : Camera
        The reference's.

    Returns
    -------
    Box
        Where the reference lies, px of the plane.
    (4,) array
        left, top, right, bottom of a rectangle that holds all pictures, with a margin.
    bool
        Whether they reach beyond the projection's limits.
    """
    to_ray = inverse_intrinsics(projection.K)

    def on_ray(shown: Callable[[Array], bool]) -> Callable[[Array], bool]:
        return lambda ray: shown(projection.K @ ray)

    extents = [
        extent(projection, outline @ to_ray.T, on_ray(shown)) for outline, shown in zip(outlines, shows, strict=True)
    ]
    limits = projection.limits
    margin = CANVAS.margin * max(camera.size) * projection.focal / focal_of(projection.K)
    low, high = np.min(extents, axis=0)[:2], np.max(extents, axis=0)[2:]
    cut = projection.cuts and bool((low < limits[:2]).any() or (high > limits[2:]).any())
    reach = np.clip(np.concatenate([low - margin, high + margin]), np.tile(limits[:2], 2), np.tile(limits[2:], 2))
    left, top = np.floor(np.clip(extents[0][:2], limits[:2], limits[2:] - 1)).astype(int)
    right, bottom = np.ceil(np.clip(extents[0][2:], limits[:2], limits[2:] - 1)).astype(int) + 1
    return (int(left), int(top), int(right - left), int(bottom - top)), reach, cut


def shown_by(matrix: Array, camera: Camera) -> Callable[[Array], bool]:
    """Whether a picture shows a canvas point (3,), which matrix (3, 3) maps to its ideal px."""

    def shown(point: Array) -> bool:
        x, y = _raw(matrix @ point, camera)
        return bool(falls_inside(x, y, camera.size))

    return shown


def border(size: tuple[int, int]) -> Array:
    """Points (N, 2) along the border of a picture of (W, H) px, in order."""
    width, height = size
    u = np.linspace(0, 1, CANVAS.outline_points, endpoint=False)
    around = [np.column_stack(p) for p in ((u, 0 * u), (0 * u + 1, u), (1 - u, 0 * u + 1), (0 * u, 1 - u))]
    points: Array = np.concatenate(around) * np.array([width - 1.0, height - 1.0])
    return points


def _raw(point: Array, camera: Camera) -> Array:
    """The raw pixel (2,) of a canvas point's image p (3,), NaN behind the camera."""
    return distort(point[:2] / point[2], camera) if ahead_of_camera(*point) else np.full(2, np.nan)


def _union(box: Array, reference: Box, limits: Array) -> tuple[int, int, int, int]:
    """left, top, right, bottom, within limits, of what holds the reference and a box (left, top, right, bottom)."""
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
