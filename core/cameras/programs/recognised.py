"""Which program a file of cameras is of, by its content."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...system.errors import BadRequest, UnreadableImage
from .calibrations import is_calibration, is_xml, parsed_xml, read_calibration_xml, read_opencv_yaml
from .colmap import model_folder, read_colmap
from .hugin import is_project, read_cameras
from .lensfun import read_lensfun
from .transforms import read_transforms
from .values import by_our_names, read_data

if TYPE_CHECKING:
    from ...pictures.metadata import Exif

_READ = (
    "a camera file (JSON), transforms.json, a Hugin project (.pto), a calibration of OpenCV or Agisoft, a lensfun "
    "database and the folder of a COLMAP model are read"
)


def read_any(path: Path, names: Sequence[str], exifs: Sequence[Exif] = ()) -> Any:
    """The content of a camera file, whatever program wrote it.

    Parameters
    ----------
    path : Path
        A file, or a folder that holds a COLMAP model. Nothing else is opened, whatever it names.
    names : sequence of str
    exifs : sequence of Exif
        Of the pictures; these choose from a lensfun database.

    Returns
    -------
    dict
        {"cameras": {NAME: CAMERA}}, of a lensfun database with a `LensProfile` for each camera; or what a camera file
        of ours holds, unchecked.

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
    if is_xml(text):
        return {"cameras": _of_xml(text, str(path), names, exifs)}
    if is_calibration(text):
        return {"cameras": dict.fromkeys(names, read_opencv_yaml(text, str(path)))}
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadRequest(f"the camera file is not JSON: {error}; {_READ}") from error
    if isinstance(content, dict) and "frames" in content and "cameras" not in content:
        return {"cameras": by_our_names(read_transforms(content, str(path)), names, str(path))}
    return content


def _of_xml(text: str, place: str, names: Sequence[str], exifs: Sequence[Exif]) -> dict[str, Any]:
    """What XML says of every picture. Raises BadRequest."""
    root = parsed_xml(text, place)
    if root.tag == "lensdatabase":
        return dict(read_lensfun(root, place, names, exifs))
    found = read_calibration_xml(root, place)
    if found is None:
        raise BadRequest(f"{place}: XML that is neither a calibration nor a lensfun database; {_READ}")
    return dict.fromkeys(names, found)
