"""The maps of N pictures, from one field of inverse range on the sphere (docs/method.md, 6).

As in `warp`, only d and slack are interpolated between the nodes of a grid, and H_inf p + d e' is evaluated at every
pixel. A picture's map is known in the box of the canvas that shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort, undistort
from ..cameras.projective import ahead_of_camera, homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..field.refined_sphere import RefinedSphere
from ..field.sphere_field import SphereField
from ..raster.arrays import Array, Box, Part, small_strips
from ..raster.grid import Grid
from ..raster.lazy import AnyImage
from ..raster.picture_map import BoxedMap, CanvasMap, MapPart, PictureMap, falls_inside
from ..system.progress import Tick, unwatched
from ..system.threads import in_order
from .canvas import Canvas, border, bounding_canvas, expected_reach, round_reach
from .carried_sphere import carried_sphere
from .depth import AtNodes, OfSphere
from .projection import Projection
from .reference_map import ReferenceMap
from .rig_options import RIG_WARP
from .rig_viewpoint import CarriedDepth, RigViewpoint
from .warp import Warp, in_plane, raw_pixels, trimmed


@dataclass(frozen=True, eq=False)
class RigSurface:
    """A field on the sphere as its pictures see it, from one place or from where a viewpoint slides to.

    outlines: of each picture unit rays (N, 3) from the first picture's place to what it shows along its border, in
    order; viewpoint: None if all is seen from that place; refined: what dense refinement found from that place, None
    without it.
    """

    field: SphereField
    views: Sequence[View]
    outlines: tuple[Array, ...]
    viewpoint: RigViewpoint | None = None
    refined: RefinedSphere | None = None

    @staticmethod
    def of(field: SphereField, views: Sequence[View], refined: RefinedSphere | None = None) -> RigSurface:
        """The field from the first picture's place."""
        return RigSurface(field, views, tuple(outline_of(field, view) for view in views), None, refined)

    def seen_from(self, viewpoint: RigViewpoint | None) -> RigSurface:
        """The same from where a viewpoint slides to; None or one that does not slide: the first picture's place."""
        return replace(self, viewpoint=viewpoint if viewpoint is not None and viewpoint.s1 > 0 else None)

    @cached_property
    def _carried(self) -> CarriedDepth | None:
        return None if self.viewpoint is None else CarriedDepth.of(self.field, self.views, self.viewpoint)

    @cached_property
    def dense(self) -> RefinedSphere | None:
        """What dense refinement found, from where the viewpoint slides to."""
        return self.refined if self.refined is None or self.viewpoint is None else carried_sphere(
            self.refined, self.viewpoint
        )

    def depth(self, rays: Array) -> tuple[Array, Array | None]:
        """Inverse range d (…) along unit rays (…, 3), and d C (…, 3) where the viewpoint slides."""
        if self.dense is not None:
            d = self.dense.at(rays)[0].astype(np.float64)
            return d, None if self.viewpoint is None else d[..., None] * self.viewpoint.place(rays)
        return (self.field.at(rays), None) if self._carried is None else self._carried.at(rays)

    def brought_along(self, view: View, infinite: list[Array], moved: Array | None) -> list[Array]:
        """H_inf p + K R d C (three (…) arrays) for d C (…, 3); H_inf p if nothing moved."""
        if moved is None:
            return infinite
        matrix = view.H_inf @ self.views[0].K
        return [part + moved @ row for part, row in zip(infinite, matrix, strict=True)]

    def borders(self) -> list[Array]:
        """Unit rays (N, 3) from the viewpoint that show each picture's border, in order."""
        if self.viewpoint is None:
            return list(self.outlines)
        return [
            self.viewpoint.seen_from(rays, np.maximum(self.field.at(rays), 0.0))[0] for rays in self.outlines
        ]


@dataclass(frozen=True, eq=False)
class RigValues:
    """A field on the sphere at the nodes of a grid over a canvas.

    inverse_depth (rows, columns): of canvas points p, d(r) · |K⁻¹ p|; moved (rows, columns, 3): d C where the viewpoint
    slides, else None; places: raw px (rows, columns, 2) of each picture, NaN behind its camera; slacks: px (rows,
    columns, 2) of each, None without; both in the pictures' order.
    """

    inverse_depth: Array
    moved: Array | None
    places: tuple[Array, ...]
    slacks: tuple[Array | None, ...]

    @staticmethod
    def over(surface: RigSurface, canvas: Canvas, grid: Grid) -> RigValues:
        """A field's values at a grid's nodes."""
        field, views = surface.field, surface.views
        camera = views[0].camera
        rays, length = canvas.rays_at(views[0].K, grid.xs, grid.ys, camera)
        depth, moved = surface.depth(rays)
        depth = depth * length
        if moved is not None:
            rays = rays + moved
            rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        places, slacks = [], []
        for number, view in enumerate(views):
            infinite = surface.brought_along(view, canvas.project_rows(view.H_inf, grid.xs, grid.ys, camera), moved)
            slack = field.slack(number, rays) if number or canvas.projection is not None else None
            slacks.append(slack)
            beside = [] if slack is None else [(slack[..., 0], slack[..., 1])]
            places.append(np.stack(raw_pixels(view, infinite, depth, beside), axis=-1))
        return RigValues(depth, moved, tuple(places), tuple(slacks))


def build_rig_warp(surface: RigSurface, projection: Projection | None = None, tick: Tick = unwatched) -> Warp:
    """Lay out a canvas that holds all pictures, and map them onto it.

    Parameters
    ----------
    surface : RigSurface
        Of all pictures, the viewpoint's first.
    projection : Projection, optional
        Of a round panorama; by default the panorama lies in the plane of the viewpoint's picture, pixel for pixel.
    tick : callable
        Called between strips; ends the work by raising.

    Returns
    -------
    Warp

    Raises
    ------
    NoOverlap, OutputTooLarge, BadRequest
        See `build_warp`.
    """
    field, views = surface.field, surface.views
    camera, sizes = views[0].camera, [view.size for view in views]
    plane = Canvas(0, 0, (0, 0), projection=projection)
    outlines = [border @ views[0].K.T for border in surface.borders()]
    reference: Box = (0, 0, *camera.size)
    if projection is None:
        reach, cropped = expected_reach([in_plane(one) for one in outlines[1:]], camera.size, sizes[1:])
    else:
        shows = [_shows(field, views, number) for number in range(len(views))]
        reference, reach, cropped = round_reach(projection, outlines, shows, camera)

    def pictures_at(grid: Grid) -> Sequence[Array]:
        return RigValues.over(surface, plane, grid).places

    canvas = bounding_canvas(pictures_at, reference, sizes, reach, projection)
    return trimmed(build_rig_map(surface, replace(canvas, cropped=canvas.cropped or cropped), tick))


def build_rig_map(surface: RigSurface, canvas: Canvas, tick: Tick = unwatched) -> Warp:
    """Map all pictures onto a given canvas, strip by strip.

    Parameters
    ----------
    surface : RigSurface
        Of all pictures, the viewpoint's first.
    canvas : Canvas
    tick : callable
        See `build_rig_warp`.

    Returns
    -------
    Warp
    """
    views = surface.views
    left, top = -canvas.offset[0], -canvas.offset[1]
    shape = canvas.height, canvas.width
    grid = Grid.over(left, top, canvas.width, canvas.height, RIG_WARP.nodes)
    values = RigValues.over(surface, canvas, grid)
    maps: list[CanvasMap] = [
        _empty_map(places, view.size, canvas, grid) for places, view in zip(values.places, views, strict=True)
    ]
    if canvas.projection is None:
        maps[0] = ReferenceMap(canvas, views[0].camera)
    depth = np.empty(shape, np.float32)

    def put(part: slice) -> None:
        start, stop = part.start, part.stop
        rows = (left, top + start, canvas.width, stop - start)
        moved = None
        if surface.dense is not None:
            rays, length = canvas.rays_at(views[0].K, canvas.xs, canvas.ys[part], views[0].camera)
            inverse_range, moved = surface.depth(rays)
            depth[part] = inverse_range * length
        else:
            depth[part] = grid.to_pixels(values.inverse_depth, *rows)
        if surface.dense is None and values.moved is not None:
            moved = np.stack([grid.to_pixels(values.moved[..., k], *rows) for k in range(3)], axis=-1)
        strip = _Strip(surface, canvas, grid, start, depth[part], moved)
        for view, slack, one in zip(views, values.slacks, maps, strict=True):
            for known in one.parts if isinstance(one, BoxedMap) else ():
                strip.put(known, view, slack)

    for _ in in_order(put, small_strips(shape)):
        tick()
    known = _sureness(surface, canvas)
    return Warp(canvas, tuple(maps), depth, known[0], viewpoint=surface.viewpoint, deviation=known[1])


def _sureness(surface: RigSurface, canvas: Canvas) -> tuple[AnyImage | None, AnyImage]:
    """Confidence (H, W) of dense refinement on a canvas, None without it, and the standard deviation (H, W) of inverse
    depth."""
    field, views = surface.field, surface.views
    camera, (left, top) = views[0].camera, canvas.offset
    if surface.dense is not None:
        confidence = OfSphere(canvas, camera, views[0].K, surface.dense, "confidence")
        return confidence, OfSphere(canvas, camera, views[0].K, surface.dense, "deviation")
    grid = Grid.over(-left, -top, canvas.width, canvas.height, RIG_WARP.deviation_nodes)
    rays, length = canvas.rays_at(views[0].K, grid.xs, grid.ys, camera)
    return None, AtNodes(canvas, camera, grid, field.deviation(rays) * length)


@dataclass(frozen=True, eq=False)
class _Strip:
    """Rows of a canvas from `start` on, of which inverse depth (h, W) is known, and d C (h, W, 3) where the viewpoint
    slides; grid: the nodes of a field."""

    surface: RigSurface
    canvas: Canvas
    grid: Grid
    start: int
    depth: NDArray[np.float32]
    moved: NDArray[Any] | None

    def put(self, one: MapPart, view: View, slack: Array | None) -> None:
        """Writes where a picture is seen in these rows into a part of its map; slack (rows, columns, 2): px
        at the nodes."""
        canvas, (left, top, width, height) = self.canvas, one.box
        low, high = max(self.start, top), min(self.start + len(self.depth), top + height)
        if low >= high or not width:
            return
        columns = slice(left, left + width)
        beside = []
        if slack is not None:
            strip = (left - canvas.offset[0], low - canvas.offset[1], width, high - low)
            beside.append([self.grid.to_pixels(slack[..., k], *strip) for k in (0, 1)])
        camera = self.surface.views[0].camera
        infinite = canvas.project_rows(view.H_inf, canvas.xs[columns], canvas.ys[low:high], camera)
        part = slice(low - self.start, high - self.start), columns
        # float64 from here on: NumPy 1 and 2 differ in what float32 times a scalar is
        depth = self.depth[part].astype(np.float64)
        moved = None if self.moved is None else self.moved[part].astype(np.float64)
        infinite = self.surface.brought_along(view, infinite, moved)
        rows = slice(low - top, high - top)
        one.inner.x[rows], one.inner.y[rows] = raw_pixels(view, infinite, depth, beside)


def _empty_map(places: Array, size: tuple[int, int], canvas: Canvas, grid: Grid) -> BoxedMap:
    """A map to be filled in, in the boxes of the canvas that may show a picture of (W, H) px, by where it is seen at
    the nodes."""
    shown = falls_inside(places[..., 0], places[..., 1], size)
    parts = [_empty_part(nodes, size, canvas, grid) for nodes in _apart(shown)]
    nothing = PictureMap(np.empty((0, 0), np.float32), np.empty((0, 0), np.float32), size)
    return BoxedMap(tuple(parts) or (MapPart(nothing, (0, 0)),), (canvas.height, canvas.width))


def _apart(shown: NDArray[np.bool_]) -> list[Part]:
    """Rows and columns of the nodes (rows, columns) that show something: on either side of the widest gap between
    columns that do, which is wide of a picture that goes on at the other end of a sphere."""
    columns = np.flatnonzero(shown.any(axis=0))
    gaps = np.diff(columns)
    widest = int(np.argmax(gaps)) + 1 if gaps.size else 0
    wide = gaps.size and gaps[widest - 1] > 2 * RIG_WARP.margin_nodes + 1
    parts = []
    for side in np.split(columns, [widest]) if wide else [columns]:
        rows = np.flatnonzero(shown[:, side].any(axis=1))
        if rows.size:
            parts.append((slice(int(rows[0]), int(rows[-1]) + 1), slice(int(side[0]), int(side[-1]) + 1)))
    return parts


def _empty_part(nodes: Part, size: tuple[int, int], canvas: Canvas, grid: Grid) -> MapPart:
    """One such box, about rows and columns of nodes: the picture ends somewhere between its last node and the next, and
    its corner may lie between two rows."""
    margin, ends = RIG_WARP.margin_nodes * grid.step, []
    sides = canvas.width, canvas.height
    for axis, some, offset, side in zip((grid.xs, grid.ys), nodes[::-1], canvas.offset, sides, strict=True):
        low, high = int(axis[some.start] + offset) - margin, int(axis[some.stop - 1] + offset) + margin + 1
        ends.append((min(max(0, low), side), max(0, min(side, high))))
    (left, right), (top, bottom) = ends
    shape = max(0, bottom - top), max(0, right - left)
    inner = PictureMap(np.empty(shape, np.float32), np.empty(shape, np.float32), size)
    return MapPart(inner, (left, top))


def outline_of(field: SphereField, view: View) -> Array:
    """Unit rays (N, 3) from the viewpoint to what a picture shows along its border, in order."""
    seen = homogeneous(undistort(border(view.size), view.camera)) @ inverse_intrinsics(view.K).T
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    rays = seen @ view.R
    # |s b − t| = 1 / d for the range s from the picture's camera: 1 / s is what its place moves the ray by
    along, offset = seen @ view.t, float(view.t @ view.t)
    for _ in range(RIG_WARP.outline_steps):
        d = np.maximum(field.at(rays), 0.0)
        share = d * along + np.sqrt(np.maximum(1 + d**2 * (along**2 - offset), 0))
        inverse = d / np.maximum(share, RIG_WARP.least_share)
        rays = (seen - inverse[:, None] * view.t) @ view.R
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays


def _shows(field: SphereField, views: Sequence[View], number: int) -> Callable[[Array], bool]:
    """Whether picture `number` shows a canvas point (3,)."""
    view, to_ray = views[number], inverse_intrinsics(views[0].K)

    def shown(point: Array) -> bool:
        ray = to_ray @ point
        length = float(np.linalg.norm(ray))
        a, b, c = view.H_inf @ point + float(field.at(ray[None] / length)[0]) * length * view.e_prime
        if not ahead_of_camera(a, b, c):
            return False
        x, y = distort(np.array([a / c, b / c]), view.camera)
        return bool(falls_inside(x, y, view.size))

    return shown
