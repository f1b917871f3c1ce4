"""The panorama's frame in a Hugin project: which projection, how large, and which part is kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ...cameras.projective import rotation_from_vector
from ...panorama.canvas import Canvas
from ...raster.arrays import Array

# Hugin's numbers of projections.
_NUMBERS = {"perspective": 0, "cylindrical": 1, "equirectangular": 2, "pannini": 19}


@dataclass(frozen=True, eq=False)
class Frame:
    """line: of the panorama in a project; rotation (3, 3): from its axes to the reference camera's; corner: x, y in
    px of Hugin's panorama of the first pixel of ours, to half a pixel at most."""

    line: str
    rotation: Array
    corner: tuple[int, int]


def frame_of(canvas: Canvas, K: Array) -> Frame:
    """The frame of a panorama.

    Hugin's lies evenly around the direction ahead, and is then cropped. On a cylinder and a sphere the axes are turned
    to the middle of our panorama first.

    Parameters
    ----------
    canvas : Canvas
        As the panorama is cropped.
    K : (3, 3)
        Of the reference, whose own plane the canvas is where it has no projection.
    """
    projection, size = canvas.projection, (canvas.width, canvas.height)
    if projection is None:
        kind, focal, distance, rotation = "perspective", float(np.sqrt(K[0, 0] * K[1, 1])), 0.0, np.eye(3)
        centre = K[:2, 2] + np.array(canvas.offset, float)
    else:
        kind, focal, distance, rotation = projection.kind, projection.focal, projection.distance, projection.rotation
        centre = np.array(projection.centre) + np.array(canvas.offset, float)
    if kind in ("cylindrical", "equirectangular"):
        middle = (size[0] + size[0] % 2 - 1) / 2  # Hugin makes an odd width even
        rotation = rotation @ rotation_from_vector(np.array([0.0, (middle - centre[0]) / focal, 0.0]))
        centre = np.array([middle, centre[1]])
    around = [_evenly(middle, side) for middle, side in zip(centre, size, strict=True)]
    (left, width), (top, height) = around
    extra = f' P"{50 * (3 - 1.5 / (distance + 0.5)):.9f} 0 0"' if kind == "pannini" else ""
    crop = f"S{left},{left + size[0]},{top},{top + size[1]}"
    view = np.degrees(_width_angle(kind, width / focal, distance))
    line = f'p f{_NUMBERS[kind]} w{width} h{height} v{view:.12f} {crop}{extra} E0 R0 n"TIFF_m c:LZW r:CROP"'
    return Frame(line, rotation, (left, top))


def _evenly(middle: float, side: int) -> tuple[int, int]:
    """What lies before the first pixel, and the side, px, of the least frame evenly around a place that holds so many
    pixels from 0 on; the place is met to a quarter of a pixel."""
    twice = round(2 * middle)  # the place of the frame's middle, in half pixels
    before = max(0, side - 1 - twice)
    return before, 2 * before + twice + 1


def _width_angle(kind: str, width: float, distance: float) -> float:
    """The angle, rad, that a frame so many focal lengths wide covers."""
    if kind in ("cylindrical", "equirectangular"):
        return width

    def off(half: float) -> float:
        return float((distance + 1) * np.sin(half) / (distance + np.cos(half)) - width / 2)

    most = float(np.pi - np.arccos(distance)) if distance < 1 else np.pi
    return 2 * float(brentq(off, 0.0, most * (1 - 1e-6), xtol=1e-15))
