"""Cameras and a mesh out of a finished stitch, as numbers for Blender's scene. No bpy.

The world that they stand in has the reference camera at its origin, looking along +y with z up, and the baseline as its
unit, unless told otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.blender_camera import BlenderLens, lens_for, matrix_world_of
from ..core.epipolar import Array, homogeneous

# From the reference camera's axes (x right, y down, z ahead) to a world with z up.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
# R, t of the reference camera.
ORIGIN = np.eye(3), np.zeros(3)


@dataclass(frozen=True)
class PlacedCamera:
    """A camera of the scene: its lens (with the picture's size), and its world matrix (4, 4)."""

    name: str
    lens: BlenderLens
    matrix_world: Array


@dataclass(frozen=True)
class DepthMesh:
    """vertices (N, 3) in the world; faces (M, 4) of vertex indices, seen from the camera counter-clockwise; uvs (N, 2)
    of the vertices in the panorama."""

    vertices: Array
    faces: NDArray[np.int32]
    uvs: Array


def placed_cameras(geometry: dict[str, Any], baseline: float = 1.0) -> list[PlacedCamera]:
    """The reference's, the target's and the panorama's camera; the target's only where the model knows its place.

    geometry: of a result (K, K_prime, R, t, full_sizes, K_canvas, canvas); baseline: distance of the cameras, in the
    scene's units. Raises ValueError where a picture's pixels are not square.
    """
    sizes = [(int(width), int(height)) for width, height in geometry["full_sizes"]]
    wanted = [("Reference", geometry["K"], sizes[0], ORIGIN)]
    if (pose := target_pose(geometry, baseline)) is not None:
        wanted.append(("Target", geometry["K_prime"], sizes[1], pose))
    width, height = geometry["canvas"]
    wanted.append(("Panorama", geometry["K_canvas"], (int(width), int(height)), ORIGIN))
    return [
        PlacedCamera(name, lens_for(square_pixels(matrix(K)), size), in_world(R, t))
        for name, K, size, (R, t) in wanted
    ]  # fmt: skip


def target_pose(geometry: dict[str, Any], baseline: float = 1.0) -> tuple[Array, Array] | None:
    """R (3, 3), t (3,) of the target camera in the reference camera's frame, or None where it is not known."""
    R, t = matrix(geometry["R"]), matrix(geometry["t"])
    if not (np.isfinite(R).all() and np.isfinite(t).all()):
        return None
    return R, t * baseline


def in_world(R: Array, t: Array) -> Array:
    """The world matrix (4, 4) of a camera with the pose R, t relative to the reference camera."""
    return matrix_world_of(R @ UPRIGHT.T, t)


def square_pixels(K: Array) -> Array:
    """K with one focal length, the geometric mean: Blender's camera has no other. A picture that was resized to whole
    pixels has two that differ in their fourth digit."""
    out = K.copy()
    out[0, 0] = out[1, 1] = np.sqrt(K[0, 0] * K[1, 1])
    out[0, 1] = 0.0
    return out


def depth_mesh(
    grid: dict[str, Any], K_canvas: Array, canvas: tuple[int, int], baseline: float = 1.0, farthest: float = 20.0
) -> DepthMesh:
    """The panorama as a surface: nodes on their rays from the panorama's camera, at the depth that was found.

    grid: `columns`, `rows`, `inverse_depth` (in 1/baseline) and `shows`, row by row from the top, nodes corner to
    corner of the canvas; canvas (W, H) px; farthest: × the median depth, where everything beyond ends, infinity (d ≤ 0)
    too. A face is left out where the panorama shows nothing at all four corners, or its depth is not known. Raises
    ValueError where nothing is left.
    """
    columns, rows = int(grid["columns"]), int(grid["rows"])
    d = matrix(grid["inverse_depth"]).ravel()
    shows = np.asarray(grid["shows"], bool).ravel()
    width, height = canvas
    x, y = np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows)
    pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    known = np.isfinite(d)
    near = d[known & shows & (d > 0)]
    if not near.size:
        raise ValueError("the panorama has no depth: nothing of it lies nearer than infinity")
    d = np.maximum(np.where(known, d, 0.0), float(np.median(near)) / farthest)
    rays = homogeneous(pixels) @ np.linalg.inv(K_canvas).T
    vertices = (rays / d[:, None] * baseline) @ UPRIGHT.T

    at = np.arange(columns * rows).reshape(rows, columns)
    # the lower left corner first, then on to the right
    corners = np.stack([at[1:, :-1], at[1:, 1:], at[:-1, 1:], at[:-1, :-1]], axis=-1).reshape(-1, 4)
    faces = corners[shows[corners].any(axis=1) & known[corners].all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    uvs = np.stack([(pixels[:, 0] + 0.5) / width, 1 - (pixels[:, 1] + 0.5) / height], axis=-1)
    return DepthMesh(vertices[used], faces.reshape(-1, 4).astype(np.int32), uvs[used])


def matrix(values: Any) -> Array:
    """Numbers of a result as an array; JSON has null where an array has NaN."""
    return np.array(values, dtype=object).astype(np.float64)
