"""The backward maps: for every canvas pixel the pixel of each picture to fetch (docs/method.md, 6).

Between the nodes of a grid only d is interpolated, and slack, which is smoother still. H_inf p + d e' is evaluated at
every pixel, so that a field without slack keeps every pixel exactly on its epipolar line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.lens import distort, undistort
from ..cameras.projective import ahead_of_camera, homogeneous, project
from ..cameras.view import View
from ..field.field import Field, FieldValues
from ..field.transfer import transfer
from ..raster.arrays import Array, Box, box_of, cut, small_strips, strips
from ..raster.grid import Grid
from ..raster.lazy import AnyImage, Placed, whole
from ..raster.options import GRID
from ..raster.picture_map import CanvasMap, PictureMap
from ..system.errors import BadRequest, NoOverlap
from ..system.threads import each
from .canvas import Canvas, border, bounding_canvas, expected_reach, round_reach, shown_by
from .continued_depth import ContinuedDepth
from .depth import Confidence, Depth, Nearness
from .options import WARP
from .projection import Projection, focal_of
from .reference_map import ReferenceMap
from .rig_viewpoint import RigViewpoint

if TYPE_CHECKING:
    from ..continuation.continuation import Continuation
    from ..field.refined_depth import RefinedDepth
    from .viewpoint import Viewpoint


@dataclass(frozen=True)
class Warp:
    """Where each picture is seen on a canvas, and how deep.

    Attributes
    ----------
    canvas : Canvas
    maps : tuple of CanvasMap
        For each picture, the reference first: its raw pixel at each canvas pixel.
    depth : (H, W) image
        Inverse depth, 1 / baseline, float32, NaN where the field knows none; worked out where it is read (see
        `raster.lazy`).
    lazy_confidence : (H, W) image or None
        Confidence of dense refinement, 0..1, float32, likewise; None without it.
    slide : (H, W) image or None
        How far each pixel's viewpoint lies from the reference's place towards the target's, 0..1, float32; None if all
        are seen from the reference's place.
    behind : (H, W) bool array or None
        What the reference cannot see though its map falls inside it, likewise: something nearer hides it.
    viewpoint : Viewpoint, RigViewpoint or None
        How far it slides in any direction: of a pair (then `slide` says so too), or of more pictures.
    refilled : (H, W) bool array or None
        Where depth was taken from the background, since a border cuts what was there: nothing counts as hidden there.
    beside : (H, W, 3) float32 array or None
        px x and y (before the lens) by which picture 1 is seen beside its epipolar lines, and confidence; only where it
        was asked for, with all of depth.
    deviation : (H, W) image or None
        Standard deviation of inverse depth, of more than two pictures.
    """

    canvas: Canvas
    maps: tuple[CanvasMap, ...]
    depth: AnyImage
    lazy_confidence: AnyImage | None = None
    slide: AnyImage | None = None
    behind: NDArray[np.bool_] | None = None
    viewpoint: Viewpoint | RigViewpoint | None = None
    refilled: NDArray[np.bool_] | None = None
    beside: NDArray[np.float32] | None = None
    deviation: AnyImage | None = None

    @property
    def inverse_depth(self) -> NDArray[np.float32]:
        """All of the inverse depth (H, W) float32."""
        return whole(self.depth)

    @property
    def confidence(self) -> NDArray[np.float32] | None:
        """All of the confidence (H, W) float32, None without dense refinement."""
        return None if self.lazy_confidence is None else whole(self.lazy_confidence)

    def within(self, box: Box, in_place: bool = False) -> Warp:
        """The part in a box (left, top, width, height) of the canvas; beyond the canvas, NaN and confidence 0.

        in_place: the box lies within the canvas and the part takes over the whole's memory; the whole is lost.
        """
        left, top, width, height = box
        maps = tuple(one.within(box, in_place) for one in self.maps)
        inside = left >= 0 and top >= 0 and left + width <= self.canvas.width and top + height <= self.canvas.height

        def part(values: AnyImage, beyond: float) -> AnyImage:
            if inside and isinstance(values, np.ndarray):
                return cut(values, box)
            return Placed(values, (-top, -left), (height, width), beyond)

        depth = part(self.depth, np.nan)
        confidence, slide, deviation = (
            None if values is None else part(values, 0.0)
            for values in (self.lazy_confidence, self.slide, self.deviation)
        )
        behind, refilled, beside = (
            None if values is None else cut(values, box) for values in (self.behind, self.refilled, self.beside)
        )
        canvas = self.canvas.within(box)
        return Warp(canvas, maps, depth, confidence, slide, behind, self.viewpoint, refilled, beside, deviation)

    def nearness(self, views: Sequence[View], number: int) -> AnyImage:
        """How near (H, W) each canvas point is to a picture's camera (see `visibility.nearness_of`)."""
        view = views[number]
        if isinstance(self.viewpoint, RigViewpoint):
            return Nearness(self.canvas, views[0].camera, view, self.depth, viewpoint=(views[0].K, self.viewpoint))
        if self.slide is None or self.viewpoint is None:
            return Nearness(self.canvas, views[0].camera, view, self.depth)
        nearer = float(view.H_inf[2] @ views[0].K @ self.viewpoint.c)
        return Nearness(self.canvas, views[0].camera, view, self.depth, self.slide, nearer)


def build_warp(
    field: Field, views: Sequence[View], projection: Projection | None = None, refined: RefinedDepth | None = None,
    continuation: Continuation | None = None, hold: bool = False,
) -> Warp:  # fmt: skip
    """Lay out a canvas that holds all pictures, and map them onto it.

    Parameters
    ----------
    field : Field
    views : sequence of View
        What is known of the pictures, the reference's first.
    projection : Projection, optional
        Of a round panorama; by default the panorama is flat.
    refined : RefinedDepth, optional
        What dense refinement found.
    continuation : Continuation, optional
        What goes on where the reference shows nothing; by default the field does.
    hold : bool
        See `build_map`.

    Returns
    -------
    Warp

    Raises
    ------
    NoOverlap
        No further picture comes to lie near the reference.
    OutputTooLarge
        The canvas would have too many pixels.
    BadRequest
        The panorama has a projection, and the field knows the reference's plane only; or its window shows nothing.
    """
    camera, further = views[0].camera, views[1:]
    planes = [_plane_map(field, view) for view in further]
    outlines = [_outline(plane, view, continuation) for plane, view in zip(planes, further, strict=True)]
    sizes = [view.size for view in further]
    if projection is None:
        reference: Box = (0, 0, *camera.size)
        reach, cropped = expected_reach([in_plane(outline) for outline in outlines], camera.size, sizes)
    else:
        own = homogeneous(undistort(border(camera.size), camera))
        shows = [shown_by(plane, view.camera) for plane, view in zip((np.eye(3), *planes), views, strict=True)]
        reference, reach, cropped = round_reach(projection, (own, *outlines), shows, camera)
    plane = Canvas(0, 0, (0, 0), projection=projection)

    def pictures_at(grid: Grid) -> list[Array]:
        values = _node_values(field, grid, plane, camera)
        continued = ContinuedDepth.over(continuation, plane, camera, grid)
        if continued is not None:
            values = continued.blended(values)
        return [_at_nodes(values, view, number, grid, plane, camera) for number, view in enumerate(further, 1)]

    canvas = bounding_canvas(pictures_at, reference, sizes, reach, projection)
    warp = build_map(field, views, replace(canvas, cropped=canvas.cropped or cropped), refined, continuation, hold)
    return trimmed(warp)


def _at_nodes(values: FieldValues, view: View, number: int, grid: Grid, plane: Canvas, camera: Camera) -> Array:
    """Where (rows, columns, 2) picture `number` is seen at the nodes of a grid, raw px; camera: the reference's."""
    infinite = plane.project_rows(view.H_inf, grid.xs, grid.ys, camera)
    ideal = np.stack(transfer(view, infinite, values.inverse_depth), axis=-1)
    if values.shift is not None and values.picture == number:
        ideal = ideal + values.shift
    return distort(ideal, view.camera)


def build_map(
    field: Field, views: Sequence[View], canvas: Canvas, refined: RefinedDepth | None = None,
    continuation: Continuation | None = None, hold: bool = False,
) -> Warp:  # fmt: skip
    """Map all pictures onto a given canvas, strip by strip.

    Parameters
    ----------
    field : Field
    views : sequence of View
        What is known of the pictures, the reference's first.
    canvas : Canvas
    refined : RefinedDepth, optional
        What dense refinement found.
    continuation : Continuation, optional
        What goes on where the reference shows nothing.
    hold : bool
        Keep inverse depth, and what lies beside the epipolar lines, as arrays: all of it will be read.

    Returns
    -------
    Warp

    Raises
    ------
    BadRequest
        The panorama is round, and the field knows the reference's plane only.
    """
    left, top = -canvas.offset[0], -canvas.offset[1]
    camera = views[0].camera
    grid = Grid.over(left, top, canvas.width, canvas.height)
    values = _node_values(field, grid, canvas, camera)
    shape = (canvas.height, canvas.width)
    maps = [PictureMap(np.empty(shape, np.float32), np.empty(shape, np.float32), view.size) for view in views[1:]]
    xs, ys = canvas.xs, canvas.ys
    continued = ContinuedDepth.over(continuation, canvas, camera, grid)
    depth = Depth(canvas, camera, grid, values.inverse_depth, refined, continued)
    # on another plane than the reference's, depth and the reference's map take long to work out, and are read again
    projected = canvas.projection is not None
    held = np.empty(shape if projected or hold else (0, 0), np.float32)
    held_beside = np.zeros((*shape, 3) if hold else (0, 0, 3), np.float32)
    own: CanvasMap = ReferenceMap(canvas, camera)
    if projected:
        own = PictureMap(np.empty(shape, np.float32), np.empty(shape, np.float32), camera.size)

    def put(part: slice) -> None:
        start, stop = part.start, part.stop
        strip = (left, top + start, canvas.width, stop - start)
        here = depth.strip(part)
        if held.size:
            held[part] = here.depth
        if hold and here.confidence is not None:
            held_beside[part, :, 2] = here.confidence
        if isinstance(own, PictureMap) and here.places is not None:
            own.x[part], own.y[part] = here.places[..., 0], here.places[..., 1]
        for number, (view, out) in enumerate(zip(views[1:], maps, strict=True), 1):
            infinite = canvas.project_rows(view.H_inf, xs, ys[start:stop], camera)
            beside = []
            if values.shift is not None and values.picture == number:
                beside.append([grid.to_pixels(values.shift[..., k], *strip) for k in (0, 1)])
            if refined is not None and here.sideways is not None and refined.picture == number:
                beside.append([here.sideways[..., 0], here.sideways[..., 1]])
            if here.share is not None:
                beside = [[here.share * along for along in one] for one in beside]
            if hold:
                for one in beside:
                    held_beside[part, :, 0] += one[0]
                    held_beside[part, :, 1] += one[1]
            out.x[part], out.y[part] = raw_pixels(view, infinite, here.depth, beside)

    # depth that is worked out again where it is read takes the larger strips of `Depth`
    each(put, small_strips(shape) if held.size else strips(shape))
    confidence = None if refined is None else Confidence(canvas, camera, refined)
    return Warp(
        canvas, (own, *maps), held if held.size else depth, confidence, beside=held_beside if hold else None
    )


def raw_pixels(
    view: View, infinite: list[Array], depth: Array, beside: Sequence[Sequence[NDArray[Any]]] = ()
) -> tuple[Array, Array]:
    """Raw px x, y (h, w) of a picture at canvas points that were brought to infinity (see `transfer`) and their inverse
    depth (h, w); beside: pairs of (h, w), px by which it is seen beside its epipolar lines."""
    x, y = transfer(view, infinite, depth)
    for across, down in beside:
        x += across
        y += down
    if view.camera.bent:
        x, y = np.moveaxis(distort(np.stack([x, y], axis=-1), view.camera), -1, 0)
    return x, y


def _node_values(field: Field, grid: Grid, canvas: Canvas, camera: Camera) -> FieldValues:
    """A field's values at the nodes of a grid over the canvas's plane.

    Fields are defined on the reference's plane. For a round panorama, what d has beside the plane that it ends in is
    interpolated there and scaled by p_3; where the reference camera does not look, that plane alone is left.
    """
    if canvas.projection is None:
        return field.on_grid(grid, undistort(grid.points, camera) if camera.bent else None)
    width, height = camera.size
    margin = int(np.ceil(min(field.fit.fade_px, WARP.max_fade * max(camera.size))))
    across, down = width + 2 * margin, height + 2 * margin
    share = min(WARP.max_node_factor, max(1.0, across * down / (2 * width * height)))
    step = WARP.node_share * grid.step * focal_of(canvas.projection.K) / canvas.projection.focal
    # a power of two: canvases of one stitch are of similar size, and so share these nodes (see `Remembered`)
    step = 2.0 ** np.floor(np.log2(step))
    flat = Grid.over(-margin, -margin, across, down, int(min(share * GRID.nodes, across * down / step**2)))
    ideal = undistort(flat.points, camera)
    values = field.on_grid(flat, ideal if camera.bent else None)
    if values.far is None:
        raise BadRequest(
            f"the field {field.name!r} knows the reference's plane only: use slack or strict, or --projection reference"
        )
    places, ahead = canvas.on_reference(grid.xs, grid.ys, camera)
    beside_plane = flat.at(values.inverse_depth - homogeneous(ideal) @ values.far, places)
    (base,) = canvas.project_rows(values.far[None], grid.xs, grid.ys, camera)
    shift = values.shift
    if shift is not None:
        shift = np.stack([flat.at(shift[..., k], places) for k in (0, 1)], axis=-1)
    return FieldValues(base + np.nan_to_num(ahead) * beside_plane, shift, picture=values.picture)


def _plane_map(field: Field, view: View) -> Array:
    """The homography (3, 3) from the reference to a picture by the plane in which the field continues."""
    return view.H_inf + np.outer(view.e_prime, field.plane)


def _outline(H_plane: Array, view: View, continuation: Continuation | None) -> Array:
    """A picture's border (N, 3), in order, as canvas points p that show it by a continuation, or else that H_plane
    (3, 3) maps to it."""
    ideal = undistort(border(view.size), view.camera)
    if continuation is not None:
        return continuation.outline(ideal) @ continuation.K.T
    return homogeneous(ideal) @ np.linalg.inv(H_plane).T


def in_plane(points: Array) -> Array:
    """Reference pixels (N, 2) of canvas points (N, 3), NaN behind the reference camera."""
    points = points.copy()
    points[~ahead_of_camera(*points.T)] = np.nan
    return project(points)


def trimmed(warp: Warp) -> Warp:
    """The warp without the outer rows and columns that no picture reaches. Raises NoOverlap, or BadRequest where a
    window shows nothing."""
    shown = np.zeros((warp.canvas.height, warp.canvas.width), bool)
    for one in warp.maps[1:]:
        shown |= one.inside()
    projection = warp.canvas.projection
    framed = projection is not None and projection.window is not None
    if not shown.any() and not framed:
        raise NoOverlap("the warp brings the target nowhere near the reference: the matches may be chance look-alikes")
    shown |= warp.maps[0].inside()
    if not shown.any():
        raise BadRequest("the frame shows nothing at all: give a centre nearer to 0,0, or a larger field of view")
    return warp.within(box_of(shown), in_place=True)
