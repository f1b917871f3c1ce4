"""What further chunks of a PNG say of its colours and its orientation: gAMA, cHRM, tRNS, and EXIF held in texts."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Mapping

from ..raster.matrix_profile import display_profile, gamma_curve, srgb_curve
from ..raster.primaries import REC709, columns_under_d50

# names of chunks that `read_structure` keeps for this module
KEPT = frozenset((b"gAMA", b"cHRM", b"sRGB", b"tRNS", b"tEXt", b"zTXt"))
# ImageMagick and ExifTool write EXIF into texts of these names, as lines of hexadecimal numbers
_EXIF_TEXTS = (b"Raw profile type exif", b"Raw profile type APP1")
# gAMA of sRGB, and by how much it may differ: writers round
_SRGB_GAMMA, _SAME = 45455, 0.02


def exif_in_text(chunks: Mapping[bytes, list[bytes]], most: int) -> bytes | None:
    """An EXIF block that a text chunk holds, None where none does; most: bytes that a packed one may have."""
    for name, bodies in chunks.items():
        for body in bodies:
            keyword, _, rest = body.partition(b"\0")
            if keyword not in _EXIF_TEXTS or name not in (b"tEXt", b"zTXt"):
                continue
            text = _inflated(rest[1:], most) if name == b"zTXt" else rest
            found = re.match(rb"\s*\w+\s+\d+\s+([0-9a-fA-F\s]+)", text)
            digits = b"" if found is None else re.sub(rb"\s", b"", found[1])
            block = bytes.fromhex(digits[: len(digits) // 2 * 2].decode())
            if block:
                return block.removeprefix(b"Exif\0\0")
    return None


def _inflated(packed: bytes, most: int) -> bytes:
    try:
        return zlib.decompressobj().decompress(packed, most)
    except zlib.error:
        return b""


def transparent_level(chunks: Mapping[bytes, list[bytes]], colour_type: int, depth: int) -> tuple[int, ...]:
    """The level of each channel, as decoders have it, that tRNS calls transparent; none without palette or tRNS.

    colour_type, depth: as IHDR has them. Less than 8 bits are spread over a byte.
    """
    channels = {0: 1, 2: 3}.get(colour_type, 0)
    body = chunks.get(b"tRNS", [b""])[0]
    if not channels or len(body) < 2 * channels or not 1 <= depth <= 16:
        return ()
    most = (1 << depth) - 1
    levels = struct.unpack_from(f">{channels}H", body)
    return tuple((level & most) * 255 // most if depth < 8 else level & most for level in levels)


def profile_of(chunks: Mapping[bytes, list[bytes]], gray: bool) -> bytes | None:
    """An ICC profile that means what gAMA and cHRM say; None where that is sRGB, or nothing is said."""
    if b"sRGB" in chunks:
        return None
    body = chunks.get(b"gAMA", [b""])[0]
    gamma = int.from_bytes(body[:4], "big") if len(body) >= 4 else _SRGB_GAMMA
    body = chunks.get(b"cHRM", [b""])[0]
    places = [value / 1e5 for value in struct.unpack_from(">8I", body)] if len(body) >= 32 else []
    stated = places[2:] + places[:2]  # white comes first there
    usual_gamma = abs(gamma / _SRGB_GAMMA - 1) < _SAME
    usual_primaries = all(abs(one - other) < 0.003 for one, other in zip(stated, REC709, strict=False))
    if not 1_000 <= gamma <= 1_000_000 or (usual_gamma and usual_primaries):
        return None
    curve = srgb_curve() if usual_gamma else gamma_curve(1e5 / gamma)
    columns = [] if gray else columns_under_d50(REC709 if usual_primaries else stated)
    return display_profile("PNG gamma", columns, curve)
