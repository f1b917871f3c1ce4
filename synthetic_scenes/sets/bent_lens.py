"""What a lens with radial distortion shows: x_d = (1 + k1 r²) x about the principal point, x in focal lengths.

Blender renders through ideal lenses; a bent picture is resampled from an ideal one that sees all of it. Written apart
from the engine's own lens, which is measured by it.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import Array
from ...core.raster.sampling import fetch
from ..passes import Passes
from ..scene_camera import SceneCamera

# Pixels by which the ideal picture is larger than what the bent one needs of it.
MARGIN = 3
STEPS = 30


def bent(pixels: Array, camera: SceneCamera) -> Array:
    """Where (…, 2) a camera's lens shows what an ideal one would at pixels (…, 2); NaN from where it folds back."""
    if not camera.k1:
        return pixels
    ideal = (pixels - camera.K[:2, 2]) / camera.K[0, 0]
    square = (ideal**2).sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        factor = np.where(1 + 3 * camera.k1 * square > 0, 1 + camera.k1 * square, np.nan)
    return camera.K[:2, 2] + camera.K[0, 0] * factor * ideal


def straightened(pixels: Array, camera: SceneCamera) -> Array:
    """The inverse of `bent`, by Newton's steps on the radius."""
    if not camera.k1:
        return pixels
    raw = (pixels - camera.K[:2, 2]) / camera.K[0, 0]
    asked = np.linalg.norm(raw, axis=-1, keepdims=True)
    radius = asked.copy()
    for _ in range(STEPS):
        radius -= (radius * (1 + camera.k1 * radius**2) - asked) / (1 + 3 * camera.k1 * radius**2)
    factor = np.divide(radius, asked, out=np.ones_like(asked), where=asked > 0)
    return camera.K[:2, 2] + camera.K[0, 0] * factor * raw


def ideal_camera(camera: SceneCamera) -> tuple[SceneCamera, tuple[int, int]]:
    """The camera without distortion that sees all that a camera sees, and its first pixel (x, y) in that one's own."""
    if not camera.k1:
        return camera, (0, 0)
    width, height = camera.size
    x, y = np.meshgrid(np.linspace(0, width - 1, 65), np.linspace(0, height - 1, 65))
    needed = straightened(np.stack([x, y], axis=-1), camera)
    left, top = (np.floor(needed.min(axis=(0, 1))).astype(int) - MARGIN).tolist()
    right, bottom = (np.ceil(needed.max(axis=(0, 1))).astype(int) + MARGIN).tolist()
    return camera.widened(left, top, right - left + 1, bottom - top + 1), (left, top)


def bent_camera(ideal: SceneCamera, corner: tuple[int, int], size: tuple[int, int], k1: float) -> SceneCamera:
    """The camera that an ideal one with this first pixel is rendered for."""
    return replace(ideal.widened(-corner[0], -corner[1], *size), k1=k1)


def through_lens(
    passes: Passes, camera: SceneCamera, corner: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Light (H, W, 3) and depth (H, W) of a camera's picture, of the passes of its ideal camera."""
    light = np.maximum(bent_picture(passes.light, camera, corner, cv2.INTER_CUBIC), 0)
    inverse = bent_picture((1 / passes.depth)[..., None], camera, corner, cv2.INTER_LINEAR)[..., 0]
    with np.errstate(divide="ignore"):
        return light, 1 / inverse if camera.k1 else passes.depth


def bent_picture(picture: NDArray, camera: SceneCamera, corner: tuple[int, int], interpolation: int) -> NDArray:
    """A camera's picture (H, W, C), of that of its ideal camera; interpolation: OpenCV's flag."""
    if not camera.k1:
        return picture
    x, y = np.meshgrid(*(np.arange(side, dtype=np.float64) for side in camera.size))
    at = (straightened(np.stack([x, y], axis=-1), camera) - corner).astype(np.float32)
    return fetch(picture, at[..., 0], at[..., 1], interpolation)
