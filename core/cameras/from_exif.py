"""The intrinsics of a picture of which nothing is given: by EXIF, or assumed; and how precise they are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .camera import Camera, Knowledge
from .options import INTRINSICS
from .sensors import FULL_FRAME_DIAGONAL, sensor_diagonal, sensor_diagonals

if TYPE_CHECKING:
    from ..pictures.metadata import Exif


def camera_from_exif(exif: Exif, size: tuple[int, int], name: str, warnings: list[str]) -> Camera:
    """EXIF's 35 mm equivalent, else its focal length with the sensor's size, else 0.9·max(W, H)."""
    found: list[tuple[float, str]] = []
    if exif.focal35_mm:
        found.append((focal_from_35mm(exif.focal35_mm, size), "EXIF 35 mm equivalent"))
    diagonal = sensor_diagonal(exif.make, exif.model)
    # a digital zoom enlarges the middle of the sensor; makers count it in the 35 mm equivalent
    zoom, zoomed_by = exif.digital_zoom or 1.0, f", digital zoom {exif.digital_zoom:g}" if exif.digital_zoom else ""
    if exif.focal_mm and diagonal:
        focal = exif.focal_mm * zoom / diagonal * float(np.hypot(*size))
        found.append((focal, f"EXIF focal length and sensor table{zoomed_by}"))
    by_table = len(found)
    if exif.focal_mm and exif.focal_plane_x_per_mm and exif.width and exif.height:
        shrink = max(size) / max(exif.width, exif.height)
        focal = exif.focal_mm * zoom * exif.focal_plane_x_per_mm * shrink
        found.append((focal, f"EXIF focal length and sensor resolution{zoomed_by}"))
    least, most = INTRINSICS.least_focal * max(size), INTRINSICS.most_focal * max(size)
    found = [(f, source) for f, source in found if least < f < most]
    if not found:
        return assumed_camera(size)
    focal, source = found[0]
    for other, other_source in found[1:]:
        if abs(np.log(other / focal)) > INTRINSICS.contradiction:
            warnings.append(
                f"{name}'s EXIF contradicts itself: {focal:.0f} px by {source}, {other:.0f} px by "
                f"{other_source}; the first is used"
            )
    sigma = INTRINSICS.exif_sigma
    if not by_table and not _is_a_sensor(exif):
        sigma = INTRINSICS.cropped_sigma  # the resolution is that of the picture before it was shrunk, mostly
    if exif.width and exif.height:
        aspect, original = max(size) / min(size), max(exif.width, exif.height) / min(exif.width, exif.height)
        if abs(np.log(aspect / original)) > INTRINSICS.cropped_aspect:
            sigma = INTRINSICS.cropped_sigma
            warnings.append(
                f"{name} was cropped since it was taken ({exif.width}×{exif.height} in EXIF, {size[0]}×{size[1]} "
                "now): its EXIF focal "
                "length is only a hint; give the focal length if you know it"
            )
    return camera_of_focal(focal, size, source, sigma, Knowledge.EXIF)


def _is_a_sensor(exif: Exif) -> bool:
    """Whether the focal plane's resolution and the picture's size make a sensor of a size that there is."""
    if not (exif.focal_plane_x_per_mm and exif.width and exif.height):
        return False
    diagonal = float(np.hypot(exif.width, exif.height)) / exif.focal_plane_x_per_mm
    return any(abs(np.log(diagonal / known)) < INTRINSICS.same_sensor for known in sensor_diagonals())


def assumed_camera(size: tuple[int, int]) -> Camera:
    """The camera of a picture of which nothing is known."""
    sides, sigma = INTRINSICS.assumed_focal, INTRINSICS.assumed_sigma
    source = f"assumed ({sides:g} × the longer side)"
    return camera_of_focal(sides * max(size), size, source, sigma, Knowledge.ASSUMED)


def without_exif(camera: Camera) -> Camera:
    """A camera as if nothing were known of its focal length; its principal point and distortion stay."""
    assumed = assumed_camera(camera.size)
    K = assumed.K.copy()
    K[:2, 2] = camera.K[:2, 2]
    return replace(camera, K=K, source=assumed.source, log_sigma=assumed.log_sigma, knowledge=assumed.knowledge)


def focal_from_35mm(focal35: float, size: tuple[int, int]) -> float:
    return focal35 * float(np.hypot(*size)) / FULL_FRAME_DIAGONAL


def camera_of_focal(
    focal: float, size: tuple[int, int], source: str, log_sigma: float, knowledge: Knowledge = Knowledge.GIVEN
) -> Camera:
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    return Camera(K, size, source, log_sigma, principal_sigma=INTRINSICS.principal_sigma, knowledge=knowledge)

