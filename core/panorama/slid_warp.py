"""The maps of both pictures, seen from a viewpoint that slides from the reference's place to the target's
(docs/method.md, 6).

    x ~ K (r + d s c),   x' ~ K' (R r + (1 − s) d t)

Both are images of the one point C(r) + r / d, so that every pixel lies on its epipolar line in both pictures. Where s
is 0 the reference is only turned, whatever d is; where s is 1, so is the target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort, undistort
from ..cameras.projective import homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..field.transfer import transfer
from ..raster.arrays import Array, Plane, small_strips
from ..raster.grid import Grid
from ..raster.picture_map import PictureMap
from ..system.threads import each
from .canvas import Canvas, border, bounding_canvas
from .carried_depth import Lattice, Rays, Surface, carried_depth, looked_up, turned
from .options import CANVAS, SLIDE, UNCOVERED
from .projection import Projection, focal_of
from .viewpoint import Viewpoint
from .warp import Warp, trimmed


def slid_warp(base: Warp, views: Sequence[View], viewpoint: Viewpoint, projection: Projection) -> Warp:
    """Lay out a canvas that holds both pictures as a sliding viewpoint sees them, and map them onto it.

    Parameters
    ----------
    base : Warp
        Of both pictures, seen from the reference's place, on a cylinder or sphere. What lies beside the epipolar lines
        counts if it holds it.
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
    BadRequest
        The projection has a window that shows nothing.
    """
    surface = Surface.of(base, views)
    beside = np.zeros((*surface.depth.shape, 3), np.float32) if base.beside is None else base.beside
    canvas = _canvas(surface, views, viewpoint, projection)
    lattice = Lattice((float(canvas.xs[0]), float(canvas.ys[0])), 1.0, (canvas.height, canvas.width))
    depth = carried_depth(surface, viewpoint, projection, lattice)
    warp = _mapped(beside, surface, views, viewpoint, canvas, depth)
    return trimmed(warp if base.lazy_confidence is not None else replace(warp, lazy_confidence=None))


def _mapped(
    beside: NDArray[np.float32], surface: Surface, views: Sequence[View], viewpoint: Viewpoint, canvas: Canvas,
    depth: Plane,
) -> Warp:  # fmt: skip
    """The maps of all pictures on a canvas, by what depth (H, W) was carried to its pixels; beside: see `Warp`.

    Where the surface holds about the same at a pixel's point, what it holds takes its place, so that it is known to a
    fraction of a pixel; and everywhere that the viewpoint is the reference's place. Points of the surface are seen by
    the reference. What lies behind it there was filled in.
    """
    shape = depth.shape
    maps = [PictureMap(np.empty(shape, np.float32), np.empty(shape, np.float32), view.size) for view in views]
    slide, confidence = np.empty(shape, np.float32), np.zeros(shape, np.float32)
    behind = np.zeros(shape, np.uint8)
    to_own, c = surface.projection.rotation.T, surface.projection.rotation.T @ viewpoint.c

    def put(rows: slice) -> None:
        xs, ys = canvas.xs, canvas.ys[rows]
        rays = surface.rays(canvas, xs, ys)
        s = viewpoint.slide_of(*turned(viewpoint.rotation.T @ to_own.T, rays))
        x, y, hidden = _refined(surface, rays, s, c, depth[rows])
        more = looked_up(beside, x, y)
        d, s64 = depth[rows].astype(np.float64), s.astype(np.float64)
        for number, (view, out) in enumerate(zip(views, maps, strict=True)):
            u, v = _seen_at(view, views[0], viewpoint, canvas.project_rows(view.H_inf, xs, ys), d, s64)
            if number == 1:
                u += more[..., 0]
                v += more[..., 1]
            out.x[rows], out.y[rows] = _raw(view, u, v)
        slide[rows], behind[rows] = s, hidden
        confidence[rows] = np.where(hidden, np.float32(0), more[..., 2])

    each(put, small_strips(shape))
    unseen = cv2.morphologyEx(behind, cv2.MORPH_OPEN, np.ones((UNCOVERED.least_behind_px,) * 2, np.uint8)) > 0
    return Warp(canvas, tuple(maps), depth, confidence, slide, unseen, viewpoint)


def _refined(
    surface: Surface, rays: Rays, s: NDArray[np.float32], c: Array, d: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Where points at inverse depth d (…), written over, lie on the canvas of the surface, and whether they lie behind
    it; rays: from their viewpoints; c (3,): the target's place, both in the surface's own axes."""
    towards = [s * np.float32(part) for part in c]
    height, width = surface.depth.shape
    x, y = surface.places([ray + d * step for ray, step in zip(rays, towards, strict=True)])
    there = (x > -1) & (y > -1) & (x < width) & (y < height)
    x, y = np.clip(x, 0, width - 1), np.clip(y, 0, height - 1)
    here = looked_up(surface.depth, x, y)
    length = np.sqrt(sum((ray + d * step) ** 2 for ray, step in zip(rays, towards, strict=True)))
    # what the surface holds there, measured from the pixel's viewpoint
    away = np.sqrt(
        sum(((ray + d * step) / length - here * step) ** 2 for ray, step in zip(rays, towards, strict=True))
    )
    new = here / np.maximum(away, np.float32(SLIDE.least_range))
    focal = surface.projection.focal
    same = np.abs(new - d) < UNCOVERED.same_share * d + np.float32(UNCOVERED.same_px / focal)
    hidden = there & (new > d + UNCOVERED.behind_share * new + np.float32(UNCOVERED.behind_px / focal)) & (s > 0)
    np.copyto(d, new, where=(there & same) | (s == 0))
    return x, y, hidden


def _seen_at(
    view: View, reference: View, viewpoint: Viewpoint, infinite: list[Array], d: Array, s: Array
) -> tuple[Array, Array]:
    """Ideal pixels x, y (…) of a picture where points at inverse depth d (…) from a viewpoint with slide s (…) are
    seen; infinite: see `transfer`."""
    step = view.H_inf @ reference.K @ viewpoint.c
    moved = d * s
    return transfer(view, [part + moved * k for part, k in zip(infinite, step, strict=True)], d)


def _raw(view: View, x: Array, y: Array) -> tuple[Array, Array]:
    """Raw pixels x, y (…) of ideal ones."""
    if not view.camera.bent:
        return x, y
    raw = distort(np.stack([x, y], axis=-1), view.camera)
    return raw[..., 0], raw[..., 1]


def _canvas(surface: Surface, views: Sequence[View], viewpoint: Viewpoint, projection: Projection) -> Canvas:
    """The smallest canvas, to within a cell, of all that both pictures show from the viewpoint."""
    plane = Canvas(0, 0, (0, 0), projection=projection)

    def pictures_at(grid: Grid) -> list[Array]:
        xs, ys = grid.xs, grid.ys
        lattice = Lattice((float(xs[0]), float(ys[0])), float(grid.step), (grid.rows, grid.columns))
        carried = carried_depth(surface, viewpoint, projection, lattice)
        rays = surface.rays(plane, xs, ys)
        s = viewpoint.slide_of(*turned(viewpoint.rotation.T @ surface.projection.rotation, rays))
        c = surface.projection.rotation.T @ viewpoint.c
        _refined(surface, rays, s, c, carried)
        d, s64 = carried.astype(np.float64), s.astype(np.float64)
        infinite = [plane.project_rows(view.H_inf, xs, ys) for view in views]
        return [
            np.stack(_raw(view, *_seen_at(view, views[0], viewpoint, far, d, s64)), axis=-1)
            for view, far in zip(views, infinite, strict=True)
        ]

    reach, cropped = _reach(surface, views, viewpoint, projection)
    # what the reference shows is looked for like the rest: only its middle is sure to be seen
    middle = (np.array(views[0].size) - 1) / 2
    left, top = (int(v) for v in np.floor(projection.of_reference(undistort(middle, views[0].camera))))
    canvas = bounding_canvas(pictures_at, (left, top, 1, 1), [view.size for view in views], reach, projection)
    # nodes to both sides of an edge of depth look stretched, but are not
    return replace(canvas, cropped=cropped)


def _reach(
    surface: Surface, views: Sequence[View], viewpoint: Viewpoint, projection: Projection
) -> tuple[Array, bool]:
    """left, top, right, bottom, px of the plane, of a rectangle that holds all pictures, with a margin; and whether
    more than some specks of them lie beyond the projection's limits."""
    height, width = surface.depth.shape
    every = max(1, max(height, width) // UNCOVERED.reach_nodes)
    (x, y, z), depth = surface.points(viewpoint, slice(0, height, every), every)
    own = turned(viewpoint.rotation.T @ surface.projection.rotation, (x, y, z))
    moved, _ = viewpoint.shifted((own[0], own[1], own[2]), depth)
    # both borders count too: the reference is only turned where s is 0, and the target where it is 1
    borders = [
        homogeneous(undistort(border(view.size), view.camera)) @ inverse_intrinsics(view.K).T @ view.R
        for view in views
    ]
    points = projection.points(np.vstack([np.stack(moved, axis=-1) @ viewpoint.rotation.T, *borders]))
    limits = projection.limits
    points = points[np.isfinite(points).all(axis=1)]
    beyond = (points < limits[:2] - 1) | (points > limits[2:] + 1)
    points = np.clip(points, limits[:2], limits[2:])
    margin = CANVAS.margin * max(views[0].size) * projection.focal / focal_of(projection.K)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    reach: Array = np.concatenate([np.maximum(low, limits[:2]), np.minimum(high, limits[2:])])
    return reach, projection.cuts and float(beyond.any(axis=1).mean()) > UNCOVERED.most_beyond
