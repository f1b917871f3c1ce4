"""A Hugin project (.pto): its lenses, rotations, masks and control points.

The panorama's axes are x right, y down, z ahead; the middle of the first pixel is at 0. Agrees with Panorama Tools to
1e-5 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...raster.arrays import Array
from ...system.errors import BadRequest
from ..lens_models import Lens, LensProjection
from ..options import INTRINSICS
from ..projective import rotation_from_angles
from .values import number, shortened, size_of, whole

# Numbers of lenses (f of an image) that are read, and of those that are not.
PROJECTIONS = {
    0: LensProjection.RECTILINEAR, 2: LensProjection.EQUIDISTANT, 3: LensProjection.EQUIDISTANT,
    8: LensProjection.ORTHOGRAPHIC, 10: LensProjection.STEREOGRAPHIC, 21: LensProjection.EQUISOLID,
}  # fmt: skip
_NOT_READ = {1: "a panorama on a cylinder", 4: "an equirectangular panorama", 20: "Thoby's fisheye"}
# Kinds of masks (t) that hide: of this image, of its stack, of its lens. Those that ask to show are wishes.
_HIDING, _HIDING_BY_LENS = (0, 2, 4), 4
# Links from image to image (v=0) that are followed; Hugin writes one.
_MOST_LINKS = 60
# Images, and masks, of a project at most: a mask of a lens is one of each image taken with it.
_MOST_IMAGES = 5000
_PARAMETER = re.compile(r'([A-Za-z]+)("[^"]*"|[^\s"]*)')


@dataclass(frozen=True, eq=False)
class Project:
    """names: of the images; entries: what each one's camera is, as in a camera file; points (M, 4): control points x,
    y, x', y'; pairs (M, 2): of which images; lines: where each stands in the file."""

    names: tuple[str, ...]
    entries: tuple[dict[str, Any], ...]
    points: Array
    pairs: np.ndarray[Any, np.dtype[np.intp]]
    lines: tuple[int, ...]


def is_project(text: str) -> bool:
    """Whether a text is a Hugin project: it has a panorama's and an image's line."""
    return bool(re.search(r"^p\s+f\d", text, re.MULTILINE) and re.search(r"^i\s+\w", text, re.MULTILINE))


def project_in(path: Path) -> Project | None:
    """The project that a file holds; None where it holds something else, is a pipe, or cannot be read as a
    text."""
    if not path.is_file():  # a pipe can be read only once, by whoever reads it as what it is
        return None
    try:
        text = path.read_text("utf-8-sig")
    except (OSError, ValueError):
        return None
    return read_project(text, str(path)) if is_project(text) else None


def read_project(text: str, place: str) -> Project:
    """A Hugin project.

    Parameters
    ----------
    text : str
    place : str
        What messages call the file.

    Raises
    ------
    BadRequest
        With the line and what is wrong there.
    """
    images: list[dict[str, str]] = []
    places: list[str] = []
    points: list[tuple[int, ...]] = []
    found: list[list[float]] = []
    masks: list[tuple[int, int, list[list[float]]]] = []
    for index, line in enumerate(text.splitlines(), 1):
        where = f"{place}, line {index}"
        if re.match(r"i\s", line):
            images.append(_parameters(line))
            places.append(where)
        elif re.match(r"c\s", line):
            told = _parameters(line)
            if whole(told.get("t", 0), "t", where) == 0:  # others are of straight lines
                points.append((whole(told.get("n"), "n", where), whole(told.get("N"), "N", where), index))
                found.append([number(told.get(key), key, where) for key in "xyXY"])
        elif re.match(r"k\s", line):
            masks.append(_mask(_parameters(line), where))
    if max(len(images), len(masks)) > _MOST_IMAGES:
        raise BadRequest(
            f"{place}: {len(images)} images and {len(masks)} masks; at most {_MOST_IMAGES} of each are read: save a "
            "project of fewer"
        )
    entries = [_entry(images, k, places[k]) for k in range(len(images))]
    names = [_name(image, where) for image, where in zip(images, places, strict=True)]
    lenses = [_lens_number(images, k, "v") for k in range(len(images))]
    for number_, kind, polygon in masks:
        if number_ >= len(images):
            raise BadRequest(f"{place}: a mask is of image {number_}, and there are {len(images)} (the first is 0)")
        for k, entry in enumerate(entries):
            meant = k == number_ or kind == _HIDING_BY_LENS and lenses[k] == lenses[number_]
            if polygon and meant:
                entry.setdefault("ignore", []).append(polygon)
    for n, N, index in points:
        if not (0 <= n < len(images) and 0 <= N < len(images)):
            raise BadRequest(f"{place}, line {index}: a control point of images {n} and {N}; there are {len(images)}")
    return Project(
        tuple(names), tuple(entries), np.array(found, np.float64).reshape(-1, 4),
        np.array([one[:2] for one in points], np.intp).reshape(-1, 2), tuple(one[2] for one in points),
    )  # fmt: skip


def read_cameras(text: str, place: str) -> dict[str, Any]:
    """Cameras by the names of their pictures, each as in a camera file; see `read_project`."""
    project = read_project(text, place)
    twice = [name for k, name in enumerate(project.names) if name in project.names[:k]]
    if twice:
        raise BadRequest(f"{place}: the image {twice[0]} is in it twice")
    return dict(zip(project.names, project.entries, strict=True))


def _parameters(line: str) -> dict[str, str]:
    """The parameters of a line by their names, the first of each."""
    found: dict[str, str] = {}
    for key, value in _PARAMETER.findall(line[1:]):
        found.setdefault(key, value)
    return found


def _name(image: dict[str, str], place: str) -> str:
    name = image.get("n", "").strip('"')
    if not name:
        raise BadRequest(f'{place}: the image has no name (n"…")')
    return name


def _lens_number(images: Sequence[dict[str, str]], k: int, key: str) -> int:
    """The image that image k takes a parameter from (like v=0), itself where it has its own."""
    for _ in range(_MOST_LINKS):
        value = images[k].get(key, "")
        if not re.fullmatch(r"=\d{1,6}", value) or int(value[1:]) >= len(images):
            break
        k = int(value[1:])
    return k


def _value(images: Sequence[dict[str, str]], k: int, key: str, place: str, default: float | None = 0.0) -> float:
    """A parameter of an image, perhaps by another one's."""
    value = images[_lens_number(images, k, key)].get(key, default)
    if value is None:
        raise BadRequest(f"{place}: the image has no {key}")
    return number(value, key, place)


def _entry(images: Sequence[dict[str, str]], k: int, place: str) -> dict[str, Any]:
    """What an image's camera is, as in a camera file."""

    def of(key: str, default: float | None = 0.0) -> float:
        return _value(images, k, key, place, default)

    width, height = size_of(images[k].get("w"), images[k].get("h"), place)
    kind = whole(of("f"), "f", place)
    if kind not in PROJECTIONS:
        told = _NOT_READ.get(kind, "not known")
        raise BadRequest(f"{place}: the lens f{kind} is {told}; rectilinear pictures and fisheyes are read")
    if of("g") or of("t"):
        raise BadRequest(f"{place}: the image is sheared (g, t), which is not read; set both to 0")
    projection, field = PROJECTIONS[kind], of("v", None)
    half = np.radians(field) / 2
    if not 0 < half < Lens(projection).limit:
        raise BadRequest(f"{place}: the field of view v is {field:g}°, which no {projection} lens has")
    focal = width / 2 / float(Lens(projection).shown_at(np.array(half)))
    abc, shift = [of(key) for key in "abc"], (of("d"), of("e"))
    K = [[focal, 0, (width - 1) / 2 + shift[0]], [0, focal, (height - 1) / 2 + shift[1]], [0, 0, 1]]
    angles = [number(images[k].get(key, 0), key, place) for key in "ypr"]
    entry: dict[str, Any] = {"K": K, "size": [width, height], "start": rotation_from_angles(*angles).T}
    if projection != LensProjection.RECTILINEAR or any(abc):
        entry["lens"] = {"projection": str(projection), "ptlens": abc}
    if projection == LensProjection.RECTILINEAR:
        entry["focal_sigma"] = INTRINSICS.exif_sigma
    return entry


def _mask(told: dict[str, str], place: str) -> tuple[int, int, list[list[float]]]:
    """The image, the kind and the corners of a mask."""
    image, kind = whole(told.get("i"), "i", place), whole(told.get("t"), "t", place)
    words = told.get("p", "").strip('"').split()
    if image < 0 or len(words) < 6 or len(words) % 2:
        raise BadRequest(f"{place}: a mask needs the image i and corners x y of a polygon, three at least")
    if kind not in _HIDING:
        return image, kind, []
    values = [number(word, f"a corner ({shortened(word)})", place) for word in words]
    return image, kind, [list(corner) for corner in zip(values[::2], values[1::2], strict=True)]
