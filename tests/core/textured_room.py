"""A box with textured walls, as spheres and flat cameras inside see it: ray-cast, seeded. World and camera axes are
OpenCV's (y down); a camera sees X at R (X − place)."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

HALF = np.array([2.0, 1.3, 2.6])
# Texels a metre.
FINE = 128


@lru_cache(maxsize=4)
def walls(seed: int) -> tuple[np.ndarray, ...]:
    """Textures of the six walls: noise of several scales, float32 levels 0 to 255."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(6):
        noise = rng.random((6 * FINE, 6 * FINE, 3)).astype(np.float32)
        levels = sum(cv2.GaussianBlur(noise, (0, 0), sigma) * sigma for sigma in (2, 5, 15, 40))
        found.append(20 + 215 * (levels - levels.min()) / np.ptp(levels))
    return tuple(found)


def seen(place: np.ndarray, rays: np.ndarray, seed: int = 0) -> np.ndarray:
    """Levels (…, 3) float32 along rays (…, 3) from a place inside."""
    with np.errstate(divide="ignore"):
        ranges = (np.copysign(HALF, rays) - place) / rays
    axis = ranges.argmin(axis=-1)
    hit = place + np.take_along_axis(ranges, axis[..., None], -1) * rays
    out = np.zeros(rays.shape, np.float32)
    for number, texture in enumerate(walls(seed)):
        on = (axis == number // 2) & ((np.take_along_axis(rays, axis[..., None], -1)[..., 0] > 0) == bool(number % 2))
        x, y = (((hit[..., k] + 3.0) * FINE).astype(np.float32) for k in range(3) if k != number // 2)
        out[on] = cv2.remap(texture, x, y, cv2.INTER_LINEAR)[on]
    return out


def turned(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """World to camera of one that looks so many degrees to the right, then up, then is rolled."""
    return Rotation.from_euler("yxz", [yaw, pitch, roll], degrees=True).as_matrix().T


def flat(place: np.ndarray, R: np.ndarray, focal: float, size: tuple[int, int], seed: int = 0) -> np.ndarray:
    """What a pinhole sees, levels uint8; its principal point is the middle."""
    (width, height), twice = size, 2
    v, u = np.mgrid[: twice * height, : twice * width].astype(float)
    x, y = ((u - (twice * width - 1) / 2) / (twice * focal), (v - (twice * height - 1) / 2) / (twice * focal))
    fine = seen(place, np.stack([x, y, np.ones_like(x)], -1) @ R, seed)
    return np.rint(cv2.resize(fine, size, interpolation=cv2.INTER_AREA)).astype(np.uint8)


def sphere_rays(height: int) -> np.ndarray:
    """Rays (H, 2 H, 3) of an equirectangular picture's pixels, in the sphere's axes."""
    v, u = np.mgrid[:height, : 2 * height].astype(float)
    heading, fall = np.pi * ((u + 0.5) / height - 1), np.pi * ((v + 0.5) / height - 0.5)
    return np.stack([np.sin(heading) * np.cos(fall), np.sin(fall), np.cos(heading) * np.cos(fall)], -1)


def sphere(place: np.ndarray, R: np.ndarray, height: int, seed: int = 0) -> np.ndarray:
    """What a sphere at a place sees, levels float32 (H, 2 H, 3)."""
    fine = seen(place, sphere_rays(2 * height) @ R, seed)
    return cv2.resize(fine, (2 * height, height), interpolation=cv2.INTER_AREA)


def circle(place: np.ndarray, R: np.ndarray, radius: int, size: tuple[int, int], seed: int = 0) -> np.ndarray:
    """What an equidistant fisheye of 180° sees, levels uint8: a circle of so many px about the middle, black around."""
    (width, height), focal = size, radius / (np.pi / 2)
    v, u = np.mgrid[:height, :width].astype(float)
    x, y = u - (width - 1) / 2, v - (height - 1) / 2
    off = np.hypot(x, y)
    across = np.sin(off / focal) / np.maximum(off, 1e-9)
    levels = seen(place, np.stack([x * across, y * across, np.cos(off / focal)], -1) @ R, seed)
    return np.where((off < radius)[..., None], np.rint(levels), 0).astype(np.uint8)
