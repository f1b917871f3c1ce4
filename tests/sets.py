"""Several pictures of the floor and the brick wall, taken in passing: rendered in NumPy, with known cameras."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.two_planes import Textures, render

FOCAL = 260.0


@dataclass(frozen=True)
class PictureSet:
    """Pictures named 1.png, 2.png …, and the cameras that took them."""

    pictures: tuple[Picture, ...]
    cameras: tuple[SceneCamera, ...]


@cache
def make_set(count: int = 4, size: tuple[int, int] = (320, 240), turn: float = 14.0, step: float = 0.25) -> PictureSet:
    """Each picture is taken `step` m further right, a little up or down and nearer, turned right by `turn` degrees."""
    K = np.array([[FOCAL, 0, (size[0] - 1) / 2], [0, FOCAL, (size[1] - 1) / 2], [0, 0, 1.0]])
    level, textures = rotation_from_vector(np.array([0.16, 0.0, 0.0])), Textures(0)
    cameras = []
    for number in range(count):
        away = number - (count - 1) / 2
        turned = rotation_from_vector(np.radians([0.8 * (-1) ** number, -turn * away, 0.7 * number])) @ level
        place = np.array([step * away, 0.08 * (number % 2), 0.1 * step * number])
        cameras.append(SceneCamera(K, turned, -turned @ place, size))
    pictures = [picture_from_array(render(camera, textures), f"{k}.png") for k, camera in enumerate(cameras, 1)]
    return PictureSet(tuple(pictures), tuple(cameras))
