"""A floor and a brick wall seen by two known cameras, rendered by ray casting in NumPy: no Blender, no files.

World and camera axes are OpenCV's (x right, y down, z forward); lengths in metres; pixel centres are integers.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import homogeneous, rotation_from_vector
from ..core.raster.arrays import Array
from .scene_camera import SceneCamera

Points = NDArray[np.float32]

WALL_Z, FLOOR_Y = 6.0, 1.3
SAMPLES = 3  # rays per pixel and direction: no aliasing to mislead features


@dataclass(frozen=True)
class Pair:
    """Two cameras and what they see: reference and target, uint8 RGB."""

    reference_camera: SceneCamera
    target_camera: SceneCamera
    reference: NDArray[np.uint8]
    target: NDArray[np.uint8]


def make_pair(
    width: int = 640,
    height: int = 480,
    focal: float | None = None,
    baseline: float = 0.5,
    turn: float = 14.0,
    seed: int = 0,
) -> Pair:
    """A pair with parallax: the target camera stands `baseline` m to the right and is turned by `turn` degrees to the
    right.

    focal: px, default 0.95 × the longer side. seed: of the textures.
    """
    f = focal or 0.95 * max(width, height)
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1.0]])
    level = rotation_from_vector(np.array([0.16, 0.0, 0.0]))
    turned = rotation_from_vector(np.radians([1.0, -turn, 1.5])) @ level
    place = np.array([baseline, -0.1 * baseline, 0.2 * baseline])
    first = SceneCamera(K, level, np.zeros(3), (width, height))
    second = SceneCamera(K, turned, -turned @ place, (width, height))
    textures = Textures(seed)
    return Pair(first, second, render(first, textures), render(second, textures))


def depth_at(camera: SceneCamera, points: NDArray) -> Array:
    """Depth z (…,) in the camera's frame of what its pixels (…, 2) see."""
    ray = homogeneous(points) @ (np.linalg.inv(camera.K).T @ camera.R)
    origin = camera.place
    with np.errstate(divide="ignore", invalid="ignore"):
        to_wall = (WALL_Z - origin[2]) / ray[..., 2]
        to_floor = (FLOOR_Y - origin[1]) / ray[..., 1]
    to_wall, to_floor = (np.where(s > 0, s, np.inf) for s in (to_wall, to_floor))
    return np.minimum(to_wall, to_floor)  # rays have z = 1 in the camera's frame


def render(camera: SceneCamera, textures: Textures) -> NDArray[np.uint8]:
    """What the camera sees, uint8 RGB, SAMPLES² rays a pixel."""
    width, height = camera.size
    total = np.zeros((height, width, 3))
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    for dy in offsets:
        for dx in offsets:
            x, y = np.meshgrid(np.arange(width) + dx, np.arange(height) + dy)
            points = np.stack([x, y], axis=-1)
            depth = depth_at(camera, points)
            world = (homogeneous(points) @ np.linalg.inv(camera.K).T * depth[..., None] - camera.t) @ camera.R
            total += textures.light(world)
    light = np.clip(total / SAMPLES**2, 0, 1)
    coded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)  # sRGB, IEC 61966-2-1
    return np.rint(255 * coded).astype(np.uint8)


class Textures:
    """Bricks with posters on the wall, tiles on the floor, stains everywhere."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.lattice = random.random((256, 256)).astype(np.float32)
        self.posters = [
            (random.uniform(-3.5, 4.0), random.uniform(-1.6, 0.3), random.uniform(0.4, 0.9), random.random(3))
            for _ in range(7)
        ]

    def light(self, world: Array) -> Array:
        """Scene-linear RGB (…, 3) of surface points (…, 3)."""
        on_wall = np.abs(world[..., 2] - WALL_Z) < 1e-6
        out = np.empty(world.shape)
        x, y, z = (world[..., k].astype(np.float32) for k in range(3))
        out[on_wall] = self._wall(x[on_wall], y[on_wall])
        out[~on_wall] = self._floor(x[~on_wall], z[~on_wall])
        return out

    def _wall(self, u: Points, v: Points) -> Points:
        row = np.floor(v / 0.12)
        along = u / 0.3 + 0.5 * (row % 2)
        mortar = (np.abs(along - np.round(along)) < 0.035) | (np.abs(v / 0.12 - np.round(v / 0.12)) < 0.09)
        tint = self._noise(np.floor(along) * 7.31, row * 3.17)
        out = np.where(mortar[..., None], 0.42, np.array([0.42, 0.16, 0.1]) * (0.5 + tint[..., None]))
        for x, y, size, colour in self.posters:
            inside = (np.abs(u - x) < size / 2) & (np.abs(v - y) < 0.65 * size)
            drawn = self._noise(u * 9 / size + 40 * x, v * 9 / size) > 0.5
            out = np.where(inside[..., None], np.where(drawn[..., None], colour, 0.75), out)
        return out * (0.35 + 1.1 * self._stains(u, v)[..., None])

    def _floor(self, u: Points, v: Points) -> Points:
        tile = (np.floor(u / 0.4) + np.floor(v / 0.4)) % 2
        tint = self._noise(np.floor(u / 0.4) * 5.7, np.floor(v / 0.4) * 9.1)
        out = (0.14 + 0.3 * tile + 0.25 * tint)[..., None] * np.array([0.9, 0.95, 1.0])
        return out * (2 * self._stains(2 * u, 2 * v + 50) ** 1.5)[..., None]

    def _stains(self, u: Points, v: Points) -> Points:
        octaves = [self._noise(u * 2.0**k + 17 * k, v * 2.0**k) * 0.8**k for k in range(6)]
        return np.sum(octaves, axis=0) / 3.69

    def _noise(self, u: Points, v: Points) -> Points:
        """Smooth noise in [0, 1] that repeats every 250 units, at points (N,)."""
        u, v = np.broadcast_arrays(u, v)
        rows = -(-u.size // 1024)  # remap takes pictures, not lists
        x, y = (np.resize(np.mod(a, np.float32(250)) + np.float32(2), (rows, 1024)) for a in (u, v))
        return cv2.remap(self.lattice, x, y, cv2.INTER_LINEAR).ravel()[: u.size]
