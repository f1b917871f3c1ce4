"""Between what a file stores and light: transfer curves, ICC matrix profiles and the way to linear sRGB."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .options import PARTS

# Primaries of sRGB (IEC 61966-2-1), adapted to D50 by the Bradford matrix, as columns of XYZ: the connection space of
# ICC profiles is D50. Values: B. Lindbloom, "RGB/XYZ Matrices", sRGB, reference white D50.
_SRGB_TO_XYZ_D50 = np.array([
    [0.4360747, 0.3850649, 0.1430804],
    [0.2225045, 0.7168786, 0.0606169],
    [0.0139322, 0.0971045, 0.7141733],
])
_LEVELS = 65536


@dataclass(frozen=True, eq=False)
class Curve:
    """A transfer curve: `table[k]` (float32, 65536 entries, rising from 0 to 1) is the light of the 16-bit level k.

    An 8-bit level k stands at 257 k, so one table serves both depths and any kind of profile.
    """

    table: NDArray[Any]

    @cached_property
    def levels_by_root(self) -> NDArray[Any]:
        """16-bit level (float32) of light s², for s = 0 .. 1 in 65536 steps.

        The square root spreads the darks: with a plain grid over light the first levels of a gamma curve collide.
        """
        root = np.linspace(0.0, 1.0, _LEVELS)
        return np.interp(root * root, self.table.astype(np.float64), np.arange(_LEVELS)).astype(np.float32)

    @cached_property
    def bytes_by_root(self) -> NDArray[Any]:
        """8-bit level (uint8, rounded) of light s², for s = 0 .. 1 in 65536 steps."""
        levels: NDArray[Any] = np.rint(self.levels_by_root / 257.0).astype(np.uint8)
        return levels


@lru_cache(maxsize=1)
def srgb_curve() -> Curve:
    """The curve of sRGB (IEC 61966-2-1)."""
    coded = np.linspace(0.0, 1.0, _LEVELS)
    light = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return Curve(light.astype(np.float32))


def decode(coded: NDArray[Any], curves: tuple[Curve, ...] | None = None) -> NDArray[Any]:
    """Display-encoded levels to light.

    Parameters
    ----------
    coded : (H, W, C) uint8 or uint16 array
    curves : tuple of Curve, optional
        One for all channels or one for each; sRGB by default.

    Returns
    -------
    (H, W, C) float32 array
        In [0, 1].
    """
    curves = curves or (srgb_curve(),)
    light = np.empty(coded.shape, np.float32)
    for part, curve in _parts(curves):
        levels = np.ascontiguousarray(coded[part])
        if coded.dtype == np.uint8:
            light[part] = cv2.LUT(levels, np.ascontiguousarray(curve.table[::257])).reshape(levels.shape)
        else:
            light[part] = curve.table[levels]
    return light


def encode(light: NDArray[Any], bits: int, curves: tuple[Curve, ...] | None = None) -> NDArray[Any]:
    """Light to display-encoded levels, the inverse of `decode`: every level survives the round trip.

    Parameters
    ----------
    light : (H, W, C) float32 array
        Below 0 and NaN become 0, above 1 the highest level.
    bits : int
        8 or 16.
    curves : tuple of Curve, optional
        One for all channels or one for each; sRGB by default.

    Returns
    -------
    (H, W, C) uint8 or uint16 array
    """
    curves = curves or (srgb_curve(),)
    levels = np.empty(light.shape, np.uint8 if bits == 8 else np.uint16)
    for part, curve in _parts(curves):
        levels[part] = _encode(np.ascontiguousarray(light[part], np.float32), bits, curve)
    return levels


def _parts(curves: tuple[Curve, ...]) -> list[tuple[Any, Curve]]:
    """Index and curve: all channels in one go where they share it, for slicing them apart costs a copy each."""
    if len(curves) == 1:
        return [(..., curves[0])]
    return [((..., channel), curve) for channel, curve in enumerate(curves)]


def _encode(light: NDArray[Any], bits: int, curve: Curve) -> NDArray[Any]:
    flat = light.reshape(-1)
    levels = np.empty(flat.size, np.uint8 if bits == 8 else np.uint16)
    for start in range(0, flat.size, PARTS.values_at_once):
        part = slice(start, start + PARTS.values_at_once)
        block = flat[part]
        # fmax and fmin take the number when the other is NaN
        place = np.sqrt(np.fmin(np.fmax(block, np.float32(0)), np.float32(1))) * np.float32(_LEVELS - 1)
        if bits == 8:
            levels[part] = curve.bytes_by_root[(place + np.float32(0.5)).astype(np.intp)]
        else:
            below = np.minimum(place.astype(np.intp), _LEVELS - 2)
            low, high = curve.levels_by_root[below], curve.levels_by_root[below + 1]
            levels[part] = low + (high - low) * (place - below.astype(np.float32)) + np.float32(0.5)
    return levels.reshape(light.shape)


@dataclass(frozen=True, eq=False)
class IccProfile:
    """A matrix/TRC (or gray) ICC profile: how to come to its light, and from its light to linear sRGB.

    gray: the profile describes one channel. curves: one for all channels, or one for each of R, G, B. to_srgb: 3×3
    float64, linear sRGB = to_srgb @ linear profile RGB (both relative to D50); the identity for gray.
    """

    gray: bool
    curves: tuple[Curve, ...]
    to_srgb: NDArray[Any]


def icc_channels(icc: bytes) -> int:
    """Channels the profile is made for: 3 (RGB), 1 (gray), or 0: anything else, CMYK and damaged profiles included."""
    if len(icc) < 132 or icc[36:40] != b"acsp":
        return 0
    return {b"RGB ": 3, b"GRAY": 1}.get(icc[16:20], 0)


@lru_cache(maxsize=8)
def parse_icc(icc: bytes) -> IccProfile | None:
    """Reads a matrix/TRC RGB or gray profile from its bytes; None for every other kind and for damaged ones."""
    try:
        tags = _icc_tags(icc)
        if icc_channels(icc) == 1:
            curve = _curve(tags[b"kTRC"])
            return None if curve is None else IccProfile(True, (curve,), np.eye(3))
        if icc_channels(icc) != 3 or icc[20:24] != b"XYZ ":
            return None
        primaries = np.column_stack([_xyz(tags[name]) for name in (b"rXYZ", b"gXYZ", b"bXYZ")])
        sources = [tags[name] for name in (b"rTRC", b"gTRC", b"bTRC")]
        curves = [_curve(source) for source in dict.fromkeys(sources)]
        if abs(np.linalg.det(primaries)) < 1e-6 or any(curve is None for curve in curves):
            return None
        if len(curves) > 1:
            curves = [_curve(source) for source in sources]
        to_srgb = np.linalg.inv(_SRGB_TO_XYZ_D50) @ primaries
        return IccProfile(False, tuple(curve for curve in curves if curve is not None), to_srgb)
    except (struct.error, KeyError, ValueError):
        return None


def _icc_tags(icc: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", icc, 128)
    tags = {}
    for index in range(min(count, 200)):
        name, offset, size = struct.unpack_from(">4sII", icc, 132 + 12 * index)
        tags[name] = icc[offset : offset + size]
    return tags


def _xyz(tag: bytes) -> NDArray[Any]:
    if tag[:4] != b"XYZ ":
        raise ValueError("not an XYZ tag")
    return np.array(struct.unpack_from(">3i", tag, 8)) / 65536.0


def _curve(tag: bytes) -> Curve | None:
    """A `curv` or `para` tag (ICC.1:2010, 10.5 and 10.15) as a table; None where it does not rise."""
    coded = np.linspace(0.0, 1.0, _LEVELS)
    if tag[:4] == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        if count == 0:
            light = coded
        elif count == 1:
            light = coded ** (struct.unpack_from(">H", tag, 12)[0] / 256.0)
        else:
            samples = np.frombuffer(tag, ">u2", count, 12) / 65535.0
            light = np.interp(coded, np.linspace(0.0, 1.0, count), samples)
    elif tag[:4] == b"para":
        light = _parametric(tag, coded)
    else:
        raise ValueError("not a curve tag")
    light = np.clip(light, 0.0, 1.0)
    if not np.isfinite(light).all() or (np.diff(light) < 0).any() or light[-1] - light[0] < 0.5:
        return None
    return Curve(light.astype(np.float32))


def _parametric(tag: bytes, coded: NDArray[Any]) -> NDArray[Any]:
    (kind,) = struct.unpack_from(">H", tag, 8)
    if kind > 4:
        raise ValueError("unknown parametric curve")
    given = [value / 65536.0 for value in struct.unpack_from(f">{(1, 3, 4, 5, 7)[kind]}i", tag, 12)]
    # All five kinds are (a x + b)^g + e from d upwards and c x + f below; they differ in what is written down.
    g, a, b, c, d, e, f = given[0], 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if kind in (1, 2):
        a, b = given[1:3]
        d = -b / a if a else 0.0
        e = f = given[3] if kind == 2 else 0.0
    elif kind in (3, 4):
        a, b, c, d = given[1:5]
        e, f = given[5:7] if kind == 4 else (0.0, 0.0)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        return np.where(coded >= d, np.maximum(a * coded + b, 0.0) ** g + e, c * coded + f)
