"""Inverse depth carried from the reference's place to a sliding viewpoint (docs/method.md, 6).

Every point of the surface that is known from the reference's place is put where it appears from the sliding viewpoint.
Of several on one pixel the nearest is seen; what none falls on is taken to lie as far as its farthest neighbour. To
look up where a pixel comes from, again and again, would be simpler, but tears at the edges of near things.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.projective import inverse_intrinsics
from ..cameras.view import View
from ..raster.arrays import Array, Plane, strips
from ..raster.pull_push import filled
from ..raster.sampling import fetch
from ..system.threads import each, in_order
from .canvas import Canvas
from .options import CARRY, SLIDE
from .projection import Projection
from .viewpoint import Viewpoint
from .warp import Warp

# three coordinates, each (…)
Rays = Sequence[NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface that both pictures show, from the reference's place, on a canvas.

    depth (H, W): d, finite and not below 0; shown (H, W): where a picture shows it; to_ray (3, 3): K⁻¹ of the
    reference.
    """

    canvas: Canvas
    projection: Projection
    depth: Plane
    shown: NDArray[np.bool_]
    to_ray: Array

    @staticmethod
    def of(base: Warp, views: Sequence[View]) -> Surface:
        """The surface of a warp on a cylinder or sphere that holds both pictures."""
        if base.canvas.projection is None:
            raise ValueError("the surface is carried over from a cylinder or sphere")
        shown = np.logical_or.reduce([one.inside() for one in base.maps])
        depth = np.maximum(np.nan_to_num(base.inverse_depth), np.float32(0))
        to_ray = inverse_intrinsics(views[0].K)
        return Surface(base.canvas, base.canvas.projection, _sharpened(depth, base.canvas.projection), shown, to_ray)

    def places(self, rays: NDArray[Any]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Where rays (…, 3) of the reference's place meet the canvas, px x and y (…)."""
        x, y = np.moveaxis(self.projection.points(rays), -1, 0)
        return (x + self.canvas.offset[0]).astype(np.float32), (y + self.canvas.offset[1]).astype(np.float32)

    def own_rays(self, viewpoint: Viewpoint, rows: slice, step: int) -> list[NDArray[np.float32]]:
        """Unit rays (three arrays) in the viewpoint's axes of some rows, every `step`-th pixel of them."""
        matrix = viewpoint.rotation.T @ self.to_ray
        xs, ys = self.canvas.xs[::step], self.canvas.ys[rows]
        return [part.astype(np.float32) for part in self.canvas.project_rows(matrix, xs, ys)]


@dataclass(frozen=True)
class Lattice:
    """Columns and lines of a plane: first (x, y) px, px between them, and (H, W) how many."""

    start: tuple[float, float]
    step: float
    shape: tuple[int, int]


def carried_depth(surface: Surface, viewpoint: Viewpoint, projection: Projection, lattice: Lattice) -> Plane:
    """The inverse depth that is seen from a sliding viewpoint.

    Parameters
    ----------
    surface : Surface
    viewpoint : Viewpoint
    projection : Projection
        Of the plane in which the lattice lies.
    lattice : Lattice

    Returns
    -------
    (H, W) float32
        Inverse depth along each ray from its viewpoint, known everywhere.
    """
    every = max(1, int(lattice.step * surface.projection.focal / projection.focal))
    nearest = np.full(lattice.shape, -1, np.float32)

    def appear(rows: slice) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        return _places_of(surface, viewpoint, projection, lattice, rows, every)

    lines = range(0, surface.depth.shape[0], every)
    parts = (slice(lines[part][0], lines[part][-1] + 1, every) for part in strips((len(lines), surface.depth.shape[1])))
    flat = nearest.ravel()
    for cells, d in in_order(appear, parts):
        # of equal indices NumPy keeps the last, so that what is nearer than that has another try
        nearer = np.flatnonzero(d > flat[cells])
        while nearer.size:
            flat[cells[nearer]] = d[nearer]
            nearer = nearer[d[nearer] > flat[cells[nearer]]]
    return _filled(nearest)


def _places_of(
    surface: Surface, viewpoint: Viewpoint, projection: Projection, lattice: Lattice, rows: slice, every: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The cells (N,) of the lattice on which points of some rows of a surface fall, and their inverse depth (N,)."""
    own = surface.own_rays(viewpoint, rows, every)
    depth, shown = (values[rows, ::every] for values in (surface.depth, surface.shown))
    x, y, z = (part[shown] for part in own)
    moved, length = viewpoint.shifted((x, y, z), depth[shown])
    d = depth[shown] / length
    points = projection.points(np.stack(moved, axis=-1) @ viewpoint.rotation.T.astype(np.float32))
    height, width = lattice.shape
    column, row = (np.floor((points[:, k] - lattice.start[k]) / lattice.step) for k in (0, 1))
    there = (column >= -1) & (row >= -1) & (column < width) & (row < height)
    # a point covers the four cells around it: the one above and left of it stands for them (see `_filled`)
    cells = np.maximum(row[there], 0).astype(np.intp) * width + np.maximum(column[there], 0).astype(np.intp)
    return cells, d[there]


def _filled(nearest: Plane) -> Plane:
    """Inverse depth (H, W) everywhere, from that of points by the cell above and left of each, -1 where none is.

    Gaps in what is near are closed by it, though something farther shows through; other gaps go on from their farthest
    neighbours, and what lies beyond all of them from a mean of what is around.
    """
    square = np.ones((2, 2), np.uint8)
    out: Plane = cv2.dilate(nearest, square, anchor=(1, 1))
    out = cv2.medianBlur(out, CARRY.speck_px)
    return _from_far(out, CARRY.halvings)


def _from_far(values: Plane, halvings: int) -> Plane:
    """Values (H, W), those below 0 replaced by the least around them: near ones first, then by ever coarser cells."""
    missing = values < 0
    if not missing.any():
        return values
    beyond = np.finfo(np.float32).max  # what OpenCV takes for the border too
    out = np.where(missing, beyond, values)
    for _ in range(CARRY.rounds):
        grown = cv2.erode(out, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
        np.copyto(out, grown, where=missing)
        missing = out == beyond
        if not missing.any():
            return out
    if halvings:
        height, width = (side + side % 2 for side in out.shape)
        padded = np.pad(out, ((0, height - out.shape[0]), (0, width - out.shape[1])), constant_values=beyond)
        coarse = padded.reshape(height // 2, 2, width // 2, 2).min(axis=(1, 3))
        coarse = _from_far(np.where(coarse == beyond, np.float32(-1), coarse), halvings - 1)
        rest = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)[: out.shape[0], : out.shape[1]]
    else:
        rest = filled(np.where(missing, np.float32(0), out)[..., None], ~missing)[..., 0]
    np.copyto(out, rest, where=missing)
    return out


def _sharpened(depth: Plane, projection: Projection) -> Plane:
    """Inverse depth (H, W) without what is in between at jumps: it belongs to neither surface, and would be seen
    between them as specks."""
    square = np.ones((3, 3), np.uint8)
    for _ in range(CARRY.sharpenings):
        near, far = cv2.dilate(depth, square), cv2.erode(depth, square)
        jumps = near - far > np.float32(CARRY.jump_px / projection.focal) + np.float32(CARRY.jump_share) * near
        depth = np.where(jumps, np.where(2 * depth > near + far, near, far), depth)
    return depth


def refined(
    surface: Surface, viewpoint: Viewpoint, canvas: Canvas, depth: Plane
) -> tuple[Plane, NDArray[np.bool_]]:
    """What was carried to the pixels of a canvas, to a fraction of a pixel; and what of it the reference cannot see.

    Where the surface holds about the same at a pixel's point, what it holds takes its place; and everywhere that the
    viewpoint is the reference's place. Points of the surface are seen by the reference. What lies behind it there was
    filled in.

    Parameters
    ----------
    surface : Surface
    viewpoint : Viewpoint
    canvas : Canvas
    depth : (H, W) float32
        See `carried_depth`; written over.

    Returns
    -------
    (H, W) float32
        Inverse depth.
    (H, W) bool
        What lies behind the surface, as the reference sees it.
    """
    projection = surface.projection if canvas.projection is None else canvas.projection
    height, width = surface.depth.shape
    c = viewpoint.c.astype(np.float32)
    behind = np.zeros(depth.shape, np.uint8)

    def put(rows: slice) -> None:
        rays = np.stack(canvas.project_rows(surface.to_ray, canvas.xs, canvas.ys[rows]), axis=-1).astype(np.float32)
        slide = viewpoint.slide_at(rays)
        d = depth[rows]
        for _ in range(CARRY.refinements):
            point = rays + (d * slide)[..., None] * c
            x, y = surface.places(point)
            here = fetch(surface.depth[..., None], x, y, cv2.INTER_LINEAR)[..., 0]
            point /= np.linalg.norm(point, axis=-1, keepdims=True)
            point -= (here * slide)[..., None] * c
            new = here / np.maximum(np.linalg.norm(point, axis=-1), np.float32(SLIDE.least_range))
            there = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
            same = np.abs(new - d) < CARRY.same_share * d + np.float32(CARRY.same_px / projection.focal)
            np.copyto(d, new, where=there & (same | (slide == 0)))
            behind[rows] = there & (new > d + CARRY.behind_share * new + np.float32(CARRY.behind_px / projection.focal))

    each(put, strips(depth.shape))
    # single pixels are rounding at the edges of near things
    return depth, cv2.morphologyEx(behind, cv2.MORPH_OPEN, np.ones((CARRY.speck_px,) * 2, np.uint8)) > 0
