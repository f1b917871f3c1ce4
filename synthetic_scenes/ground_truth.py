"""What is true of a pair of known cameras, and how far an estimate is from it. No bpy."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.cameras.projective import (
    distance_to_line,
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    project,
    rotation_angle,
)
from ..core.cameras.two_view import TwoView
from ..core.raster.arrays import Array
from ..core.raster.sampling import fetch
from .scene_camera import SceneCamera

# Depths that differ by less than this share are the same surface's.
SAME_DEPTH = 5e-3
# Metres: Blender keeps places in single precision.
SAME_PLACE = 1e-6


@dataclass(frozen=True)
class TrueGeometry:
    """The pair's true K, K', R, t (|t| = 1), baseline (in the scene's unit), F, H_inf and e'."""

    K: Array
    K_prime: Array
    R: Array
    t: Array
    baseline: float

    @staticmethod
    def of(reference: SceneCamera, target: SceneCamera) -> TrueGeometry:
        """From two cameras' world-to-camera poses; at the same place t = 0 and F = NaN."""
        R = target.R @ reference.R.T
        t = target.t - R @ reference.t
        length = float(np.linalg.norm(t))
        if length < SAME_PLACE:
            return TrueGeometry(reference.K, target.K, R, np.zeros(3), 0.0)
        return TrueGeometry(reference.K, target.K, R, t / length, length)

    @property
    def F(self) -> Array:
        """The fundamental matrix, Frobenius norm 1; NaN without a baseline."""
        if not self.baseline:
            return np.full((3, 3), np.nan)
        return fundamental_from_pose(self.K, self.K_prime, self.R, self.t)

    @property
    def H_inf(self) -> Array:
        """K' R K⁻¹."""
        return infinite_homography(self.K, self.K_prime, self.R)

    @property
    def e_prime(self) -> Array:
        """K' t."""
        return self.K_prime @ self.t

    def target_pixels(self, points: NDArray, depth: Array) -> Array:
        """Where the target camera sees the reference pixels (…, 2) of a depth (…,); NaN behind it."""
        ray = homogeneous(points) @ self.H_inf.T + (self.baseline / depth)[..., None] * self.e_prime
        ray[ray[..., 2] <= 0] = np.nan
        return project(ray)


def seen_from(camera: SceneCamera, depth: NDArray, other: SceneCamera) -> tuple[Array, Array]:
    """Where another camera sees what a picture (H, W) of depths shows: its pixels (H, W, 2), NaN behind it, and their
    depths there (H, W).

    depth may be infinite: such points are seen where their direction points.
    """
    height, width = depth.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    rays = homogeneous(np.stack([x, y], axis=-1)) @ (np.linalg.inv(camera.K).T @ camera.R)
    inverse = 1.0 / depth.astype(np.float64)
    # the world point times its inverse depth: finite for infinite depths too
    scaled = (rays + inverse[..., None] * (camera.place - other.place)) @ other.R.T
    with np.errstate(divide="ignore", invalid="ignore"):
        there = scaled[..., 2] / inverse
    seen = scaled @ other.K.T
    seen[seen[..., 2] <= 0] = np.nan
    return project(seen), there


def visible(pixels: Array, there: Array, other_depth: NDArray) -> NDArray[np.bool_]:
    """Which points (H, W) another camera really sees: in its picture, and nothing nearer in front of them.

    pixels, there: from `seen_from`; other_depth: that camera's own depths. Inverse depth is affine in the picture of a
    plane, so that it may be interpolated; beside an edge the mixture hides what lies behind, never what is in front.
    """
    height, width = other_depth.shape
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0).all(axis=-1) & (pixels[..., 0] <= width - 1) & (pixels[..., 1] <= height - 1)
        inside &= there > 0
    x, y = (np.where(inside, pixels[..., k], -1).astype(np.float32) for k in range(2))
    nearest = fetch((1.0 / other_depth).astype(np.float32)[..., None], x, y, cv2.INTER_LINEAR)[..., 0]
    return inside & (1.0 / np.where(inside, there, 1.0) >= (1 - SAME_DEPTH) * nearest - 1e-9)


def inverse_depth_at(depth: NDArray, x: NDArray[np.float32], y: NDArray[np.float32]) -> NDArray[np.float32]:
    """1 / depth (N,) of a picture (H, W) at its pixels x, y (N,), which need not be whole."""
    with np.errstate(divide="ignore"):
        inverse = (1.0 / depth).astype(np.float32)[..., None]
    near, between = (fetch(inverse, x[None], y[None], how)[0, :, 0] for how in (cv2.INTER_NEAREST, cv2.INTER_LINEAR))
    # inverse depth is affine on a plane; across the edge of an object it belongs to nothing
    return np.where(np.abs(between - near) <= SAME_DEPTH * near, between, near)


def steepness(depth: NDArray) -> Array:
    """By what share a depth (H, W) changes from pixel to pixel."""
    inverse = 1.0 / depth.astype(np.float64)
    return np.hypot(*np.gradient(inverse)) / np.maximum(inverse, 1e-9)


def flat(depth: NDArray, reach: int = 2) -> NDArray[np.bool_]:
    """Where no edge of an object is within `reach` px: inverse depth nowhere departs from its neighbours' mean."""
    inverse = (1.0 / depth).astype(np.float32)
    bend = np.zeros(depth.shape, np.float32)
    for axis in (0, 1):
        middle = np.moveaxis(inverse, axis, 0)
        away = np.abs(middle[1:-1] - (middle[2:] + middle[:-2]) / 2) / np.maximum(middle[1:-1], 1e-9)
        np.moveaxis(bend, axis, 0)[1:-1] = np.maximum(np.moveaxis(bend, axis, 0)[1:-1], away)
    size = 2 * reach + 1
    return cv2.dilate((bend > SAME_DEPTH).astype(np.uint8), np.ones((size, size), np.uint8)) == 0


def pose_errors(view: TwoView, truth: TrueGeometry, target_size: tuple[int, int]) -> dict[str, float]:
    """rotation_deg, baseline_deg (direction of t), focal_percent, h_inf_px and h_inf_p95_px (transfer error, median and
    95th percentile), f_px (mean line distance; NaN without a baseline).

    h_inf_px: a grid over the target, taken back to the reference by the true H_inf and forward again by the estimated
    one.
    """
    x, y = np.meshgrid(np.linspace(0, target_size[0] - 1, 20), np.linspace(0, target_size[1] - 1, 20))
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    at_infinity = homogeneous(grid) @ np.linalg.inv(truth.H_inf).T
    transfer = np.linalg.norm(project(at_infinity @ view.H_inf.T) - grid, axis=1)
    off_line = np.nan
    if truth.baseline:
        # at infinity every baseline gives the same lines: one point in three at each of three depths
        depth = truth.baseline * np.resize([3.0, 10.0, 30.0], len(grid))
        seen = truth.target_pixels(grid, depth)
        there = np.isfinite(seen).all(axis=1)
        off_line = float(distance_to_line(view.F, grid[there], seen[there]).mean())
    cosine = float(np.clip(view.t @ truth.t, -1, 1))
    return {
        "rotation_deg": rotation_angle(view.R, truth.R),
        "baseline_deg": float(np.degrees(np.arccos(cosine))),
        "focal_percent": 100 * float(view.K[0, 0] / truth.K[0, 0] - 1),
        "h_inf_px": float(np.median(transfer)),
        "h_inf_p95_px": float(np.percentile(transfer, 95)),
        "f_px": off_line,
    }
