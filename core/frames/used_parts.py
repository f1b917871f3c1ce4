"""Parts of pictures that their given cameras leave out: what a file masks, and what lies too far from a lens's axis."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import unused, used_angle
from ..cameras.sources import CameraRequest, camera_table, cameras_for
from ..pictures.masks import without
from ..pictures.picture import Picture
from ..system.errors import BadRequest
from .frame import Frame, size_of


def within_lenses(frame: Frame, request: CameraRequest) -> Frame:
    """The frame without what a camera file masks (`ignore`), and without what the pictures show beyond the angle up to
    which their lenses are used.

    Parameters
    ----------
    frame : Frame
    request : CameraRequest
        Only its camera file matters, beside what the frame knows.

    Returns
    -------
    Frame
        With a warning about each picture that loses something.

    Raises
    ------
    BadRequest, UnreadableImage
        About the camera file.
    """
    if request.cameras is None and not any(camera is not None and camera.bent for camera in frame.known):
        return frame
    exifs = frame.exifs
    table = {} if request.cameras is None else camera_table(request.cameras, frame.names, exifs)[0]
    cameras, _ = cameras_for(request, frame.names, frame.full_sizes, exifs, frame.known)
    pictures: list[Picture] = []
    warnings: list[str] = []
    lost: dict[float, list[str]] = {}
    for picture, camera, full in zip(frame.pictures, cameras, frame.full_sizes, strict=True):
        entry = table.get(picture.name)
        if isinstance(entry, dict) and entry.get("ignore"):
            picture = without(picture, _masked(entry, picture, full))
        beyond = unused(camera.resized(size_of(picture)))
        pictures.append(picture if beyond is None else without(picture, beyond))
        if camera.lens is not None and beyond is not None:
            lost.setdefault(float(np.degrees(used_angle(camera.lens))), []).append(picture.name)
    for degrees, names in lost.items():
        listed = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
        warnings.append(
            f"what is shown more than {degrees:.0f}° from the lens's axis is left out of {listed}: the lens cannot be "
            "inverted there, or stretches it too much"
        )
    return replace(frame, pictures=tuple(pictures), warnings=(*frame.warnings, *warnings))


def _masked(entry: dict[str, Any], picture: Picture, full: tuple[int, int]) -> NDArray[np.bool_]:
    """Where polygons of a camera's entry hide its picture (H, W), which has so many px in full."""
    about, size = np.array(entry.get("size", full), float), size_of(picture)
    try:
        polygons = [np.asarray(one, np.float64).reshape(-1, 2) for one in entry["ignore"]]
    except (TypeError, ValueError, OverflowError):
        polygons = [np.full((1, 2), np.nan)]
    if not all(len(one) > 2 and np.isfinite(one).all() for one in polygons):
        raise BadRequest(f"the camera of {picture.name}: ignore must be polygons [[x, y], …], px")
    hidden = np.zeros(size[::-1], np.uint8)
    for one in polygons:
        corners = np.clip((one + 0.5) * (size / about) - 0.5, -1e4, 1e5)
        cv2.fillPoly(hidden, [np.rint(corners).astype(np.int32)], (1,))
    return hidden > 0
