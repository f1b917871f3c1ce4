"""transforms.json: the cameras as NeRF programs take them, by OpenGL's axes, camera to world."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...cameras.programs.transforms import FLIPPED
from ..camera_file import FoundCamera
from .opencv_lens import opencv_model


def transforms_table(found: list[FoundCamera]) -> dict[str, Any]:
    """The content of the file, JSON-ready but for arrays; the world is the first camera's frame (y down, z ahead).

    Raises
    ------
    UnwritableOutput
        A lens that these programs do not have.
    """
    frames = []
    for one in found:
        assert one.R is not None and one.t is not None
        model, values = opencv_model(one, "transforms.json")
        names = ("k1", "k2", "k3", "k4") if model == "OPENCV_FISHEYE" else ("k1", "k2", "p1", "p2", "k3")
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = one.R.T @ FLIPPED, -one.R.T @ one.t
        K, (width, height) = one.camera.K, one.camera.size
        frames.append({
            "file_path": one.name, "camera_model": model.removeprefix("FULL_"), "w": width, "h": height,
            "fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2] + 0.5, "cy": K[1, 2] + 0.5,
            **dict(zip(names, values, strict=False)), "transform_matrix": matrix,
        })  # fmt: skip
    return {"frames": frames}
