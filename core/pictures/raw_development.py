"""From camera RAW to scene-linear light: with one white balance and one scale of exposure for all of a panorama."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.colour import Curve
from ..system.errors import UnreadableImage
from .camera_raw import raw_bytes, raw_damage, raw_exif
from .decoder_process import decoded
from .metadata import Exif, read_exif
from .options import DECODING, READING

# EXIF's orientation of LibRaw's flips: bit 1 mirrors columns, 2 rows, 4 swaps the two before.
_ORIENTATIONS = (1, 2, 4, 3, 5, 8, 6, 7)


@dataclass(frozen=True)
class RawExposure:
    """What decides how bright a RAW picture and which of its colours is white; 0 where its file does not say.

    white: factors of the sensor's red, green, blue and second green as the camera balanced them; daylight: those of
    daylight, by which cameras are compared. seconds, iso and f_number as the picture was exposed.
    """

    white: tuple[float, ...]
    daylight: tuple[float, ...]
    seconds: float
    iso: float
    f_number: float


@dataclass(frozen=True, eq=False)
class RawPixels:
    """A developed picture.

    levels: (H, W, 1 or 3) uint16, linear, in sRGB's primaries, not turned. curve: their light, in which the white of
    the picture that it was developed like is 1; its last value is where this one clips.
    """

    levels: NDArray[np.uint16]
    curve: Curve
    exif: Exif
    warnings: tuple[str, ...]


def exposure_of_first(sources: Iterable[Any]) -> RawExposure | None:
    """White balance and exposure of the first camera RAW file among the pictures of a panorama, which all of them are
    developed with; None where there is none that can be read."""
    for source in sources:
        data = raw_bytes(Path(source)) if isinstance(source, (str, Path)) else None
        if data is not None:
            try:
                facts = decoded("raw", data, {"most_pixels": 0})[0]
                return _exposure(facts, _exif(data, facts))
            except UnreadableImage:  # which is said when its turn comes to be read
                continue
    return None


def develop(data: bytes, like: RawExposure | None, check: Callable[[int, int], None]) -> RawPixels:
    """Develop a camera RAW file.

    Parameters
    ----------
    data : bytes
        The file.
    like : RawExposure, optional
        Of the picture whose white balance and exposure it gets; its own by default.
    check : callable
        Asked about (W, H) px that the file promises; raises what it likes where they are too many.

    Returns
    -------
    RawPixels

    Raises
    ------
    UnreadableImage
        It is damaged, too large, or of a kind that LibRaw does not know.
    """
    damage = raw_damage(data)
    if damage:
        raise UnreadableImage(f"the camera RAW file is damaged: {damage}; copy it again")
    most = min(READING.max_pixels, max(READING.small_pixels, READING.raw_pixels_per_byte * len(data)))
    asked = {} if like is None else {"white": like.white, "daylight": like.daylight}
    facts, samples = decoded("raw", data, {**asked, "most_pixels": most})
    if not len(samples):
        check(facts["width"], facts["height"])
        raise UnreadableImage("the camera RAW file holds no picture; copy it again")
    levels = samples.view(np.uint16).reshape(facts["height"], facts["width"], facts["channels"])
    exif = _exif(data, facts)
    own = _exposure(facts, exif)
    stops, unknown = _stops_above(own, own if like is None else like)
    warnings = [
        f"its file does not say {what}: it is taken as exposed with the same as the first camera RAW picture"
        for what in unknown
    ]
    if not facts["is_balanced"] and like is None:
        warnings.append("its file has no white balance: that of daylight was taken")
    curve = Curve((np.linspace(0.0, 1.0, 65536) * 2.0**-stops).astype(np.float32))
    return RawPixels(levels, curve, exif, tuple(warnings))


def _exposure(facts: dict[str, Any], exif: Exif) -> RawExposure:
    values = [
        exif.number(tag) or _positive(facts[name])
        for tag, name in ((33434, "shutter_speed"), (34855, "iso_speed"), (33437, "aperture"))
    ]
    return RawExposure(tuple(facts["white"]), tuple(facts["daylight"]), *values)


def _stops_above(own: RawExposure, like: RawExposure) -> tuple[float, list[str]]:
    """By how many stops more light was let in or amplified than in another picture, by t · ISO / N²; and what of these
    one of the two does not say."""
    stops, unknown = 0.0, []
    for name, power, words in (("seconds", 1, "its time"), ("iso", 1, "its ISO"), ("f_number", -2, "its f-number")):
        values = [float(getattr(one, name)) for one in (own, like)]
        if min(values) > 0:
            stops += power * float(np.log2(values[0] / values[1]))
        elif values[0] != values[1]:
            unknown.append(words)
    if abs(stops) > DECODING.most_stops:
        return 0.0, ["a sensible exposure"]
    return stops, unknown


def _exif(data: bytes, facts: dict[str, Any]) -> Exif:
    """What its EXIF says, with what LibRaw alone knows; the orientation as LibRaw has it."""
    exif = read_exif(raw_exif(data))
    flip = facts["flip"]
    return replace(
        exif, orientation=_ORIENTATIONS[flip] if 0 <= flip < 8 else 1, lens=exif.lens or facts["lens"],
        focal_mm=exif.focal_mm or _positive(facts["focal_length"]) or None,
    )  # fmt: skip


def _positive(value: float) -> float:
    return value if np.isfinite(value) and value > 0 else 0.0
