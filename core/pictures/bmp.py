"""Headers of BMP files, of which decoders know the usual ones."""

from __future__ import annotations

import struct

# Bytes of the header of OS/2 1.x, whose sides have 16 bits, and of the first one with a mask for alpha.
_OS2_HEADER, _PLAIN_HEADER, _HEADER_WITH_ALPHA = 12, 40, 56
_BY_MASKS = 3  # the value of biCompression that says so


def bmp_size(data: bytes) -> tuple[int, int]:
    """(W, H) px of a BMP file of at least 26 bytes."""
    if _header(data) == _OS2_HEADER:
        width, height = struct.unpack_from("<HH", data, 18)
    else:
        width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)


def bmp_is_opaque(data: bytes) -> bool:
    """Whether the fourth byte of 32 bits is none of transparency: there is no mask for it."""
    if _header(data) < _PLAIN_HEADER or data[28:30] != b"\x20\0":
        return False
    masked = _header(data) >= _HEADER_WITH_ALPHA and int.from_bytes(data[30:34], "little") == _BY_MASKS
    return not masked or not any(data[66:70])


def neutral_bmp(data: bytes) -> bytes:
    """The same BMP with the usual header where it has that of OS/2 1.x, which decoders take for gray."""
    if _header(data) != _OS2_HEADER:
        return data
    (data_at,) = struct.unpack_from("<I", data, 10)
    bits = data[24:26]
    palette = b"".join(data[at : at + 3] + b"\0" for at in range(26, min(data_at, 26 + 3 * 256) - 2, 3))
    pixels = data[data_at:]
    head = struct.pack("<IiiH2s6I", _PLAIN_HEADER, *bmp_size(data), 1, bits, *[0] * 4, len(palette) // 4, 0)
    start = 14 + len(head) + len(palette)
    return struct.pack("<2sIII", b"BM", start + len(pixels), 0, start) + head + palette + pixels


def _header(data: bytes) -> int:
    return int.from_bytes(data[14:18], "little")
