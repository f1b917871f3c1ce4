"""Which files are meant where a folder or a pattern stands for pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from glob import glob
from pathlib import Path

from ..system.errors import BadRequest, UnreadableImage
from .camera_raw import RAW_SUFFIXES

# Endings of what cameras write beside a RAW file, as the same picture once more.
_BESIDE_RAW = frozenset((".jpg", ".jpeg", ".heic", ".heif", ".hif"))
# Endings of the files that are taken for pictures without being named.
SUFFIXES = frozenset((".png", ".tif", ".tiff", ".exr", ".hdr", ".webp", ".bmp")) | _BESIDE_RAW | RAW_SUFFIXES


def listed(paths: Sequence[Path]) -> list[Path]:
    """The files that paths stand for.

    Parameters
    ----------
    paths : sequence of Path
        Files, which are taken as they are; folders, for the pictures in them; and patterns like IMG_*.jpg, for those
        that match. What is not named itself counts as a picture by its ending, and hidden files do not; it is sorted as
        people count: 2 before 10. Of a picture that a camera wrote as RAW and as JPEG or HEIC the RAW file is meant.

    Returns
    -------
    list of Path
        In the order of the paths.

    Raises
    ------
    UnreadableImage
        Files that do not exist, all of them named, or a folder that cannot be read.
    BadRequest
        A folder or a pattern that stands for no picture.
    """
    files = [file for path in paths for file in _meant_by(path)]
    missing = [str(file) for file in files if not file.exists()]
    if missing:
        raise UnreadableImage(f"{', '.join(missing)}: no such file or folder; check the name")
    return files


def natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    """A key that sorts files by their names as people count: numbers by their value, without regard to case."""
    parts = re.findall(r"\d+|\D+", path.name.casefold())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name


def each_once(files: Sequence[Path]) -> list[Path]:
    """The same without what a camera wrote beside a RAW file."""
    raw = {one.with_suffix("") for one in files if one.suffix.lower() in RAW_SUFFIXES}
    return [one for one in files if one.suffix.lower() not in _BESIDE_RAW or one.with_suffix("") not in raw]


def _meant_by(path: Path) -> Iterator[Path]:
    if path.is_dir():
        try:
            found = list(path.iterdir())
        except OSError as error:
            raise UnreadableImage(f"the folder {path} cannot be read: {error.strerror}") from error
        what = "in this folder"
    elif path.exists() or not re.search(r"[*?\[]", str(path)):
        yield path
        return
    else:
        found, what = [Path(one) for one in glob(str(path))], "of that name"
    pictures = sorted(filter(_is_picture, found), key=lambda one: (one.parent, natural(one)))
    pictures = each_once(pictures)
    if not pictures:
        raise BadRequest(f"{path}: no pictures {what} (files that end in {', '.join(sorted(SUFFIXES))})")
    yield from pictures


def _is_picture(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()
