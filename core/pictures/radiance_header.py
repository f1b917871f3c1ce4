"""What stands before the pixels of a Radiance picture: lines of text, and its size with the order of its pixels."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from .options import READING

_STARTS = (b"#?RADIANCE", b"#?RGBE")
_SIZE = re.compile(rb"([+-])([XY]) (\d{1,9}) ([+-])([XY]) (\d{1,9})\s*")
# x, y of red, green, blue and white: X, Y and Z themselves, about equal energy
_XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)
_KINDS = ("32-bit_rle_rgbe", "32-bit_rle_xyze")


@dataclass(frozen=True)
class RadianceHeader:
    """What stands before the pixels.

    Attributes
    ----------
    size : (int, int)
        (W, H) px upright; (0, 0) where it is damaged.
    by_columns, flip_x, flip_y : bool
        Whether a scanline is a column, whether x runs to the left, whether y runs up.
    scale : tuple of float
        What red, green and blue were multiplied by (EXPOSURE and COLORCORR).
    primaries : tuple of 8 floats or None
        x, y of red, green, blue and white, where they are named.
    pixels_at : int
        Byte of the first scanline.
    unknown : str
        A kind of pixels that is not read, or "".
    warnings : tuple of str
        For the user.
    damage : str
        What is broken, or "".
    """

    size: tuple[int, int] = (0, 0)
    by_columns: bool = False
    flip_x: bool = False
    flip_y: bool = False
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    primaries: tuple[float, ...] | None = None
    pixels_at: int = 0
    unknown: str = ""
    warnings: tuple[str, ...] = ()
    damage: str = ""


def is_radiance(data: bytes) -> bool:
    """Whether a file begins as a Radiance picture does."""
    return data.startswith(_STARTS)


def read_header(data: bytes) -> RadianceHeader:
    """The header of a Radiance picture. Raises nothing."""
    end = data.find(b"\n\n", 0, READING.max_header_bytes)
    size = _SIZE.fullmatch(data[end + 2 : (data.find(b"\n", end + 2) + 1) or None][:64]) if end >= 0 else None
    if size is None or size[2] == size[5]:
        return RadianceHeader(damage="its header is not whole")
    scale, unknown = np.ones(3), ""
    primaries: tuple[float, ...] | None = None
    warnings: list[str] = []
    for line in data[:end].split(b"\n")[1:]:
        name, _, text = (part.strip().decode("latin-1") for part in line.partition(b"="))
        if name == "FORMAT":
            primaries = _XYZ if text == _KINDS[1] else primaries
            unknown = "" if text in _KINDS else text
        if name not in ("EXPOSURE", "COLORCORR", "PRIMARIES", "PIXASPECT"):
            continue
        values = _numbers(text)
        if name == "PRIMARIES" and len(values) == 8:
            primaries = tuple(values)
        elif name == "PIXASPECT" and len(values) == 1:
            if abs(values[0] - 1) > READING.square_pixels:
                warnings.append(f"its pixels are not square (PIXASPECT={text}); they are taken as square")
        elif len(values) == {"EXPOSURE": 1, "COLORCORR": 3}.get(name) and min(values) > 0:
            scale = scale * values
        else:
            warnings.append(f"its line {name}={text[:40]} cannot be understood and is left out")
    if not ((scale > READING.least_scale) & (scale < 1 / READING.least_scale)).all():
        scale = np.ones(3)
        warnings.append("its lines EXPOSURE and COLORCORR leave no light and are left out")
    signs = {size[2]: size[1], size[5]: size[4]}
    counts = {size[2]: int(size[3]), size[5]: int(size[6])}
    return RadianceHeader(
        (counts[b"X"], counts[b"Y"]), size[2] == b"X", signs[b"X"] == b"-", signs[b"Y"] == b"+",
        tuple(scale.tolist()), primaries, end + 2 + len(size[0]), unknown, tuple(warnings),
    )  # fmt: skip


def _numbers(text: str) -> list[float]:
    """The finite numbers of a line; none of them if it holds anything else."""
    try:
        values = [float(part) for part in text.split()]
    except ValueError:
        return []
    return values if np.isfinite(values).all() else []
