"""ICC profiles, made for pictures that name primaries or a curve without having one."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from .primaries import D50, REC709, columns_under_d50

Chromaticity = tuple[float, float]

D65: Chromaticity = REC709[6:]
# sRGB's curve (IEC 61966-2-1) as parameters g, a, b, c, d of a parametric curve of kind 3.
_SRGB_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)


def matrix_profile(name: str, primaries: tuple[Chromaticity, ...], white: Chromaticity = D65) -> bytes:
    """A version 4 profile with sRGB's curve.

    Parameters
    ----------
    name : str
        What it describes itself as.
    primaries : tuple of three (x, y)
        CIE chromaticities of red, green and blue.
    white : (x, y), optional
        Of their white.

    Returns
    -------
    bytes
    """
    named = [value for one in (*primaries, white) for value in one]
    return display_profile(name, columns_under_d50(named), srgb_curve())


def srgb_curve() -> bytes:
    """The tag of sRGB's curve."""
    return struct.pack(">4sIHH", b"para", 0, 3, 0) + _fixed(*_SRGB_CURVE)


def gamma_curve(gamma: float) -> bytes:
    """The tag of a curve that is a power."""
    return struct.pack(">4sIHH", b"para", 0, 0, 0) + _fixed(gamma)


def display_profile(name: str, columns: Sequence[Sequence[float]], curve: bytes) -> bytes:
    """A display profile of version 4: XYZ of red, green and blue under D50, none for gray; the curve of each."""
    tags = {b"desc": _text(name), b"cprt": _text("No copyright"), b"wtpt": _xyz_tag(*D50)}
    tags |= {key: _xyz_tag(*column) for key, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), columns, strict=False)}
    tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC") if columns else (b"kTRC",), curve)
    at, listed, body = 128 + 4 + 12 * len(tags), struct.pack(">I", len(tags)), b""
    for key, value in tags.items():
        listed += struct.pack(">4sII", key, at + len(body), len(value))
        body += value + bytes(-len(value) % 4)
    space = b"RGB " if columns else b"GRAY"
    header = struct.pack(">I4xI4s4s4s12x4s28x", at + len(body), 0x04200000, b"mntr", space, b"XYZ ", b"acsp")
    return (header + _fixed(*D50)).ljust(128, b"\0") + listed + body


def _fixed(*values: float) -> bytes:
    return struct.pack(f">{len(values)}i", *(round(value * 65536) for value in values))


def _xyz_tag(*values: float) -> bytes:
    return b"XYZ " + bytes(4) + _fixed(*values)


def _text(words: str) -> bytes:
    """A tag of one text, in English."""
    coded = words.encode("utf-16-be")
    return b"mluc" + struct.pack(">IIIHHII", 0, 1, 12, 0x656E, 0x5553, len(coded), 28) + coded
