"""Calibrations of one lens, for all pictures: OpenCV's YAML or XML (ROS's too), and Agisoft's XML."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

from ...system.errors import BadRequest
from .values import focal, number, shortened, size_of

# Names of the camera's matrix, its distortion and the picture's sides in the files of OpenCV's samples and of ROS.
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K")
_DISTORTION = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D")
_WIDTH, _HEIGHT = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")
_FISHEYES = ("equidistant", "fisheye")


def is_xml(text: str) -> bool:
    """Whether a text is XML."""
    return text.lstrip()[:1] == "<"


def parsed_xml(text: str, place: str) -> ElementTree.Element:
    """The root of an XML document. Raises BadRequest: documents that define entities are refused, since a few of these
    can fill any memory."""
    if re.search(r"<!(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise BadRequest(f"{place}: it defines entities (<!DOCTYPE …>), which a calibration needs not; remove that")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise BadRequest(f"{place}: not sound XML: {error}") from error


def is_calibration(text: str) -> bool:
    """Whether a text is a calibration in YAML."""
    return any(re.search(rf"^{name}[ \t]*:", text, re.MULTILINE) for name in _MATRIX)


def read_opencv_yaml(text: str, place: str) -> dict[str, Any]:
    """A camera as in a camera file, from what OpenCV's or ROS's calibration wrote. Raises BadRequest."""
    values: dict[str, str] = {}
    for match in re.finditer(r"^(\w+)[ \t]*:([^\n]*(?:\n[ \t]+[^\n]*)*)", text, re.MULTILINE):
        values.setdefault(match[1], match[2])

    def numbers(names: tuple[str, ...]) -> list[str] | None:
        told = next((values[name] for name in names if name in values), None)
        listed = None if told is None else re.search(r"\[([^\]]*)\]", told)
        return None if listed is None else listed[1].replace(",", " ").split()

    def word(names: tuple[str, ...]) -> str | None:
        return next((values[name].strip() for name in names if name in values), None)

    return _opencv(numbers(_MATRIX), numbers(_DISTORTION), (word(_WIDTH), word(_HEIGHT)), _is_fisheye(word), place)


def read_calibration_xml(root: ElementTree.Element, place: str) -> dict[str, Any] | None:
    """The same from XML, of OpenCV or Agisoft; None where it is neither's."""
    if root.tag == "opencv_storage":

        def numbers(names: tuple[str, ...]) -> list[str] | None:
            found = next((data for name in names for data in root.iterfind(f"{name}/data")), None)
            return None if found is None else (found.text or "").split()

        def word(names: tuple[str, ...]) -> str | None:
            return next((found.text or "" for name in names for found in root.iterfind(name)), None)

        return _opencv(numbers(_MATRIX), numbers(_DISTORTION), (word(_WIDTH), word(_HEIGHT)), _is_fisheye(word), place)
    calibration = root if root.tag == "calibration" else root.find(".//calibration[f]")
    return None if calibration is None else _agisoft(calibration, place)


def _is_fisheye(word: Any) -> bool:
    return word(("distortion_model",)) in _FISHEYES or word(("fisheye_model",)) == "1"


def _opencv(
    matrix: list[str] | None, distortion: list[str] | None, sides: tuple[str | None, str | None], fisheye: bool,
    place: str,
) -> dict[str, Any]:  # fmt: skip
    """A camera as in a camera file, by the words of OpenCV's."""
    if matrix is None or len(matrix) != 9:
        raise BadRequest(f"{place}: the camera's matrix must be 9 numbers")
    if sides[0] is None or sides[1] is None:
        raise BadRequest(f"{place}: {_WIDTH[0]} and {_HEIGHT[0]}, the size of the picture in px, are missing")
    K = [number(value, "a number of the camera's matrix", place) for value in matrix]
    values = [number(value, "a distortion coefficient", place) for value in distortion or []]
    most = 4 if fisheye else 5
    if any(values[most:]):
        raise BadRequest(f"{place}: {len(values)} distortion coefficients; {most} are read, calibrate with these alone")
    entry: dict[str, Any] = {"K": [K[:3], K[3:6], K[6:]], "size": list(size_of(*sides, place))}
    if fisheye:
        return entry | {"lens": {"projection": "equidistant", "angular": values[:4]}}
    return entry | {"distortion": values[:5]}


def _agisoft(calibration: ElementTree.Element, place: str) -> dict[str, Any]:
    """Agisoft's: the principal point from the picture's middle, b1 and b2 for pixels that are not square."""

    def of(key: str) -> float:
        return number(calibration.findtext(key, "0"), key, place)

    width, height = size_of(calibration.findtext("width"), calibration.findtext("height"), place)
    f = focal(calibration.findtext("f"), place)
    kind = calibration.findtext("projection", "frame").strip()
    if kind not in ("frame", "fisheye"):
        raise BadRequest(f"{place}: the projection is {shortened(kind)}; frame and fisheye are read")
    cx, cy = (width - 1) / 2 + of("cx"), (height - 1) / 2 + of("cy")
    entry: dict[str, Any] = {"K": [[f + of("b1"), of("b2"), cx], [0, f, cy], [0, 0, 1]], "size": [width, height]}
    lacking = ("p1", "p2", "p3", "p4") if kind == "fisheye" else ("k4", "p3", "p4")
    strange = [key for key in lacking if of(key)]
    if strange:
        raise BadRequest(f"{place}: {strange[0]} of a {kind} calibration is not read; calibrate without it")
    if kind == "fisheye":
        return entry | {"lens": {"projection": "equidistant", "angular": [of(key) for key in ("k1", "k2", "k3", "k4")]}}
    # its p1 goes with x, OpenCV's with y
    return entry | {"distortion": [of(key) for key in ("k1", "k2", "p2", "p1", "k3")]}
