"""What a photograph's file says beyond its pixels: how it was held, and with which lens. Read once for each file.

Blender shows the pixels as they are stored; the engine, and with it every match, works on the upright picture.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from . import stand_ins

if TYPE_CHECKING:
    from ...core.pictures.metadata import Exif

# Files larger than this are not read for what they say only.
LARGEST = 200_000_000


def orientation(image: bpy.types.Image) -> int:
    """EXIF's orientation, 1..8, of the pixels that Blender shows."""
    exif = _exif(image)
    return 1 if exif is None else exif.orientation


def upright_size(image: bpy.types.Image) -> tuple[int, int]:
    """(W, H) px as the engine sees the picture."""
    width, height = image.size
    return (height, width) if orientation(image) >= 5 else (width, height)


def camera_words(image: bpy.types.Image | None, side: str) -> str:
    """What "Automatic" will take as the focal length, before the stitch: source and value in a line."""
    said = "not chosen yet" if image is None else _focal(image) or "no EXIF, found from the matches"
    return f"{side.capitalize()}: {said}"


def _focal(image: bpy.types.Image) -> str:
    """"" where the file says nothing."""
    exif = _exif(image)
    if exif is None or not all(image.size):
        return ""
    from ...core.cameras.sources import CameraRequest, cameras_for

    size, upright = upright_size(image), exif.upright()
    camera = cameras_for(CameraRequest(), (image.name, image.name), (size, size), (upright, upright))[0][0]
    return "" if camera.assumed else f"{camera.focal:.0f} px, {camera.source}"


def _exif(image: bpy.types.Image) -> Exif | None:
    """None where there is no file to read, or none that says anything."""
    photograph = stand_ins.photograph_of(image)
    if photograph is not None:  # what stands in for it is upright
        exif = _of_path(photograph)
        return None if exif is None else replace(exif.upright(), orientation=1)
    if image.source != "FILE" or image.is_dirty and not image.filepath:
        return None
    if image.packed_file is not None:
        return _of_packed(image.session_uid, image.packed_file.size)
    if not image.filepath:
        return None
    return _of_path(Path(bpy.path.abspath(image.filepath, library=image.library)))


def _of_path(path: Path) -> Exif | None:
    try:
        stamp = path.stat()
    except OSError:
        return None
    return _of_file(path, stamp.st_mtime_ns) if stamp.st_size <= LARGEST else None


@lru_cache(maxsize=32)
def _of_file(path: Path, _changed: int) -> Exif | None:
    try:
        return _of_bytes(path.read_bytes())
    except OSError:
        return None


@lru_cache(maxsize=32)
def _of_packed(uid: int, _size: int) -> Exif | None:
    image = next(one for one in bpy.data.images if one.session_uid == uid)
    return _of_bytes(image.packed_file.data)


def _of_bytes(data: bytes) -> Exif | None:
    try:
        from ...core.pictures.camera_raw import is_raw, raw_exif
        from ...core.pictures.containers import read_structure
        from ...core.pictures.metadata import read_exif

        if is_raw(data, ""):
            return read_exif(raw_exif(data))
        structure = read_structure(data)
    except (ImportError, ValueError):  # a broken library is the panel's first line; here it is no more than silence
        return None
    return read_exif(structure.exif) if structure is not None else None
