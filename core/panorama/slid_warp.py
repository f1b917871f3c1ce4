"""The maps of both pictures, seen from a viewpoint that slides from the reference's place to the target's
(docs/method.md, 6).

    x ~ K (r + d s c),   x' ~ K' (R r + (1 − s) d t)

Both are images of the one point C(r) + r / d, so that every pixel lies on its epipolar line in both pictures. Where s
is 0 the reference is only turned, whatever d is; where s is 1, so is the target.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort, undistort
from ..cameras.projective import homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..field.transfer import transfer
from ..raster.arrays import Array, Plane, strips
from ..raster.grid import Grid
from ..raster.picture_map import PictureMap
from ..raster.sampling import fetch
from ..system.threads import each
from .canvas import Canvas, border, bounding_canvas
from .carried_depth import Lattice, Surface, carried_depth, refined
from .options import CANVAS, CARRY
from .projection import Projection
from .viewpoint import Viewpoint
from .warp import Warp, trimmed


def slid_warp(base: Warp, views: Sequence[View], viewpoint: Viewpoint, projection: Projection) -> Warp:
    """Lay out a canvas that holds both pictures as a sliding viewpoint sees them, and map them onto it.

    Parameters
    ----------
    base : Warp
        Of both pictures, seen from the reference's place, on a cylinder or sphere.
    views : sequence of View
        What is known of the pictures, the reference first.
    viewpoint : Viewpoint
    projection : Projection
        Of the canvas.

    Returns
    -------
    Warp
        With `slide`, `behind` and `viewpoint`; its depth is measured from the viewpoint of each pixel.

    Raises
    ------
    NoOverlap
        The target comes to lie nowhere near the reference.
    OutputTooLarge
        The canvas would have too many pixels.
    """
    surface = Surface.of(base, views)
    canvas = _canvas(surface, views, viewpoint, projection)
    lattice = Lattice((float(canvas.xs[0]), float(canvas.ys[0])), 1.0, (canvas.height, canvas.width))
    depth = carried_depth(surface, viewpoint, projection, lattice)
    depth, behind = refined(surface, viewpoint, canvas, depth)
    return trimmed(_mapped(base, surface, views, viewpoint, canvas, depth, behind))


def _mapped(
    base: Warp, surface: Surface, views: Sequence[View], viewpoint: Viewpoint, canvas: Canvas, depth: Plane,
    behind: NDArray[np.bool_],
) -> Warp:  # fmt: skip
    """The maps of all pictures on a canvas of known inverse depth (H, W); behind (H, W): what the reference cannot see.
    """
    extra = _beside_lines(base, views)
    shape = depth.shape
    maps = [PictureMap(np.empty(shape, np.float32), np.empty(shape, np.float32), view.size) for view in views]
    slide, confidence = np.empty(shape, np.float32), np.empty(shape, np.float32)
    lattice = canvas.xs, canvas.ys

    def put(rows: slice) -> None:
        d = depth[rows].astype(np.float64)
        xs, ys = lattice[0], lattice[1][rows]
        s = viewpoint.slide_of(*canvas.project_rows(viewpoint.rotation.T @ surface.to_ray, xs, ys))
        more = _carried(extra, surface, canvas, viewpoint, rows, d, s)
        for number, (view, out) in enumerate(zip(views, maps, strict=True)):
            x, y = _seen_at(view, views[0], viewpoint, canvas.project_rows(view.H_inf, xs, ys), d, s)
            if number == 1:
                x, y = x + more[..., 0], y + more[..., 1]
            out.x[rows], out.y[rows] = x, y
        slide[rows], confidence[rows] = s, more[..., 2] * ~behind[rows]

    each(put, strips(shape))
    held = None if base.lazy_confidence is None else confidence
    return Warp(canvas, tuple(maps), depth, held, slide, behind, viewpoint)


def _seen_at(
    view: View, reference: View, viewpoint: Viewpoint, infinite: list[Array], d: Array, s: Array
) -> tuple[Array, Array]:
    """Raw pixels x, y (…) of a picture where points at inverse depth d (…) from a viewpoint with slide s (…) are seen;
    infinite: see `transfer`."""
    step = view.H_inf @ reference.K @ viewpoint.c
    x, y = transfer(view, [part + (d * s) * k for part, k in zip(infinite, step, strict=True)], d)
    if not view.camera.distortion.any():
        return x, y
    raw = distort(np.stack([x, y], axis=-1), view.camera)
    return raw[..., 0], raw[..., 1]


def _beside_lines(base: Warp, views: Sequence[View]) -> NDArray[np.float32]:
    """What the base has beside d (H, W, 3): px x and y that the target's map has beyond its epipolar lines, and
    confidence."""
    canvas, target = base.canvas, base.maps[1].arrays()
    view = views[1]
    out = np.zeros((canvas.height, canvas.width, 3), np.float32)

    def put(rows: slice) -> None:
        d = base.depth[rows, 0 : canvas.width].astype(np.float64)
        infinite = canvas.project_rows(view.H_inf, canvas.xs, canvas.ys[rows])
        x, y = transfer(view, infinite, d)
        if view.camera.distortion.any():
            x, y = np.moveaxis(distort(np.stack([x, y], axis=-1), view.camera), -1, 0)
        for k, (shown, strict) in enumerate(((target.x, x), (target.y, y))):
            shift = np.nan_to_num(shown[rows] - strict)
            out[rows, :, k] = np.where(np.abs(shift) > CARRY.least_shift_px, shift, 0)
        if base.lazy_confidence is not None:
            out[rows, :, 2] = base.lazy_confidence[rows, 0 : canvas.width]

    each(put, strips(out.shape))
    return out


def _carried(
    extra: NDArray[np.float32], surface: Surface, canvas: Canvas, viewpoint: Viewpoint, rows: slice, d: Array, s: Array
) -> NDArray[np.float32]:
    """What the base has beside d (see `_beside_lines`), at the points of some rows of the canvas."""
    rays = np.stack(canvas.project_rows(surface.to_ray, canvas.xs, canvas.ys[rows]), axis=-1)
    x, y = surface.places((rays + (d * s)[..., None] * viewpoint.c).astype(np.float32))
    carried: NDArray[np.float32] = fetch(extra, x, y, cv2.INTER_LINEAR)
    return carried


def _canvas(surface: Surface, views: Sequence[View], viewpoint: Viewpoint, projection: Projection) -> Canvas:
    """The smallest canvas, to within a cell, of all that both pictures show from the viewpoint."""
    plane = Canvas(0, 0, (0, 0), projection=projection)

    def pictures_at(grid: Grid) -> list[Array]:
        xs, ys = grid.xs, grid.ys
        lattice = Lattice((float(xs[0]), float(ys[0])), float(grid.step), (grid.rows, grid.columns))
        d = carried_depth(surface, viewpoint, projection, lattice).astype(np.float64)
        s = viewpoint.slide_of(*plane.project_rows(viewpoint.rotation.T @ surface.to_ray, xs, ys))
        return [
            np.stack(_seen_at(view, views[0], viewpoint, plane.project_rows(view.H_inf, xs, ys), d, s), axis=-1)
            for view in views
        ]

    reach = _reach(surface, views, viewpoint, projection)
    # what the reference shows is looked for like the rest: only its middle is sure to be seen
    middle = (np.array(views[0].size) - 1) / 2
    left, top = (int(v) for v in np.floor(projection.of_reference(undistort(middle, views[0].camera))))
    return bounding_canvas(pictures_at, (left, top, 1, 1), [view.size for view in views], reach, projection)


def _reach(surface: Surface, views: Sequence[View], viewpoint: Viewpoint, projection: Projection) -> Array:
    """left, top, right, bottom, px of the plane, of a rectangle that holds all pictures, with a margin."""
    every = max(1, max(surface.depth.shape) // CARRY.reach_nodes)
    rows = slice(0, surface.depth.shape[0], every)
    shown = surface.shown[rows, ::every]
    x, y, z = (part[shown] for part in surface.own_rays(viewpoint, rows, every))
    moved, _ = viewpoint.shifted((x, y, z), surface.depth[rows, ::every][shown])
    # the target's own border counts too: at s = 1 the target is only turned
    target = homogeneous(undistort(border(views[1].size), views[1].camera)) @ inverse_intrinsics(views[1].K).T
    points = projection.points(np.vstack([np.stack(moved, axis=-1) @ viewpoint.rotation.T, target @ views[1].R]))
    limits = projection.limits
    points = np.clip(points[np.isfinite(points).all(axis=1)], limits[:2], limits[2:])
    margin = CANVAS.margin * max(views[0].size)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    reach: Array = np.concatenate([np.maximum(low, limits[:2]), np.minimum(high, limits[2:])])
    return reach
