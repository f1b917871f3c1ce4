"""A box-shaped room with a ball in it, seen by ray casting in NumPy: what Blender would have rendered, at once."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.synthetic_scenes.passes import Passes
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera

LOW, HIGH = np.array([-3.0, -3.0, 0.0]), np.array([3.0, 4.0, 2.8])
BALL, RADIUS = np.array([0.5, 2.0, 1.6]), 0.35


def hit(place: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Distance (…,) to what unit directions (…, 3) from a place meet first."""
    with np.errstate(divide="ignore"):
        walls = np.where(directions > 0, HIGH - place, LOW - place) / directions
    along = directions @ (BALL - place)
    left = along**2 - ((BALL - place) @ (BALL - place) - RADIUS**2)
    ball = np.where((left > 0) & (along > 0), along - np.sqrt(np.maximum(left, 0)), np.inf)
    return np.minimum(walls.min(axis=-1), ball)


def passes_along(place: np.ndarray, directions: np.ndarray, ahead: np.ndarray) -> Passes:
    """What is seen along unit directions (H, W, 3); ahead (H, W): length of each along the camera's axis."""
    away = hit(place, directions)
    position = place + away[..., None] * directions
    light = 0.5 + 0.4 * np.sin(position @ np.array([[6.0, 3, 1], [2, 5, 3], [3, 2, 6]]))
    depth = away * ahead
    on_ball = np.linalg.norm(position - BALL, axis=-1) < RADIUS + 1e-6
    return Passes(*(part.astype(np.float32) for part in (light, depth, position)), on_ball.astype(np.uint8))


def lines() -> np.ndarray:
    """Ends (12, 2, 3) of the edges in which its walls meet."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    ends = [(a, b) for k, a in enumerate(corners) for b in corners[k + 1 :] if np.abs(a - b).sum() == 1]
    return LOW + np.array(ends) * (HIGH - LOW)


def directions_of(camera: SceneCamera) -> np.ndarray:
    width, height = camera.size
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
    rays = homogeneous(pixels) @ np.linalg.inv(camera.K).T @ camera.R
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def camera_passes(camera: SceneCamera) -> Passes:
    directions = directions_of(camera)
    return passes_along(camera.place, directions, directions @ camera.R[2])


def sphere_passes(sphere: SphereCamera) -> Passes:
    directions = sphere.all_directions()
    return passes_along(sphere.place, directions, np.ones(directions.shape[:2]))


def camera_rays(camera: SceneCamera) -> np.ndarray:
    """[x, y, depth] of a few pixels."""
    random = np.random.default_rng(0)
    x, y = (random.integers(0, side, 100) for side in camera.size)
    directions = directions_of(camera)[y, x]
    return np.column_stack([x, y, hit(camera.place, directions) * (directions @ camera.R[2])])


def sphere_rays(sphere: SphereCamera, cameras: list[SceneCamera]) -> np.ndarray:
    """[x, y, distance, free share of the way from each camera, …] of a few pixels."""
    random = np.random.default_rng(0)
    x, y = (random.integers(0, side, 4000) for side in sphere.size)
    directions = sphere.directions(x.astype(float), y.astype(float))
    away = hit(sphere.place, directions)
    points = sphere.place + away[:, None] * directions
    columns = [x, y, away]
    for camera in cameras:
        way = points - camera.place
        length = np.linalg.norm(way, axis=-1)
        columns.append(np.minimum(1, hit(camera.place, way / length[:, None]) / length))
    return np.column_stack(columns)
