"""Nuke's .chan: of each frame a camera's place, its rotation in degrees (Z first, then X, then Y) and vertical angle.

Its axes are x right, y up, z back, in the world as in cameras. The frames are the pictures in their order, and then the
panorama.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from ...cameras.programs.transforms import FLIPPED
from ...raster.arrays import Array
from ..camera_file import FoundCamera


def chan_file(found: list[FoundCamera], panorama: tuple[Array, float]) -> bytes:
    """The content of the file.

    Parameters
    ----------
    found : list of FoundCamera
        With poses.
    panorama : ((3, 3), float)
        The rotation from the axes of the panorama to the first camera's, and its height as an angle, rad.
    """
    lines = []
    for number, one in enumerate(found, 1):
        assert one.R is not None and one.t is not None
        angle = 2 * np.arctan(one.camera.size[1] / 2 / one.camera.K[1, 1])
        lines.append(_line(number, one.R.T, -one.R.T @ one.t, angle))
    lines.append(_line(len(found) + 1, panorama[0], np.zeros(3), panorama[1]))
    return "".join(lines).encode()


def _line(number: int, rotation: Array, place: Array, angle: float) -> str:
    """A frame's line, by the rotation from a camera's axes to the world's and its place there."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # straight up or down many angles say the same, and any of them does
        y, x, z = Rotation.from_matrix(FLIPPED @ rotation @ FLIPPED).as_euler("YXZ", degrees=True)
    values = (*(FLIPPED @ place), x, y, z, np.degrees(angle))
    return "\t".join([str(number), *(f"{value:.9f}" for value in values)]) + "\n"
