"""Which parts of pictures their given cameras leave out: what lies too far from a lens's axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..cameras.lens import unused, used_angle
from ..cameras.sources import CameraRequest, read_camera_file
from ..pictures.masks import without
from ..pictures.picture import Picture
from .frame import Frame, size_of


def within_lenses(frame: Frame, request: CameraRequest) -> Frame:
    """The frame without what the pictures show beyond the angle up to which their lenses are used.

    Parameters
    ----------
    frame : Frame
    request : CameraRequest
        Only its camera file matters.

    Returns
    -------
    Frame
        With a warning about each picture that loses something.

    Raises
    ------
    BadRequest, UnreadableImage
        About the camera file.
    """
    if request.cameras is None:
        return frame
    cameras = read_camera_file(request.cameras, frame.names, frame.full_sizes)
    pictures: list[Picture] = []
    warnings: list[str] = []
    lost: dict[float, list[str]] = {}
    for picture, camera in zip(frame.pictures, cameras, strict=True):
        beyond = None if camera is None else unused(camera.resized(size_of(picture)))
        pictures.append(picture if beyond is None else without(picture, beyond))
        if camera is not None and camera.lens is not None and beyond is not None:
            lost.setdefault(float(np.degrees(used_angle(camera.lens))), []).append(picture.name)
    for degrees, names in lost.items():
        listed = ", ".join(names[:5]) + (", …" if len(names) > 5 else "")
        warnings.append(
            f"what is shown more than {degrees:.0f}° from the lens's axis is left out of {listed}: the lens cannot be "
            "inverted there, or stretches it too much"
        )
    return replace(frame, pictures=tuple(pictures), warnings=(*frame.warnings, *warnings))
