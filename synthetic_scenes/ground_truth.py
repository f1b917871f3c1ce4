"""What is true of a pair of known cameras, and how far an estimate is from it. No bpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.epipolar import (
    Array,
    distance_to_line,
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    project,
    rotation_angle,
)
from ..core.two_view import TwoView
from .two_planes import SceneCamera


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
        """From two cameras' world-to-camera poses."""
        R = target.R @ reference.R.T
        t = target.t - R @ reference.t
        length = float(np.linalg.norm(t))
        return TrueGeometry(reference.K, target.K, R, t / length, length)

    @property
    def F(self) -> Array:
        """The fundamental matrix, Frobenius norm 1."""
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


def pose_errors(view: TwoView, truth: TrueGeometry, target_size: tuple[int, int]) -> dict[str, float]:
    """rotation_deg, baseline_deg (direction of t), focal_percent, h_inf_px (median transfer error), f_px (mean line
    distance).

    h_inf_px: a grid over the target, taken back to the reference by the true H_inf and forward again by the estimated
    one.
    """
    x, y = np.meshgrid(np.linspace(0, target_size[0] - 1, 20), np.linspace(0, target_size[1] - 1, 20))
    grid = np.stack([x.ravel(), y.ravel()], axis=-1)
    at_infinity = homogeneous(grid) @ np.linalg.inv(truth.H_inf).T
    there = project(at_infinity @ view.H_inf.T)
    transfer = float(np.median(np.linalg.norm(there - grid, axis=1)))
    # at infinity every baseline gives the same lines: one point in three at each of three depths
    depth = truth.baseline * np.resize([3.0, 10.0, 30.0], len(grid))
    seen = truth.target_pixels(grid, depth)
    grid, seen = grid[np.isfinite(seen).all(axis=1)], seen[np.isfinite(seen).all(axis=1)]
    cosine = float(np.clip(view.t @ truth.t, -1, 1))
    return {
        "rotation_deg": rotation_angle(view.R, truth.R),
        "baseline_deg": float(np.degrees(np.arccos(cosine))),
        "focal_percent": 100 * float(view.K[0, 0] / truth.K[0, 0] - 1),
        "h_inf_px": transfer,
        "f_px": float(distance_to_line(view.F, grid, seen).mean()),
    }
