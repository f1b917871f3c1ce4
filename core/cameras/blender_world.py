"""How an equirectangular panorama lies in Blender's World. No bpy.

Blender's Environment Texture has world +x in the middle of the picture, −y a quarter to the right and +z on top; tried
by rendering. What a panorama needs to surround the scene as the reference camera saw it: an Environment Texture whose
Vector comes from a Mapping node (type Point) with the Rotation below, whose Vector comes from Texture Coordinate ▸
Generated. With that rotation zero, the panorama's middle is seen along world +x. A panoramic camera (Equirectangular,
no shift) with the reference camera's world matrix sees the panorama of level 0, 0, 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array
from .blender_camera import pose_of

# From a panorama's axes (x right, y down, z ahead) to those of Blender's Environment Texture.
_TEXTURE_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def world_rotation(matrix_world: NDArray[Any], rotation: NDArray[Any]) -> Array:
    """The rotation (3, 3) that the Mapping node takes as XYZ Euler angles (mathutils: Matrix(…).to_euler("XYZ")).

    matrix_world (4, 4): of the reference camera as it stands in the scene; rotation (3, 3): from the panorama's axes to
    the reference camera's, the report's `canvas.projection.rotation`.
    """
    R, _ = pose_of(matrix_world)
    return _TEXTURE_AXES @ np.asarray(rotation, np.float64).T @ R
