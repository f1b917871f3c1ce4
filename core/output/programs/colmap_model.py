"""A COLMAP model in text: cameras, images and the points that they share.

There the middle of the first pixel is at 0.5; poses are world to camera with OpenCV's axes, as ours are.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from ...system.errors import UnwritableOutput
from ..camera_file import FoundCamera
from .opencv_lens import opencv_model
from .points import Points

# The files of a model.
FILES = ("cameras.txt", "images.txt", "points3D.txt")
# Gray of points: their colour is not kept.
_COLOUR = "128 128 128"


def colmap_files(found: list[FoundCamera], points: Points) -> dict[str, bytes]:
    """The files of a model by their names.

    Parameters
    ----------
    found : list of FoundCamera
        With poses.
    points : Points

    Raises
    ------
    UnwritableOutput
        A lens or a name that COLMAP does not have.
    """
    cameras, images = [], []
    order = [np.flatnonzero(points.picture == number) for number in range(len(found))]
    place = np.zeros(len(points.picture), np.intp)
    for number, (one, rows) in enumerate(zip(found, order, strict=True), 1):
        assert one.R is not None and one.t is not None
        if any(not letter.isprintable() for letter in one.name):
            raise UnwritableOutput(f"{one.name!r}: COLMAP's lines hold no such name; rename the picture")
        model, values = opencv_model(one, "COLMAP")
        values = (*values, 0.0, 0.0, 0.0) if model == "FULL_OPENCV" else values
        K, (width, height) = one.camera.K, one.camera.size
        numbers = (K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5, *values)
        cameras.append(f"{number} {model} {width} {height} {_joined(numbers)}")
        x, y, z, w = Rotation.from_matrix(one.R).as_quat()
        images.append(f"{number} {_joined((w, x, y, z, *one.t))} {number} {one.name}")
        pixels = points.pixels[rows] + 0.5
        seen = zip(pixels, points.point[rows], strict=True)
        images.append(" ".join(f"{_joined(at)} {point + 1}" for at, point in seen))
        place[rows] = np.arange(len(rows))
    return {
        name: ("\n".join(lines) + "\n").encode(errors="replace")
        for name, lines in zip(FILES, (cameras, images, _points(points, place)), strict=True)
    }


def _points(points: Points, place: np.ndarray[tuple[int], np.dtype[np.intp]]) -> list[str]:
    """A line of each point that at least two pictures see: where it is, its error and its track."""
    lines = []
    by_point = np.argsort(points.point, kind="stable")
    starts = np.searchsorted(points.point[by_point], np.arange(len(points.X) + 1))
    for number, X in enumerate(points.X):
        rows = by_point[starts[number] : starts[number + 1]]
        track = " ".join(f"{points.picture[row] + 1} {place[row]}" for row in rows)
        if len(rows):
            lines.append(f"{number + 1} {_joined(X)} {_COLOUR} {float(points.error[rows].mean())!r} {track}")
    return lines


def _joined(values: Iterable[float]) -> str:
    """Numbers that are read back to the last bit."""
    return " ".join(repr(float(value)) for value in values)
