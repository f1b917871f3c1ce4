"""Which form the cameras are written in, by the name that they are given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...panorama.canvas import Canvas
from ...raster.arrays import Array
from ...system.errors import BadRequest, DegenerateGeometry
from ...system.output_files import OutputFiles
from ..camera_file import FoundCamera, camera_table, found_cameras
from ..json_file import json_bytes
from .chan_file import chan_file
from .colmap_model import FILES, colmap_files
from .hugin_frame import frame_of
from .hugin_project import hugin_project
from .points import points_of
from .transforms_file import transforms_table

if TYPE_CHECKING:
    from ...pipeline import StitchResult

TRANSFORMS = "transforms.json"


def form_of(path: Path) -> str:
    """The form that a name asks for: json, transforms, pto, chan, or colmap of a folder. Raises BadRequest."""
    suffix = path.suffix.lower()
    if suffix == ".json":
        return "transforms" if path.name.lower().endswith(TRANSFORMS) else "json"
    if suffix in (".pto", ".chan"):
        return suffix[1:]
    if not suffix or path.is_dir():
        return "colmap"
    raise BadRequest(
        f"{path}: cameras are written as .json, as {TRANSFORMS}, as .pto (Hugin), as .chan (Nuke), or as a COLMAP "
        f"model into a folder, whose name has no ending; not as {suffix}"
    )


def check_cameras(path: Path, files: OutputFiles) -> list[Path]:
    """The single files that cameras of this name are; whether a folder's can be written is asked here. Raises as
    `OutputFiles.check_folder` does, and BadRequest for a form that is not written."""
    if form_of(path) != "colmap":
        return [path]
    files.check_folder(path, FILES)
    return []


def write_cameras(result: StitchResult, path: Path, files: OutputFiles) -> list[str]:
    """Stages the cameras in the form that the name asks for.

    Parameters
    ----------
    result : StitchResult
    path : Path
    files : OutputFiles

    Returns
    -------
    list of str
        Warnings about what the form could not hold.

    Raises
    ------
    DegenerateGeometry
        Another program's form is asked for, and the geometry knows no poses.
    UnwritableOutput
        A lens or a name that the form does not have.
    """
    form = form_of(path)
    if form == "json":
        files.add(path, json_bytes(camera_table(result)))
        return []
    found = found_cameras(result)
    if found[0].R is None:
        raise DegenerateGeometry(
            "no cameras were found for these pictures, only how one looks in the other; write the cameras as .json, or "
            "give the focal length (--focal35, --focal-px)"
        )
    warnings: list[str] = []
    if form == "colmap":
        for name, data in colmap_files(found, points_of(result, found)).items():
            files.add_to_folder(path, name, data)
    elif form == "transforms":
        files.add(path, json_bytes(transforms_table(found)))
    elif form == "chan":
        files.add(path, chan_file(found, _panorama(result.canvas, result.views[0].K)))
    else:
        data, warnings = _project(result, found)
        files.add(path, data)
    return warnings


def _project(result: StitchResult, found: list[FoundCamera]) -> tuple[bytes, list[str]]:
    points = []
    for edge in result.edges:
        matches = result.matches_of(edge).subset(result.used_of(edge))
        points.append((edge.i, edge.j, np.hstack([matches.x, matches.y])))
    return hugin_project(found, frame_of(result.canvas, result.views[0].K), points)


def _panorama(canvas: Canvas, K: Array) -> tuple[Array, float]:
    """From the panorama's axes to the first camera's, and its height, rad: on a sphere it is one of arc."""
    projection = canvas.projection
    if projection is None:
        return np.eye(3), 2 * float(np.arctan(canvas.height / 2 / K[1, 1]))
    share = canvas.height / 2 / projection.focal
    return projection.rotation, 2 * share if projection.kind == "equirectangular" else 2 * float(np.arctan(share))
