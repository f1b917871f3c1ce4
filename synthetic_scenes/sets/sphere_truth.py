"""What is true of a set: where each camera sees what the sphere at the viewpoint shows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.cameras.projective import project
from ...core.raster.arrays import Array
from ..scene_camera import SceneCamera
from .bent_lens import bent
from .sphere_camera import SphereCamera


def seen_by(camera: SceneCamera, sphere: SphereCamera, directions: Array, distance: NDArray) -> tuple[Array, Array]:
    """Where a camera sees what lies `distance` (…), inf too, along directions (…, 3) from the sphere's place: its
    pixels (…, 2), NaN behind it, and their depths there (…)."""
    inverse = 1.0 / distance.astype(np.float64)
    # the point times its inverse distance: finite for infinite ones too
    scaled = directions @ camera.R.T + inverse[..., None] * (camera.R @ sphere.place + camera.t)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = scaled[..., 2] / inverse
    seen = scaled @ camera.K.T
    seen[seen[..., 2] <= 0] = np.nan
    return bent(project(seen), camera), depth


def in_frame(pixels: Array, camera: SceneCamera) -> NDArray[np.bool_]:
    """Which pixels (…, 2) lie in a camera's picture."""
    with np.errstate(invalid="ignore"):
        inside: NDArray[np.bool_] = ((pixels >= 0) & (pixels <= np.array(camera.size) - 1)).all(axis=-1)
    return inside
