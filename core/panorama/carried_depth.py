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

from ..cameras.lens import distort
from ..cameras.projective import ahead_of_camera, inverse_intrinsics
from ..cameras.view import View
from ..field.carried_surface import filled_surface, put_nearest, sharpened
from ..raster.arrays import Array, Plane, small_strips
from ..raster.options import PARTS
from ..raster.picture_map import falls_inside
from ..raster.sampling import fetch
from ..system.threads import in_order
from .canvas import Canvas
from .projection import Projection
from .viewpoint import Viewpoint
from .warp import Warp

# three coordinates, each (…)
Rays = Sequence[NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface that both pictures show, from the reference's place, on a canvas.

    depth (H, W): d, finite and not below 0; reference: its view; seen (H, W): where the target shows it.
    """

    canvas: Canvas
    projection: Projection
    depth: Plane
    reference: View
    seen: NDArray[np.bool_]

    @staticmethod
    def of(base: Warp, views: Sequence[View]) -> Surface:
        """The surface of a warp on a cylinder or sphere that holds both pictures."""
        projection = base.canvas.projection
        if projection is None:
            raise ValueError("the surface is carried over from a cylinder or sphere")
        depth = np.maximum(np.nan_to_num(base.inverse_depth), np.float32(0))
        return Surface(base.canvas, projection, sharpened(depth, projection.focal), views[0], base.maps[1].inside())

    def places(self, own: Rays) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Where rays (…) of the reference's place, in the projection's axes, meet the canvas, px x and y (…)."""
        x, y = self.projection.points_of(*(part.astype(np.float32, copy=False) for part in own))
        return x + np.float32(self.canvas.offset[0]), y + np.float32(self.canvas.offset[1])

    def rays(self, canvas: Canvas, xs: Array, ys: Array) -> list[NDArray[np.float32]]:
        """Unit rays (three arrays), in the projection's axes, of columns and lines of a canvas, px of its plane."""
        matrix = self.projection.rotation.T @ inverse_intrinsics(self.reference.K)
        return [part.astype(np.float32) for part in canvas.project_rows(matrix, xs, ys)]

    def points(self, viewpoint: Viewpoint, rows: slice, every: int) -> tuple[list[NDArray[np.float32]], Plane]:
        """Points q / d (three arrays (N,), in the projection's axes, and d (N,)) of some rows, every so many px, that
        a picture shows and that the viewpoint does not see from the reference's place."""
        own = self.rays(self.canvas, self.canvas.xs[::every], self.canvas.ys[rows])
        slides = viewpoint.slide_of(*turned(viewpoint.rotation.T @ self.projection.rotation, own)) > 0
        own = [part[slides] for part in own]
        x, y, ahead = turned(self.reference.K @ self.projection.rotation, own)
        camera = self.reference.camera
        with np.errstate(divide="ignore", invalid="ignore"):
            ideal = np.stack([x / ahead, y / ahead], axis=-1)
        raw = distort(ideal, camera) if camera.bent else ideal
        shown = (ahead_of_camera(x, y, ahead) & falls_inside(raw[:, 0], raw[:, 1], camera.size))
        shown |= self.seen[rows, ::every][slides]
        return [part[shown] for part in own], self.depth[rows, ::every][slides][shown]


@dataclass(frozen=True)
class Lattice:
    """Columns and lines of a plane: first (x, y) px, px between them, and (H, W) how many."""

    start: tuple[float, float]
    step: float
    shape: tuple[int, int]


def turned(matrix: Array, rays: Rays) -> list[NDArray[Any]]:
    """A matrix (3, 3) times rays (three arrays), of their precision."""
    kind = rays[0].dtype.type
    x, y, z = rays
    return [kind(a) * x + kind(b) * y + kind(c) * z for a, b, c in matrix]


def looked_up(values: NDArray[np.float32], x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (H, W[, C]) at places x, y (h, w) px, bilinear; 0 outside."""
    if max(values.shape[:2]) <= PARTS.max_remap_side:
        found: NDArray[np.float32] = cv2.remap(values, x, y, cv2.INTER_LINEAR)
        return found
    found = fetch(values.reshape(*values.shape[:2], -1), x, y, cv2.INTER_LINEAR)
    return found.reshape(*x.shape, *values.shape[2:])


def carried_depth(surface: Surface, viewpoint: Viewpoint, projection: Projection, lattice: Lattice) -> Plane:
    """The inverse depth that is seen from a sliding viewpoint, where that is not the reference's place.

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

    height, width = surface.depth.shape
    parts = (
        slice(part.start * every, min(height, part.stop * every), every)
        for part in small_strips((-(-height // every), -(-width // every)))
    )
    for cells, d in in_order(appear, parts):
        put_nearest(nearest, cells, d)
    return filled_surface(nearest)


def _places_of(
    surface: Surface, viewpoint: Viewpoint, projection: Projection, lattice: Lattice, rows: slice, every: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The cells (N,) of the lattice on which points of some rows of a surface fall, and their inverse depth (N,)."""
    (x, y, z), depth = surface.points(viewpoint, rows, every)
    own = turned(viewpoint.rotation.T @ surface.projection.rotation, (x, y, z))
    moved, length = viewpoint.shifted((own[0], own[1], own[2]), depth)
    points = projection.points_of(*turned(projection.rotation.T @ viewpoint.rotation, moved))
    height, width = lattice.shape
    with np.errstate(invalid="ignore"):
        column, row = (
            np.floor((values - np.float32(start)) / np.float32(lattice.step))
            for values, start in zip(points, lattice.start, strict=True)
        )
        there = (column >= -1) & (row >= -1) & (column < width) & (row < height)
    # a point covers the four cells around it: the one above and left of it stands for them (see `filled_surface`)
    column, row = (np.maximum(values[there], 0).astype(np.intp) for values in (column, row))
    return row * width + column, (depth / length)[there]
