"""Which program a file of cameras is of, by its content."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...system.errors import BadRequest, UnreadableImage
from .colmap import model_folder, read_colmap
from .hugin import is_project, read_cameras
from .transforms import read_transforms
from .values import by_our_names, read_data

_READ = "a camera file (JSON), transforms.json, a Hugin project (.pto) and the folder of a COLMAP model are read"


def read_any(path: Path, names: Sequence[str]) -> Any:
    """The content of a camera file, whatever program wrote it.

    Parameters
    ----------
    path : Path
        A file, or a folder that holds a COLMAP model. Nothing else is opened, whatever it names.
    names : sequence of str
        Of the pictures.

    Returns
    -------
    dict
        {"cameras": {NAME: CAMERA}}, or what a camera file of ours holds, unchecked.

    Raises
    ------
    BadRequest
        For the content, with the line and what is wrong there.
    UnreadableImage
        For the file, or a folder that holds no model.
    """
    folder = model_folder(path)
    if folder is not None:
        return {"cameras": by_our_names(read_colmap(folder), names, str(folder))}
    if path.is_dir():
        raise UnreadableImage(f"{path}: no COLMAP model in it: cameras and images, both .txt or both .bin, are needed")
    data = read_data(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadRequest(f"{path}: not a text; {_READ}") from error
    if is_project(text):
        return {"cameras": by_our_names(read_cameras(text, str(path)), names, str(path))}
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadRequest(f"the camera file is not JSON: {error}; {_READ}") from error
    if isinstance(content, dict) and "frames" in content and "cameras" not in content:
        return {"cameras": by_our_names(read_transforms(content, str(path)), names, str(path))}
    return content
