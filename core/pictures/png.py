"""PNG files (ISO/IEC 15948), made strip by strip and packed by several threads: no copy of the picture is held.

Each row says what its pixels differ by from the pixel to the left (filter 1, "Sub"), and zlib packs runs of equal
bytes: about as small as slower ways on photographs. Strips are packed each on its own and end on a whole byte, so that
they stand one behind the other in one zlib stream (RFC 1950, 1951).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import strips
from ..system.threads import in_order
from .options import WRITING

SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Colour types by channels: gray, RGB, RGBA.
_KINDS = {1: 0, 3: 2, 4: 6}
_SUB = 1
# What zlib's streams begin with: 32 kB of memory, the fastest packing.
_ZLIB = b"\x78\x01"
_ADLER = 65521


def chunk(name: bytes, body: bytes) -> bytes:
    """A chunk of a PNG file."""
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(body, zlib.crc32(name)))


def encode_png(
    shape: tuple[int, int, int], bits: int, levels_of: Callable[[slice], NDArray[Any]]
) -> Iterator[bytes]:
    """A PNG file of (H, W, C) pixels, C = 1, 3 (RGB) or 4 (RGBA), in pieces: its signature and header first.

    levels_of(rows): the levels of some rows, uint8 for 8 bits and uint16 for 16. It is called by several threads, and
    each row is asked for once.
    """
    height, width, channels = shape

    def packed(rows: slice) -> tuple[bytes, int, int]:
        lines = _filtered(levels_of(rows)).data
        packer = zlib.compressobj(WRITING.png_level, zlib.DEFLATED, -zlib.MAX_WBITS, zlib.DEF_MEM_LEVEL, zlib.Z_RLE)
        body = packer.compress(lines) + packer.flush(zlib.Z_FINISH if rows.stop == height else zlib.Z_FULL_FLUSH)
        return (_ZLIB if rows.start == 0 else b"") + body, zlib.adler32(lines), lines.nbytes

    yield SIGNATURE + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, _KINDS[channels], 0, 0, 0))
    total = zlib.adler32(b"")
    for body, check, length in in_order(packed, strips(shape)):
        total = adler_of_both(total, check, length)
        yield chunk(b"IDAT", body)
    yield chunk(b"IDAT", struct.pack(">I", total)) + chunk(b"IEND", b"")


def adler_of_both(first: int, second: int, length: int) -> int:
    """The Adler-32 checksum (RFC 1950, section 9) of two texts, from theirs and the length of the second."""
    (a, b), (a_too, b_too) = ((check & 0xFFFF, check >> 16) for check in (first, second))
    return (b + b_too + length * (a - 1)) % _ADLER << 16 | (a + a_too - 1) % _ADLER


def _filtered(levels: NDArray[Any]) -> NDArray[np.uint8]:
    """Rows (h, 1 + bytes) as a PNG file holds them before packing: the filter's number, then the differences."""
    height = len(levels)
    step = levels.shape[2] * levels.itemsize
    stored = np.ascontiguousarray(levels, levels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    out = np.empty((height, 1 + stored.shape[1]), np.uint8)
    out[:, 0] = _SUB
    out[:, 1 : 1 + step] = stored[:, :step]
    np.subtract(stored[:, step:], stored[:, :-step], out=out[:, 1 + step :])
    return out
