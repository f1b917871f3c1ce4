"""transforms.json, as NeRF programs take it: cameras by OpenGL's axes (x right, y up, z back), camera to world."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...system.errors import BadRequest
from .values import focal, number, shortened, size_of

# Camera models by the names these files have for them, and which coefficients are theirs.
_BROWN = ("k1", "k2", "p1", "p2", "k3")
_ANGULAR = ("k1", "k2", "k3", "k4")
_MODELS = {
    "PINHOLE": (), "SIMPLE_PINHOLE": (), "SIMPLE_RADIAL": ("k1",), "RADIAL": ("k1", "k2"), "OPENCV": _BROWN,
    "OPENCV_FISHEYE": _ANGULAR,
}  # fmt: skip
# From OpenGL's camera axes to OpenCV's.
FLIPPED = np.diag([1.0, -1.0, -1.0])


def read_transforms(content: dict[str, Any], place: str) -> dict[str, Any]:
    """Cameras by the names of their pictures, each as in a camera file.

    Parameters
    ----------
    content : dict
        What the JSON file holds: intrinsics, shared or of each frame, and "frames".
    place : str
        What messages call the file.

    Raises
    ------
    BadRequest
        With the frame and what is wrong with it.
    """
    frames = content["frames"]
    if not isinstance(frames, list) or not frames:
        raise BadRequest(f"{place}: frames must be a list of cameras, one at least")
    entries: dict[str, Any] = {}
    for index, frame in enumerate(frames):
        where = f"{place}, frame {index} (the first is 0)"
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise BadRequest(f"{where}: an object with file_path and transform_matrix is needed")
        if frame["file_path"] in entries:
            raise BadRequest(f"{where}: {frame['file_path']} has a camera already")
        entries[frame["file_path"]] = _intrinsics({**content, **frame}, where) | _pose(frame, where)
    return entries


def _intrinsics(values: dict[str, Any], place: str) -> dict[str, Any]:
    if ("w" not in values) or ("h" not in values):
        raise BadRequest(f"{place}: w and h, the size of the picture in px, are missing")
    width, height = size_of(values["w"], values["h"], place)
    if "fl_x" in values:
        fx = focal(values["fl_x"], place)
        fy = focal(values.get("fl_y", fx), place)
    elif "camera_angle_x" in values:
        angle = number(values["camera_angle_x"], "camera_angle_x", place)
        if not 0 < angle < np.pi:
            raise BadRequest(f"{place}: camera_angle_x is {angle:g}; it is in radians, between 0 and π")
        fx = fy = width / 2 / float(np.tan(angle / 2))
    else:
        raise BadRequest(f"{place}: fl_x (px) or camera_angle_x (rad) is missing")
    # there the middle of the first pixel is at 0.5
    cx, cy = (number(values.get(key, side / 2), key, place) - 0.5 for key, side in (("cx", width), ("cy", height)))
    model = values.get("camera_model", "OPENCV")
    if not isinstance(model, str) or model not in _MODELS:
        raise BadRequest(f"{place}: the camera model {shortened(model)} is not read; {', '.join(_MODELS)} are")
    told = {key: number(values.get(key, 0.0), key, place) for key in (*_BROWN, "k4")}
    strange = [key for key, value in told.items() if value and key not in _MODELS[model]]
    if strange:
        raise BadRequest(f"{place}: {strange[0]} is not 0, which the camera model {model} does not have")
    entry: dict[str, Any] = {"K": [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], "size": [width, height]}
    if model == "OPENCV_FISHEYE":
        entry["lens"] = {"projection": "equidistant", "angular": [told[key] for key in _ANGULAR]}
    else:
        entry["distortion"] = [told[key] for key in _BROWN]
    return entry


def _pose(frame: dict[str, Any], place: str) -> dict[str, Any]:
    """R and t, world to camera, of a frame's camera to world."""
    try:
        matrix = np.asarray(frame.get("transform_matrix"), np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape not in ((4, 4), (3, 4)) or not np.isfinite(matrix).all():
        raise BadRequest(f"{place}: transform_matrix must be 4×4 numbers, camera to world")
    if len(matrix) == 4 and not np.allclose(matrix[3], (0, 0, 0, 1)):
        raise BadRequest(f"{place}: the last row of transform_matrix must be 0, 0, 0, 1")
    R = FLIPPED @ matrix[:3, :3].T
    with np.errstate(over="ignore", invalid="ignore"):  # whether both are sound is asked of every camera file
        return {"R": R, "t": -R @ matrix[:3, 3]}
