"""Strips and tiles of a TIFF unpacked, with damage inside them found, which libtiff passes over for 8-bit pictures."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.errors import UnreadableImage
from .containers import read_structure
from .opencv import decoded

DEFLATE = (8, 32946)
LZW, PACK_BITS, JPEG = 5, 32773, 7
UNPACKED_HERE = (1, LZW, PACK_BITS, JPEG, *DEFLATE)
# bytes of strips that are handed to libtiff at once, so that memory stays bounded
_AT_ONCE = 1 << 26


def damaged() -> UnreadableImage:
    """What is said of picture data that cannot be unpacked."""
    return UnreadableImage("the TIFF file is damaged: its picture data cannot be unpacked; copy or export it again")


def unpacked(pieces: Sequence[bytes], rows: Sequence[int], row_bytes: int, compression: int) -> list[bytes]:
    """Pieces (strips or tiles) without their compression.

    Parameters
    ----------
    pieces : sequence of bytes
        As they stand in the file.
    rows : sequence of int
        Rows of pixels in each.
    row_bytes : int
        Bytes of a row.
    compression : int
        One of `UNPACKED_HERE` but JPEG.

    Returns
    -------
    list of bytes

    Raises
    ------
    UnreadableImage
        A piece is damaged, or holds less than its rows.
    """
    if compression == LZW:
        return _unpacked_lzw(pieces, rows, row_bytes)
    out = []
    for piece, count in zip(pieces, rows, strict=True):
        size = count * row_bytes
        if compression in DEFLATE:
            piece = _inflated(piece, size)
        elif compression == PACK_BITS:
            piece = _unpacked_bits(piece, size)
        if len(piece) < size:
            raise damaged()
        out.append(piece[:size])
    return out


def _inflated(packed: bytes, size: int) -> bytes:
    stream = zlib.decompressobj()
    try:
        plain = stream.decompress(packed, size)
        if not stream.eof:
            stream.decompress(stream.unconsumed_tail, 1)  # up to the checksum behind the data
    except zlib.error as error:
        raise damaged() from error
    return plain


def _unpacked_bits(packed: bytes, size: int) -> bytes:
    out, at = bytearray(), 0
    while len(out) < size and at < len(packed):
        head = packed[at]
        if head < 128:
            out += packed[at + 1 : at + 2 + head]
            at += head + 2
        elif head > 128:
            out += packed[at + 1 : at + 2] * (257 - head)
            at += 2
        else:
            at += 1
    return bytes(out)


def _unpacked_lzw(pieces: Sequence[bytes], rows: Sequence[int], row_bytes: int) -> list[bytes]:
    """The same for LZW: libtiff unpacks the strips of a gray picture whose samples are the bytes."""
    out: list[bytes] = []
    at_once = max(1, _AT_ONCE // max(1, max(rows) * row_bytes))
    start = 0
    while start < len(pieces):
        end = start + 1
        while end < len(pieces) and end - start < at_once and rows[end] == rows[start]:
            end += 1
        out += _lzw_strips(pieces[start:end], rows[start], row_bytes)
        start = end
    return out


def _lzw_strips(pieces: Sequence[bytes], rows: int, row_bytes: int) -> list[bytes]:
    """Strips with as many rows each."""
    size = rows * row_bytes
    width, height = row_bytes, rows
    if row_bytes % 2 == 0:
        width //= 2
    elif rows % 2 == 0:
        height //= 2
    if width * height * 2 == size:
        samples = _gray(pieces, width, height, 16)
    else:
        # of 8 bits libtiff lets damage pass: read with 16, all but a row (or less), it is told
        if height > 1 and _gray(pieces, width, height // 2, 16) is None:
            raise damaged()
        samples = _gray(pieces, width, height, 8)
    if samples is None:
        raise damaged()
    flat = samples.tobytes()
    return [flat[at : at + size] for at in range(0, len(flat), size)]


def _gray(pieces: Sequence[bytes], width: int, height: int, bits: int) -> NDArray[np.uint8 | np.uint16] | None:
    """A gray picture (pieces × height, width) of LZW strips, in this machine's order of bytes; None where damaged."""
    count = len(pieces)
    entries = [(256, 4, 1, width), (257, 4, 1, height * count), (258, 3, 1, bits), (259, 3, 1, LZW), (262, 3, 1, 1),
               (273, 4, count, 0), (277, 3, 1, 1), (278, 4, 1, height), (279, 4, count, 0)]  # fmt: skip
    directory_end = 8 + 2 + 12 * len(entries) + 4
    data_at = directory_end + (8 * count if count > 1 else 0)
    starts = np.cumsum([data_at, *(len(piece) for piece in pieces[:-1])])
    head = b"II*\0" + struct.pack("<IH", 8, len(entries))
    for tag, kind, values, value in entries:
        if tag in (273, 279):
            value = directory_end + (4 * count if tag == 279 else 0)
            if count == 1:
                value = int(starts[0]) if tag == 273 else len(pieces[0])
        head += struct.pack("<HHII", tag, kind, values, value)
    head += struct.pack("<I", 0)
    if count > 1:
        head += struct.pack(f"<{count}I", *starts) + struct.pack(f"<{count}I", *map(len, pieces))
    found = decoded(b"".join([head, *pieces]))
    if found is None or found.shape[:2] != (height * count, width):
        return None
    return found if found.ndim == 2 else np.ascontiguousarray(found[..., 0])


def jpeg_piece(piece: bytes, tables: bytes, size: tuple[int, int], coded: bool) -> NDArray[np.uint8]:
    """A strip or tile that is a JPEG.

    Parameters
    ----------
    piece : bytes
        As it stands in the file.
    tables : bytes
        What all pieces share (tag JPEGTables), may be empty.
    size : (int, int)
        (W, H) px of the piece, at least.
    coded : bool
        Whether its colours are stored as luminance and chroma.

    Returns
    -------
    (H, W, C) uint8
        C = 1 or 3 (R, G, B); not smaller than `size`.
    """
    # told by Adobe's marker: without it, libjpeg guesses
    adobe = b"\xff\xee\x00\x0eAdobe\x00\x64\x00\x00\x00\x00" + bytes([coded])
    shared = tables[2 : tables.rfind(b"\xff\xd9")] if tables[:2] == b"\xff\xd8" else b""
    whole = b"\xff\xd8" + adobe + shared + piece[2:]
    structure = read_structure(whole)
    fits = structure is not None and size[0] <= structure.width <= 2 * size[0] + 64
    if structure is None or structure.damage or not fits or not size[1] <= structure.height <= 65500:
        raise damaged()
    if structure.width * structure.height > 4 * max(size[0] * size[1], _AT_ONCE // 4):
        raise damaged()
    found = decoded(whole)
    if found is None or found.dtype != np.uint8:
        raise damaged()
    return found[..., None] if found.ndim == 2 else cv2.cvtColor(found, cv2.COLOR_BGR2RGB)
