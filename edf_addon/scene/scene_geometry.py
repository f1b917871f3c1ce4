"""Cameras and a mesh out of a finished stitch, as numbers for Blender's scene. No bpy.

The world that they stand in has the reference camera at its origin, looking along +y with z up, and the baseline as its
unit, unless told otherwise; under a round panorama it is the panorama that looks along +y, levelled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.cameras.blender_camera import BlenderLens, lens_for, matrix_world_of
from ...core.cameras.projective import homogeneous
from ...core.panorama.projection import Projection
from ...core.raster.arrays import Array

# From the reference camera's axes (x right, y down, z ahead) to a world with z up.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
# R, t of the reference camera.
ORIGIN = np.eye(3), np.zeros(3)


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
    """A camera of the scene: its lens (with the picture's size), and its world matrix (4, 4)."""

    name: str
    lens: BlenderLens | RoundLens
    matrix_world: Array


@dataclass(frozen=True)
class DepthMesh:
    """vertices (N, 3) in the world; faces (M, 4) of vertex indices, seen from the camera counter-clockwise; uvs (N, 2)
    of the vertices in the panorama."""

    vertices: Array
    faces: NDArray[np.int32]
    uvs: Array


def projection_of(known: dict[str, Any]) -> Projection | None:
    """How the canvas px of a result's round panorama become rays (its plane is the canvas); None for a flat one."""
    told = known["report"]["canvas"]["projection"]
    if told["kind"] == "perspective":
        return None
    x, y = told["centre"]
    K = matrix(known["geometry"]["K"])
    return Projection(told["kind"], float(told["focal_px"]), (float(x), float(y)), matrix(told["rotation"]), K)


def axes(known: dict[str, Any]) -> Array:
    """The rotation (3, 3) from the reference camera's axes to the world's."""
    projection = projection_of(known)
    return UPRIGHT if projection is None else UPRIGHT @ projection.rotation.T


def placed_cameras(known: dict[str, Any], baseline: float = 1.0) -> list[PlacedCamera]:
    """The reference's, the target's and the panorama's camera; the target's only where the model knows its place.

    known: a result's `geometry` (K, K_prime, R, t, full_sizes, K_canvas, canvas) and `report`; baseline: distance of
    the cameras, in the scene's units.
    """
    geometry, world = known["geometry"], axes(known)
    sizes = [(int(width), int(height)) for width, height in geometry["full_sizes"]]
    wanted: list[tuple[str, BlenderLens | RoundLens, tuple[Array, Array]]] = [
        ("Reference", flat_lens(geometry["K"], sizes[0]), ORIGIN)
    ]
    if (pose := target_pose(geometry, baseline)) is not None:
        wanted.append(("Target", flat_lens(geometry["K_prime"], sizes[1]), pose))
    canvas, projection = (int(geometry["canvas"][0]), int(geometry["canvas"][1])), projection_of(known)
    if projection is None:
        wanted.append(("Panorama", flat_lens(geometry["K_canvas"], canvas), ORIGIN))
    else:
        wanted.append(("Panorama", round_lens(projection, canvas), (projection.rotation.T, np.zeros(3))))
    return [PlacedCamera(name, lens, in_world(R, t, world)) for name, lens, (R, t) in wanted]


def flat_lens(K: Any, size: tuple[int, int]) -> BlenderLens:
    """The lens of a result's K for a picture of (W, H) px."""
    return lens_for(square_pixels(matrix(K)), size)


def round_lens(projection: Projection, size: tuple[int, int]) -> RoundLens:
    """The panoramic lens that sees a canvas of (W, H) px."""
    edges = np.array([[-0.5, -0.5], [size[0] - 0.5, size[1] - 0.5]])
    (left, top), (right, bottom) = (edges - np.array(projection.centre)) / projection.focal
    return RoundLens(projection.kind, size, (float(left), float(right)), (float(-bottom), float(-top)))


def target_pose(geometry: dict[str, Any], baseline: float = 1.0) -> tuple[Array, Array] | None:
    """R (3, 3), t (3,) of the target camera in the reference camera's frame, or None where it is not known."""
    R, t = matrix(geometry["R"]), matrix(geometry["t"])
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


def depth_mesh(known: dict[str, Any], baseline: float = 1.0, farthest: float = 20.0) -> DepthMesh:
    """The panorama as a surface: nodes on their rays from the panorama's camera, at the depth that was found.

    known: a result's `geometry`, `report` and `depth`: `columns`, `rows`, `inverse_depth` (in 1/baseline) and `shows`,
    row by row from the top, nodes corner to corner of the canvas; farthest: × the median depth, where everything beyond
    ends, infinity (d ≤ 0) too. A face is left out where the panorama shows nothing at all four corners, or its depth is
    not known. Raises ValueError where nothing is left.
    """
    grid, (width, height) = known["depth"], known["geometry"]["canvas"]
    columns, rows = int(grid["columns"]), int(grid["rows"])
    d = matrix(grid["inverse_depth"]).ravel()
    shows = np.asarray(grid["shows"], bool).ravel()
    x, y = np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    there = np.isfinite(d)
    near = d[there & shows & (d > 0)]
    if not near.size:
        raise ValueError("the panorama has no depth: nothing of it lies nearer than infinity")
    d = np.maximum(np.where(there, d, 0.0), float(np.median(near)) / farthest)
    vertices = (rays(known, pixels) / d[:, None] * baseline) @ axes(known).T

    at = np.arange(columns * rows).reshape(rows, columns)
    # the lower left corner first, then on to the right
    corners = np.stack([at[1:, :-1], at[1:, 1:], at[:-1, 1:], at[:-1, :-1]], axis=-1).reshape(-1, 4)
    faces = corners[shows[corners].any(axis=1) & there[corners].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    uvs = np.stack([(pixels[:, 0] + 0.5) / width, 1 - (pixels[:, 1] + 0.5) / height], axis=-1)
    return DepthMesh(vertices[used], faces.reshape(-1, 4).astype(np.int32), uvs[used])


def rays(known: dict[str, Any], pixels: Array) -> Array:
    """What canvas px (N, 2) show, in the reference camera's frame, as long as 1/d is to be taken: with z = 1 in a flat
    panorama, unit rays in a round one."""
    projection = projection_of(known)
    if projection is not None:
        return projection.rays(pixels)
    return homogeneous(pixels) @ np.linalg.inv(square_pixels(matrix(known["geometry"]["K_canvas"]))).T


def matrix(values: Any) -> Array:
    """Numbers of a result as an array; JSON has null where an array has NaN."""
    return np.array(values, dtype=object).astype(np.float64)
