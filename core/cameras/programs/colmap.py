"""A COLMAP model: its files of cameras and of images, as text or binary.

Poses are world to camera with OpenCV's axes, as ours are; the middle of the first pixel is at 0.5.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...raster.arrays import Array
from ...system.errors import BadRequest
from .values import focal, number, read_data, shortened, size_of, whole

# COLMAP's numbers of its models; how many parameters those have that are read here.
MODELS = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV",
    "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE",
)  # fmt: skip
PARAMETERS = {
    "SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8, "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
}  # fmt: skip
_FILES = ("cameras.txt", "images.txt", "cameras.bin", "images.bin")
_POSE = ("QW", "QX", "QY", "QZ", "TX", "TY", "TZ")
# Models of one focal length.
_SIMPLE = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")


@dataclass(frozen=True, eq=False)
class _Image:
    """name; camera: its number; R (3, 3), t (3,): world to camera; place: in its file, for messages."""

    name: str
    camera: int
    R: Array
    t: Array
    place: str


def model_folder(path: Path) -> Path | None:
    """The folder of the model that a path means: a folder with one in it or in its sparse/0, or one of its files."""
    folders = [path, path / "sparse" / "0", path / "sparse", path / "0"] if path.is_dir() else [path.parent]
    if not path.is_dir() and path.name not in _FILES:
        return None
    return next((folder for folder in folders if _ending(folder)), None)


def _ending(folder: Path) -> str | None:
    """Whether a folder holds a model as bin or txt."""
    for ending in (".bin", ".txt"):
        if (folder / f"cameras{ending}").is_file() and (folder / f"images{ending}").is_file():
            return ending
    return None


def read_colmap(folder: Path) -> dict[str, Any]:
    """Cameras by the names of their pictures, each as in a camera file.

    Parameters
    ----------
    folder : Path
        With cameras.txt and images.txt, or the same as .bin.

    Raises
    ------
    BadRequest
        With the file, the line or byte, and what is wrong there.
    UnreadableImage
        A file cannot be read.
    """
    ending = _ending(folder)
    assert ending is not None
    cameras, images = folder / f"cameras{ending}", folder / f"images{ending}"
    if ending == ".txt":
        known, seen = dict(_cameras_of_text(cameras)), _images_of_text(images)
    else:
        known, seen = dict(_cameras_of_bytes(cameras)), _images_of_bytes(images)
    entries: dict[str, Any] = {}
    for image in seen:
        if image.camera not in known:
            raise BadRequest(f"{image.place}: it was taken by camera {image.camera}, which {cameras.name} lacks")
        if image.name in entries:
            raise BadRequest(f"{image.place}: {image.name} has a camera already")
        entries[image.name] = known[image.camera] | {"R": image.R, "t": image.t}
    if not entries:
        raise BadRequest(f"{images}: no images in it")
    return entries


def _entry(model: str, size: tuple[int, int], values: list[float], place: str) -> dict[str, Any]:
    """A camera's intrinsics as in a camera file."""
    fx = focal(values[0], place)
    fy = fx if model in _SIMPLE else focal(values[1], place)
    cx, cy, *more = values[1:] if model in _SIMPLE else values[2:]
    entry: dict[str, Any] = {"K": [[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]], "size": list(size)}
    if model == "OPENCV_FISHEYE":
        return entry | {"lens": {"projection": "equidistant", "angular": more}}
    if any(more[5:]):
        raise BadRequest(f"{place}: k4 to k6 of {model} are not read, and not all are 0: let COLMAP estimate OPENCV")
    return entry | {"distortion": more[:5]}


def _checked_model(model: str, place: str) -> int:
    """How many parameters a model has. Raises BadRequest if it is not read."""
    if model not in PARAMETERS:
        raise BadRequest(
            f"{place}: the camera model {shortened(model)} is not read; {', '.join(PARAMETERS)} are: let COLMAP "
            "estimate one of these, or undistort the pictures with it"
        )
    return PARAMETERS[model]


def _lines(path: Path) -> list[str]:
    try:
        return read_data(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise BadRequest(f"{path}: not a text in UTF-8, at byte {error.start}") from error


def _cameras_of_text(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    found = set()
    for index, line in enumerate(_lines(path), 1):
        words, place = line.split(), f"{path}, line {index}"
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 4:
            raise BadRequest(f"{place}: {len(words)} values; a camera has a number, a model, width, height, parameters")
        count = _checked_model(words[1], place)
        if len(words) != 4 + count:
            raise BadRequest(f"{place}: {len(words) - 4} parameters; {words[1]} has {count}")
        key = whole(words[0], "the camera's number", place)
        if key in found:
            raise BadRequest(f"{place}: camera {key} was there already")
        found.add(key)
        values = [number(word, "a parameter", place) for word in words[4:]]
        yield key, _entry(words[1], size_of(words[2], words[3], place), values, place)


def _images_of_text(path: Path) -> Iterator[_Image]:
    lines = enumerate(_lines(path), 1)
    for index, line in lines:
        place = f"{path}, line {index}"
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        words = line.split(maxsplit=9)
        if len(words) != 10:
            told = " ".join(_POSE)
            raise BadRequest(f"{place}: {len(words)} values; an image has a number, {told}, a camera, a name")
        values = [number(word, what, place) for word, what in zip(words[1:8], _POSE, strict=True)]
        camera = whole(words[8], "the camera's number", place)
        yield _Image(words[9].strip(), camera, _rotation(values[:4], place), np.array(values[4:]), place)
        next(lines, None)  # its points, perhaps none


def _rotation(quaternion: list[float], place: str) -> Array:
    """The rotation (3, 3) of w, x, y, z."""
    length = float(np.linalg.norm(quaternion))
    if not 1e-6 < length < 1e6:
        raise BadRequest(f"{place}: QW QX QY QZ are no rotation: their length is {length:g}")
    w, x, y, z = np.array(quaternion) / length
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


class _Bytes:
    """A binary file that is read from the front; what goes beyond its end is refused with the place."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, read_data(path), 0

    @property
    def place(self) -> str:
        """Where reading stands, for messages."""
        return f"{self.path}, byte {self.at}"

    def values(self, layout: str) -> tuple[Any, ...]:
        """Numbers of such a layout (see struct), without padding."""
        size = struct.calcsize("<" + layout)
        self.skip(size)
        return struct.unpack_from("<" + layout, self.data, self.at - size)

    def skip(self, size: int) -> None:
        """Goes on by so many bytes."""
        if size > len(self.data) - self.at:
            raise BadRequest(f"{self.place}: the file ends here, {size - len(self.data) + self.at} bytes too early")
        self.at += size

    def name(self) -> str:
        """A text that ends with a zero."""
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise BadRequest(f"{self.place}: a name begins here that does not end")
        found = self.data[self.at : end].decode("utf-8", errors="replace")
        self.at = end + 1
        return found


def _cameras_of_bytes(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    file = _Bytes(path)
    (count,) = file.values("Q")
    for _ in range(count):
        place = file.place
        key, kind, width, height = file.values("iiQQ")
        model = MODELS[kind] if 0 <= kind < len(MODELS) else f"number {kind}"
        values = [number(value, "a parameter", place) for value in file.values(f"{_checked_model(model, place)}d")]
        yield key, _entry(model, size_of(width, height, place), values, place)


def _images_of_bytes(path: Path) -> Iterator[_Image]:
    file = _Bytes(path)
    (count,) = file.values("Q")
    for _ in range(count):
        place = file.place
        _, *values, camera = file.values("i7di")
        values = [number(value, "a part of the pose", place) for value in values]
        name = file.name()
        (points,) = file.values("Q")
        file.skip(24 * points)
        yield _Image(name, camera, _rotation(values[:4], place), np.array(values[4:]), place)
