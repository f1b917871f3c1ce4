"""Cameras and a mesh out of a finished stitch, as numbers for Blender's scene. No bpy.

The world that they stand in has the reference camera at its origin, looking along +y with z up, and the baseline as its
unit, unless told otherwise; under a levelled panorama it is that which looks along +y.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.cameras.blender_camera import BlenderLens, lens_for, matrix_world_of
from ...core.cameras.projective import homogeneous
from ...core.output.depth.nodes import DepthNodes
from ...core.output.depth.options import MESH
from ...core.output.depth.surface import DepthGrid, Surface, cut_surface
from ...core.panorama.projection import Projection
from ...core.panorama.rig_viewpoint import RigViewpoint
from ...core.panorama.viewpoint import Viewpoint
from ...core.raster.arrays import Array

# From the reference camera's axes (x right, y down, z ahead) to a world with z up.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
# R, t of the reference camera, and where that is.
ORIGIN = np.eye(3), np.zeros(3)
AT_REFERENCE = "the reference's place"


@dataclass(frozen=True)
class RoundLens:
    """What a panoramic camera of Blender's sees: kind, cylindrical or equirectangular; resolution (W, H) px; headings,
    left and right, and elevations, bottom and top, in radians, of a cylinder the latter's tangents."""

    kind: str
    resolution: tuple[int, int]
    headings: tuple[float, float]
    elevations: tuple[float, float]


@dataclass(frozen=True)
class PlacedCamera:
    """A camera of the scene: its lens (with the picture's size), its world matrix (4, 4), where it stands in words."""

    name: str
    lens: BlenderLens | RoundLens
    matrix_world: Array
    place: str


def projection_of(known: dict[str, Any]) -> Projection | None:
    """How the canvas px of a result's panorama become rays (its plane is the canvas); None where the canvas is the
    reference's own plane."""
    told = known["report"]["canvas"]["projection"]
    if told["kind"] == "perspective" and np.isfinite(matrix(known["geometry"]["K_canvas"])).all():
        return None
    x, y = told["centre"]
    return Projection(
        told["kind"], float(told["focal_px"]), (float(x), float(y)), matrix(told["rotation"]),
        matrix(known["geometry"]["K"]), float(told.get("distance", 0.0)),
    )  # fmt: skip


def viewpoint_of(known: dict[str, Any]) -> Viewpoint | RigViewpoint | None:
    """From where a result's panorama is seen; None where that is the reference's place for all of it."""
    told = known["geometry"].get("viewpoint")
    if told is None:
        return None
    if "places" in told:
        return RigViewpoint(float(told["s1"]), matrix(told["rotation"]), matrix(told["places"]))
    c, rotation, along = (matrix(told[name]) for name in ("c", "rotation", "along"))
    start, end = told["ends"]
    return Viewpoint(float(told["s1"]), c, rotation, along, (float(start), float(end)))


def axes(known: dict[str, Any]) -> Array:
    """The rotation (3, 3) from the reference camera's axes to the world's."""
    projection = projection_of(known)
    return UPRIGHT if projection is None else UPRIGHT @ projection.rotation.T


def placed_cameras(known: dict[str, Any], baseline: float = 1.0) -> list[PlacedCamera]:
    """The cameras of the pictures and the panorama's; the target's of two only where the model knows its place, the
    panorama's only where Blender has such a lens. One whose viewpoint slides stands where its middle is seen from.

    known: a result's `geometry` (K, K_prime, R, t or `cameras`; full_sizes, K_canvas, canvas, viewpoint) and `report`;
    baseline: distance of the cameras, of more than two that of the farthest from the first, in the scene's units.
    """
    geometry, world = known["geometry"], axes(known)
    wanted = (_of_many if "cameras" in geometry else _of_pair)(geometry, baseline)
    canvas, projection = (int(geometry["canvas"][0]), int(geometry["canvas"][1])), projection_of(known)
    if projection is None:
        wanted.append(("Panorama", flat_lens(geometry["K_canvas"], canvas), ORIGIN, AT_REFERENCE))
    elif (lens := panorama_lens(projection, canvas)) is not None:
        place, words = _middle_place(known, projection, canvas)
        R = projection.rotation.T
        wanted.append(("Panorama", lens, (R, -R @ place * baseline), words))
    return [PlacedCamera(name, lens, in_world(R, t, world), words) for name, lens, (R, t), words in wanted]


# Name, lens, pose relative to the first one, and place in words.
_Wanted = list[tuple[str, BlenderLens | RoundLens, tuple[Array, Array], str]]


def _of_pair(geometry: dict[str, Any], baseline: float) -> _Wanted:
    sizes = _full_sizes(geometry)
    wanted: _Wanted = [("Reference", flat_lens(geometry["K"], sizes[0]), ORIGIN, AT_REFERENCE)]
    if (pose := pose_of(geometry, baseline)) is not None:
        wanted.append(("Target", flat_lens(geometry["K_prime"], sizes[1]), pose, "the target's place"))
    return wanted


def _of_many(geometry: dict[str, Any], baseline: float) -> _Wanted:
    wanted: _Wanted = []
    for camera, size in zip(geometry["cameras"], _full_sizes(geometry), strict=True):
        if (pose := pose_of(camera, baseline)) is not None:
            name = camera["name"]
            wanted.append((called(name), flat_lens(camera["K"], size), pose, f"the place of {name}"))
    return wanted


def called(picture: str) -> str:
    """The name of the camera that took one of more than two pictures."""
    return f"Picture {picture}"


def _full_sizes(geometry: dict[str, Any]) -> list[tuple[int, int]]:
    return [(int(width), int(height)) for width, height in geometry["full_sizes"]]


def _middle_place(known: dict[str, Any], projection: Projection, canvas: tuple[int, int]) -> tuple[Array, str]:
    """From where the middle of a canvas is seen (3,), in baselines in the reference's frame; and that in words."""
    viewpoint = viewpoint_of(known)
    if viewpoint is None:
        return np.zeros(3), AT_REFERENCE
    ray = projection.rays((np.array(canvas) - 1) / 2)
    if isinstance(viewpoint, RigViewpoint):
        return viewpoint.place(ray), "where its middle is seen from; the panorama's viewpoint slides among the pictures"
    share = float(viewpoint.slide_at(ray))
    return viewpoint.place(ray), (
        f"{share:.0%} of the way from the reference's place to the target's, from where the middle is seen; the "
        f"panorama's viewpoint slides from 0% to {viewpoint.s1:.0%}"
    )


def viewpoint_in_world(known: dict[str, Any], baseline: float = 1.0) -> Array:
    """From where the middle of a result's panorama is seen (3,), in the world."""
    projection = projection_of(known)
    if projection is None:
        return np.zeros(3)
    width, height = known["geometry"]["canvas"]
    place: Array = _middle_place(known, projection, (int(width), int(height)))[0] * baseline @ axes(known).T
    return place


def panorama_lens(projection: Projection, size: tuple[int, int]) -> BlenderLens | RoundLens | None:
    """The lens that sees a canvas of (W, H) px; None where Blender has none like it."""
    if projection.kind == "pannini" and projection.distance > 0:
        return None
    if projection.kind in ("perspective", "pannini"):
        K = np.diag([projection.focal, projection.focal, 1.0])
        K[:2, 2] = projection.centre
        return lens_for(K, size)
    return round_lens(projection, size)


def flat_lens(K: Any, size: tuple[int, int]) -> BlenderLens:
    """The lens of a result's K for a picture of (W, H) px."""
    return lens_for(square_pixels(matrix(K)), size)


def round_lens(projection: Projection, size: tuple[int, int]) -> RoundLens:
    """The panoramic lens that sees a canvas of (W, H) px."""
    edges = np.array([[-0.5, -0.5], [size[0] - 0.5, size[1] - 0.5]])
    (left, top), (right, bottom) = (edges - np.array(projection.centre)) / projection.focal
    return RoundLens(projection.kind, size, (float(left), float(right)), (float(-bottom), float(-top)))


def pose_of(told: dict[str, Any], baseline: float = 1.0) -> tuple[Array, Array] | None:
    """R (3, 3), t (3,) of a camera in the reference camera's frame, or None where it is not known."""
    R, t = matrix(told["R"]), matrix(told["t"])
    if not (np.isfinite(R).all() and np.isfinite(t).all()):
        return None
    return R, t * baseline


def in_world(R: Array, t: Array, world: Array = UPRIGHT) -> Array:
    """The world matrix (4, 4) of a camera with the pose R, t relative to the reference camera; world: see `axes`."""
    return matrix_world_of(R @ world.T, t)


def square_pixels(K: Array) -> Array:
    """K with one focal length, the geometric mean: Blender's camera has no other. A picture that was resized to whole
    pixels has two that differ in their fourth digit."""
    out = K.copy()
    out[0, 0] = out[1, 1] = np.sqrt(K[0, 0] * K[1, 1])
    out[0, 1] = 0.0
    return out


def depth_mesh(
    known: dict[str, Any], baseline: float = 1.0, farthest: float = MESH.farthest, nodes: DepthNodes | None = None,
    ends_open: bool = False,
) -> Surface:  # fmt: skip
    """The panorama as a surface: nodes on their rays from where each is seen, at the depth that was found, cut where
    near and far meet.

    known: a result's `geometry`, `report` and `depth`; farthest: × the median depth, where everything beyond ends,
    infinity (d ≤ 0) too; nodes: None for those of `depth`, as earlier releases left them; ends_open: leave out what
    ends there. Vertices in the world. Raises ValueError where nothing is left.
    """
    nodes = nodes or coarse_nodes(known)
    width, height = known["geometry"]["canvas"]
    pixels = np.stack(np.meshgrid(nodes.x, nodes.y), axis=-1)
    viewpoint, seen = viewpoint_of(known), rays(known, pixels)
    uvs = np.stack([(pixels[..., 0] + 0.5) / width, 1 - (pixels[..., 1] + 0.5) / height], axis=-1)
    places = None if viewpoint is None else viewpoint.place(seen)
    grid = DepthGrid(seen, nodes.inverse_depth, nodes.shows, uvs, places, nodes.middles)
    surface = cut_surface(grid.nearer(farthest) if ends_open else grid, farthest)
    return replace(surface, vertices=surface.vertices * baseline @ axes(known).T)


def coarse_nodes(known: dict[str, Any]) -> DepthNodes:
    """The nodes of a result's `depth`: `columns`, `rows`, `inverse_depth` (in 1/baseline) and `shows`, row by row from
    the top, corner to corner of the canvas. In the middle of a cell is what its farthest corner has."""
    grid, (width, height) = known["depth"], known["geometry"]["canvas"]
    columns, rows = int(grid["columns"]), int(grid["rows"])
    d = matrix(grid["inverse_depth"]).reshape(rows, columns)
    shows = np.asarray(grid["shows"], bool).reshape(rows, columns)
    middles = np.minimum(np.minimum(d[1:, 1:], d[1:, :-1]), np.minimum(d[:-1, 1:], d[:-1, :-1]))
    return DepthNodes(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows), d, middles, shows)


def rays(known: dict[str, Any], pixels: Array) -> Array:
    """What canvas px (…, 2) show, in the reference camera's frame, as long as 1/d is to be taken: with z = 1 on the
    reference's own plane, unit rays elsewhere."""
    projection = projection_of(known)
    if projection is not None:
        return projection.rays(pixels)
    return homogeneous(pixels) @ np.linalg.inv(square_pixels(matrix(known["geometry"]["K_canvas"]))).T


def matrix(values: Any) -> Array:
    """Numbers of a result as an array; JSON has null where an array has NaN."""
    return np.array(values, dtype=object).astype(np.float64)
