"""An ICC profile of given primaries, for pictures that name theirs without having one."""

from __future__ import annotations

import struct

import numpy as np

Chromaticity = tuple[float, float]

D65: Chromaticity = (0.3127, 0.3290)
_D50 = (0.9642, 1.0, 0.8249)  # XYZ of the ICC's connection space
# From XYZ to the cone responses that Bradford's adaptation scales (ICC.1:2010, annex E).
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
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
    columns = np.array([_xyz(one) for one in primaries]).T
    of_white = np.array(_xyz(white))
    columns = columns * np.linalg.solve(columns, of_white)
    scale = (_BRADFORD @ _D50) / (_BRADFORD @ of_white)
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(scale) @ _BRADFORD @ columns
    curve = b"para" + struct.pack(">IHH", 0, 3, 0) + _fixed(*_SRGB_CURVE)
    tags = {b"desc": _text(name), b"cprt": _text("No copyright"), b"wtpt": _xyz_tag(*_D50)}
    tags |= {letter + b"XYZ": _xyz_tag(*column) for letter, column in zip((b"r", b"g", b"b"), adapted.T, strict=True)}
    tags |= {letter + b"TRC": curve for letter in (b"r", b"g", b"b")}
    at, listed, body = 128 + 4 + 12 * len(tags), struct.pack(">I", len(tags)), b""
    for key, value in tags.items():
        listed += struct.pack(">4sII", key, at + len(body), len(value))
        body += value + bytes(-len(value) % 4)
    header = struct.pack(">I4xI4s4s4s12x4s28x", at + len(body), 0x04000000, b"mntr", b"RGB ", b"XYZ ", b"acsp")
    return (header + _fixed(*_D50)).ljust(128, b"\0") + listed + body


def _xyz(chromaticity: Chromaticity) -> tuple[float, float, float]:
    x, y = chromaticity
    return x / y, 1.0, (1 - x - y) / y


def _fixed(*values: float) -> bytes:
    return struct.pack(f">{len(values)}i", *(round(value * 65536) for value in values))


def _xyz_tag(*values: float) -> bytes:
    return b"XYZ " + bytes(4) + _fixed(*values)


def _text(words: str) -> bytes:
    """A tag of one text, in English."""
    coded = words.encode("utf-16-be")
    return b"mluc" + struct.pack(">IIIHHII", 0, 1, 12, 0x656E, 0x5553, len(coded), 28) + coded
