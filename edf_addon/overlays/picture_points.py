"""Which point of a picture a point of a panorama is, from what a result keeps. No bpy."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.cameras.camera import Camera
from ...core.cameras.lens import distort
from ...core.cameras.projective import homogeneous
from ...core.raster.arrays import Array
from ..scene.scene_geometry import matrix, projection_of, viewpoint_of
from .overlay_geometry import cameras_of, depth_at


def in_picture(known: dict[str, Any], points: Array, number: int) -> Array:
    """px (N, 2) of a full upright picture of a result where it shows what the panorama shows at px (N, 2); NaN behind
    its camera. number: of the picture among those that are used, the reference's or viewpoint's first."""
    geometry, projection, viewpoint = known["geometry"], projection_of(known), viewpoint_of(known)
    camera, R, t = posed_cameras(geometry)[number]
    d = depth_at(known, points)
    if projection is not None:
        rays = projection.rays(points)
    else:
        rays = homogeneous(points) @ np.linalg.inv(matrix(geometry["K_canvas"])).T
        if "cameras" in geometry:  # of a set d is counted along the ray
            rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    from_first = rays if viewpoint is None else rays + d[:, None] * viewpoint.place(rays)
    seen = from_first @ R.T + d[:, None] * t
    ahead = np.where(seen[:, 2:] > 1e-6, seen[:, 2:], np.nan)
    return distort((seen / ahead @ camera.K.T)[:, :2], camera)


def count(known: dict[str, Any]) -> int:
    """How many pictures a result knows the cameras of."""
    return len(posed_cameras(known["geometry"]))


def posed_cameras(geometry: dict[str, Any]) -> list[tuple[Camera, Array, Array]]:
    """Camera, rotation and translation of each picture, in the frame of the first; lenses of more than two are straight
    enough for what is pointed at by hand."""
    if "cameras" not in geometry:
        first, second = cameras_of(geometry).values()
        return [(first, np.eye(3), np.zeros(3)), (second, matrix(geometry["R"]), matrix(geometry["t"]))]
    sizes = [(int(width), int(height)) for width, height in geometry["full_sizes"]]
    return [
        (Camera(matrix(one["K"]), size, "", 0.0), matrix(one["R"]), matrix(one["t"]))
        for one, size in zip(geometry["cameras"], sizes, strict=True)
    ]
