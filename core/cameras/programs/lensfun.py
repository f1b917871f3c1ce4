"""A lens out of a lensfun database file: chosen by EXIF's lens, its distortion interpolated to EXIF's focal length.

Coefficients hold for radii in units of half the shorter side of the sensor that the lens was calibrated on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from ...system.errors import BadRequest
from ..camera import Camera
from ..lens_models import Lens, LensProjection
from ..sensors import FULL_FRAME_DIAGONAL
from .values import number, shortened

if TYPE_CHECKING:
    from ...pictures.metadata import Exif

# lensfun's types of lenses that are read.
_TYPES = {
    "rectilinear": LensProjection.RECTILINEAR, "fisheye": LensProjection.EQUIDISTANT,
    "stereographic": LensProjection.STEREOGRAPHIC, "equisolid": LensProjection.EQUISOLID,
    "orthographic": LensProjection.ORTHOGRAPHIC,
}  # fmt: skip
# Its models of distortion, and their coefficients.
_MODELS = {"ptlens": ("a", "b", "c"), "poly3": ("k1",), "poly5": ("k1", "k2")}
# A lens may be calibrated on a sensor so many times smaller than the picture's, which rounding of crop factors makes.
SAME_SENSOR = 1.05


@dataclass(frozen=True)
class LensProfile:
    """What a database says of a picture's lens: its projection, the model of its distortion and the coefficients at
    `focal_mm`, for radii in units of `unit_mm` on the sensor; name: of the lens."""

    name: str
    projection: LensProjection
    model: str
    values: tuple[float, ...]
    unit_mm: float
    focal_mm: float

    def on(self, camera: Camera) -> Camera:
        """A camera with this lens; where nothing is known of its focal length in px, on the sensor of the calibration.
        A fisheye's focal length is held: it says which ray each pixel shows."""
        radius = min(camera.size) / 2 / camera.focal if camera.assumed else self.unit_mm / self.focal_mm
        source = f"{camera.source}, lens {self.name}"
        if self.projection != LensProjection.RECTILINEAR:
            camera = camera.with_focal_held()
        if self.model == "poly5" and self.projection == LensProjection.RECTILINEAR:
            k1, k2 = (value / radius ** (2 * power) for power, value in enumerate(self.values, 1))
            return replace(camera, source=source, distortion=np.array([k1, k2, 0, 0, 0]))
        abc = self.values if self.model == "ptlens" else (0.0, self.values[0], 0.0)
        return replace(camera, source=source, lens=Lens(self.projection, ptlens=abc, radius=radius))


@dataclass(frozen=True)
class _Calibrated:
    """A lens of the database: crop factor of the sensor; unit_mm; calibrations by focal length in mm."""

    name: str
    projection: LensProjection
    crop: float
    unit_mm: float
    calibrations: tuple[tuple[float, str, tuple[float, ...]], ...]


def read_lensfun(
    root: ElementTree.Element, place: str, names: Sequence[str], exifs: Sequence[Exif]
) -> dict[str, LensProfile]:
    """The lens of each picture.

    Parameters
    ----------
    root : Element
        <lensdatabase>.
    place : str
        What messages call the file.
    names, exifs
        Of the pictures.

    Raises
    ------
    BadRequest
        EXIF tells no lens or focal length, or the database lacks it, or it is damaged.
    """
    lenses = [element for element in root.iter("lens") if element.find("calibration/distortion") is not None]
    if not lenses:
        raise BadRequest(f"{place}: no lens with calibrated distortion in this lensfun database")
    return {name: _profile(lenses, name, exif, place) for name, exif in zip(names, exifs, strict=True)}


def _name_of(element: ElementTree.Element) -> str:
    return element.findtext("model", "").strip()


def _lens(element: ElementTree.Element, place: str) -> _Calibrated:
    """A lens with its calibrations."""
    name = _name_of(element)
    where = f"{place}, lens {shortened(name)}"
    found = []
    for one in element.iterfind("calibration/distortion"):
        model = one.get("model", "")
        if model not in _MODELS:
            raise BadRequest(f"{where}: the distortion {shortened(model)} is not read; {', '.join(_MODELS)} are")
        values = tuple(number(one.get(key, "0"), key, where) for key in _MODELS[model])
        focal = number(one.get("real-focal", one.get("focal")), "the focal length", where)
        found.append((focal, model, values))
    kind = (element.findtext("type") or "rectilinear").strip()
    if kind not in _TYPES:
        raise BadRequest(f"{where}: a lens of the type {shortened(kind)} is not read; {', '.join(_TYPES)} are")
    if kind != "rectilinear" and any(model == "poly5" for _, model, _ in found):
        raise BadRequest(f"{where}: the distortion poly5 is not read of fisheyes")
    crop = number(element.findtext("cropfactor"), "the crop factor", where)
    width, _, height = (element.findtext("aspect-ratio") or "3:2").partition(":")
    aspect = number(width, "the aspect ratio", where) / (number(height, "the aspect ratio", where) if height else 1.0)
    if min(crop, aspect, *(focal for focal, _, _ in found)) <= 0:
        raise BadRequest(f"{where}: crop factor, aspect ratio and focal lengths must be above 0")
    unit = FULL_FRAME_DIAGONAL / crop / math.hypot(max(aspect, 1 / aspect), 1) / 2
    return _Calibrated(name, _TYPES[kind], crop, unit, tuple(sorted(found)))


def _profile(lenses: list[ElementTree.Element], name: str, exif: Exif, place: str) -> LensProfile:
    if not exif.focal_mm:
        raise BadRequest(f"{name}: its EXIF tells no focal length in mm, which a lensfun profile is chosen by")
    there = sorted({_name_of(lens) for lens in lenses})
    # a file that holds one lens is given for it, whatever EXIF calls that
    meant = [lens for lens in there if _alike(lens, exif.lens)] if len(there) > 1 else there
    if len(meant) != 1:
        raise BadRequest(
            f"{place}: the lens of {name} ({exif.lens or 'not named by EXIF'}) may be {'several' if meant else 'none'} "
            f"of those in it, {', '.join(one[:80] for one in (meant or there)[:5])}: give a file that holds the right "
            "one alone"
        )
    same = [_lens(lens, place) for lens in lenses if _name_of(lens) == meant[0]]
    crop = _crop_of(exif)
    covering = [lens for lens in same if crop is not None and lens.crop <= crop * SAME_SENSOR]
    chosen = max(covering, key=lambda lens: lens.crop) if covering else min(same, key=lambda lens: lens.crop)
    model, values = _at(chosen, exif.focal_mm)
    return LensProfile(chosen.name, chosen.projection, model, values, chosen.unit_mm, exif.focal_mm)


def _crop_of(exif: Exif) -> float | None:
    """The crop factor of a picture's sensor, if EXIF tells both focal lengths."""
    return exif.focal35_mm / exif.focal_mm if exif.focal35_mm and exif.focal_mm else None


def _alike(name: str, other: str) -> bool:
    """Whether two programs' names of a lens mean the same: one holds all words of the other."""
    first, second = (set(re.findall(r"[a-z]+|\d+(?:\.\d+)?", one.casefold())) for one in (name, other))
    return bool(first and second) and (first <= second or second <= first)


def _at(lens: _Calibrated, focal: float) -> tuple[str, tuple[float, ...]]:
    """Model and coefficients at a focal length: between two calibrations of one model linear, else the nearest."""
    focals = [one[0] for one in lens.calibrations]
    after = int(np.searchsorted(focals, focal))
    if 0 < after < len(focals):
        (f1, model, first), (f2, other, second) = lens.calibrations[after - 1 : after + 1]
        if model == other and f2 > f1:
            share = (focal - f1) / (f2 - f1)
            return model, tuple((1 - share) * a + share * b for a, b in zip(first, second, strict=True))
    nearest = min(lens.calibrations, key=lambda one: abs(math.log(one[0] / focal)))
    return nearest[1], nearest[2]
