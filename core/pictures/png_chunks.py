"""What further chunks of a PNG say of its colours and its orientation: gAMA, cHRM, tRNS, and EXIF held in texts."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Mapping, Sequence

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
    usual_primaries = all(abs(one - other) < 0.003 for one, other in zip(stated, _SRGB_PRIMARIES, strict=False))
    if not 1_000 <= gamma <= 1_000_000 or (usual_gamma and usual_primaries):
        return None
    from ..raster.primaries import columns_under_d50  # hardly any PNG comes here

    curve = _SRGB if usual_gamma else struct.pack(">4sIHHi", b"para", 0, 0, 0, round(65536 * 1e5 / gamma))
    return _icc([] if gray else columns_under_d50(_SRGB_PRIMARIES if usual_primaries else stated), curve)


# xy of red, green, blue and white of sRGB; its curve as a parametric one (ICC.1:2010, 10.15)
_SRGB_PRIMARIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
_SRGB_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
_SRGB = struct.pack(">4sIHH5i", b"para", 0, 3, 0, *(round(65536 * value) for value in _SRGB_CURVE))
# the white that ICC profiles connect by (ICC.1:2010, 7.2.16)
_D50 = (0.9642, 1.0, 0.8249)


def _icc(columns: Sequence[Sequence[float]], curve: bytes) -> bytes:
    """A display profile of version 4: XYZ of red, green and blue under D50, none for gray; the curve of each."""

    def xyz(values: Sequence[float]) -> bytes:
        return struct.pack(">4sI3i", b"XYZ ", 0, *(round(65536 * value) for value in values))

    def text(words: str) -> bytes:
        head = struct.pack(">4sIIIHHII", b"mluc", 0, 1, 12, 0x656E, 0x5553, 2 * len(words), 28)
        return head + words.encode("utf-16-be")

    tags = {b"desc": text("PNG gamma"), b"cprt": text("none"), b"wtpt": xyz(_D50)}
    tags |= {name: xyz(column) for name, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), columns, strict=False)}
    tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC") if columns else (b"kTRC",), curve)
    table, body, at = b"", b"", 128 + 4 + 12 * len(tags)
    for name, value in tags.items():
        value = value.ljust(-(-len(value) // 4) * 4, b"\0")
        table += struct.pack(">4sII", name, at + len(body), len(value))
        body += value
    space = b"RGB " if columns else b"GRAY"
    head = struct.pack(
        ">I4sI4s4s4s12s4s4s24s3i", at + len(body), b"", 0x04200000, b"mntr", space, b"XYZ ", b"", b"acsp", b"", b"",
        *(round(65536 * value) for value in _D50),
    )  # fmt: skip
    return head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + body
