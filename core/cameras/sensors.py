"""Sensor sizes, for cameras whose EXIF gives a focal length in mm but no 35 mm equivalent.

Only makers' published figures. A format's nominal name ("1/2.3 inch") stands for a vidicon tube, not for a length, so
the table keeps the sensors' own diagonals.
"""

from __future__ import annotations

import math

FULL_FRAME_DIAGONAL = math.hypot(36.0, 24.0)
"""mm of the 36 × 24 mm frame that "35 mm equivalent" and crop factors refer to."""

# Diagonal in mm: parts of "make model" as EXIF has them, lower case. The longest part that fits decides.
_MODELS: dict[float, str] = {
    4.5: "iphone 3gs",
    5.68: "iphone 4, iphone 5, sgh-i997, gt-i9100, gt-i9300, nexus 5",
    6.0: "iphone 6, iphone 7, iphone 8",
    7.06: "iphone x, iphone 11",
    7.18: "pixel 2, pixel 3, pixel 4, ixus 860, sd870, powershot a",
    7.66: "dsc-w, dsc-hx, ixus, powershot sx, coolpix p, coolpix s, dmc-tz, dmc-fz, gopro, fc330, fc220",
    9.5: "powershot g9, powershot s9, powershot s1, dmc-lx",
    15.86: "dsc-rx100, dsc-rx10, powershot g7 x, dmc-fz1000, fc6310",
    19.2: "dmc-lx100",
    21.64: "dmc-g, dc-g, e-m1, e-m5, e-pl",
    23.4: "powershot g1 x",
    26.8: "eos, eos r7, eos r10, eos r50, rebel",
    28.2: "nikon d, nikon z 30, nikon z 50, nikon z fc, ilce-, nex-, slt-a, x-t, x-pro, x100, x-e, x-h, pentax k",
    43.27: (
        "eos 5d, eos 6d, eos-1d x, eos-1ds, eos r, eos rp, nikon d3, nikon d4, nikon d5 , nikon d6 , nikon d600, "
        "nikon d610, "
        "nikon d700, nikon d750, nikon d780, nikon d800, nikon d810, nikon d850, nikon df, nikon z, ilce-7, ilce-9, "
        "ilce-1 , slt-a99, dsc-rx1 , pentax k-1 "
    ),
}
# Cameras whose names begin like those above.
_EXCEPTIONS = {"nikon d3000": 28.2, "nikon d3100": 28.2, "nikon d3200": 28.2, "nikon d3300": 28.2, "nikon d3400": 28.2}
_EXCEPTIONS |= {f"nikon d{number}": 28.2 for number in (40, 300, 3500, 7000, 7500)}
_DIAGONALS = {part.lstrip(): mm for mm, parts in _MODELS.items() for part in parts.split(",")} | _EXCEPTIONS


def sensor_diagonal(make: str | None, model: str | None) -> float | None:
    """Diagonal in mm of the sensor of a camera named as EXIF names it, or None where the table does not know it."""
    name = f"{make or ''} {model or ''} ".lower()
    fitting = [part for part in _DIAGONALS if part in name]
    return _DIAGONALS[max(fitting, key=len)] if fitting else None


def sensor_diagonals() -> frozenset[float]:
    """Diagonals in mm of all sensors in the table."""
    return frozenset(_DIAGONALS.values())
