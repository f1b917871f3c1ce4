"""Blender's camera settings as intrinsics and pose, and back: the one place where the two conventions meet. No bpy.

Blender's cameras look along −z with y up; ours along +z with y down. Pixel centres are integers. The formulas were
tried against Camera.calc_matrix_camera in every version from 4.2 to 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # Blender renders with these, and has no OpenCV
    from ..raster.arrays import Array

_BLENDERS_AXES = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class BlenderLens:
    """What Blender's camera and render settings say about a perspective lens.

    lens, sensor_width, sensor_height: mm; sensor_fit: AUTO, HORIZONTAL or VERTICAL; shift_x, shift_y: in views;
    resolution (W, H) px before `percentage`; aspect: the pixel's (x, y).
    """

    lens: float
    resolution: tuple[int, int]
    sensor_width: float = 36.0
    sensor_height: float = 24.0
    sensor_fit: str = "AUTO"
    shift_x: float = 0.0
    shift_y: float = 0.0
    percentage: int = 100
    aspect: tuple[float, float] = (1.0, 1.0)

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the picture; Blender truncates."""
        width, height = self.resolution
        return width * self.percentage // 100, height * self.percentage // 100

    @property
    def intrinsics(self) -> Array:
        """K (3, 3) px."""
        (width, height), (ax, ay) = self.size, self.aspect
        fit = self.sensor_fit
        if fit == "AUTO":
            fit = "HORIZONTAL" if width * ax >= height * ay else "VERTICAL"
        # AUTO goes by the sensor's width, whichever side of the picture that is
        sensor = self.sensor_height if self.sensor_fit == "VERTICAL" else self.sensor_width
        view = width if fit == "HORIZONTAL" else height * ay / ax
        fx = self.lens / sensor * view
        cx = width / 2 - self.shift_x * view - 0.5
        cy = height / 2 + self.shift_y * view * ax / ay - 0.5
        return np.array([[fx, 0, cx], [0, fx * ax / ay, cy], [0, 0, 1.0]])


def lens_for(K: Array, size: tuple[int, int], sensor_width: float = 36.0) -> BlenderLens:
    """The lens, with square pixels and its sensor fitted to the width, whose intrinsics for (W, H) px are K.

    Raises ValueError for two focal lengths or skew, which Blender's camera does not have.
    """
    width, height = size
    if abs(K[1, 1] - K[0, 0]) > 1e-9 * K[0, 0] or K[0, 1] != 0:
        raise ValueError("Blender's camera has square pixels and no skew")
    return BlenderLens(
        lens=float(K[0, 0]) * sensor_width / width, resolution=size, sensor_width=sensor_width, sensor_fit="HORIZONTAL",
        shift_x=float(width / 2 - 0.5 - K[0, 2]) / width, shift_y=float(K[1, 2] + 0.5 - height / 2) / width,
    )  # fmt: skip


def pose_of(matrix_world: NDArray[Any]) -> tuple[Array, Array]:
    """R (3, 3), t (3,), world to camera, of a camera object's world matrix (4, 4); its scale does not matter."""
    axes = np.asarray(matrix_world, np.float64)[:3, :3]
    place = np.asarray(matrix_world, np.float64)[:3, 3]
    R = _BLENDERS_AXES @ (axes / np.linalg.norm(axes, axis=0)).T
    return R, -R @ place


def matrix_world_of(R: Array, t: Array) -> Array:
    """The world matrix (4, 4) of a camera object with the pose R, t."""
    out = np.eye(4)
    out[:3, :3] = (_BLENDERS_AXES @ R).T
    out[:3, 3] = -R.T @ t
    return out
