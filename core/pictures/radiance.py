"""Radiance pictures (.hdr, .pic) in and out: three mantissas and one exponent of 8 bits a pixel, in runs.

A header of lines ends with an empty one; then comes the size with the order of the pixels, then scanlines. A scanline
is packed channel by channel, or holds plain pixels, in which (1, 1, 1, n) repeats the one before. As in Radiance itself
mantissas are cut off on the way out and read as the middle of what they stand for.

References
----------
Ward, Real Pixels, Graphics Gems II, 1991; Radiance's own src/common/color.c and header.c, for what its lines mean.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import strips
from ..raster.primaries import REC709, to_rec709
from ..system.errors import UnreadableImage
from ..system.threads import in_order
from .options import READING
from .radiance_header import read_header

# px of a scanline that may be packed channel by channel
_PACKED = range(8, 32768)
# What a mantissa of 8 bits is multiplied by, for each exponent; 0 stands for black.
_SCALE = np.ldexp(1.0, np.arange(256) - 136).astype(np.float32)
_SCALE[0] = 0
# The least light that is not black, and the shortest run that is worth one.
_LEAST, _SHORTEST_RUN = 1e-32, 4


def decode_radiance(data: bytes) -> tuple[NDArray[np.float32], list[str]]:
    """Light (H, W, 3) float32 in sRGB's primaries, upright, and warnings, of a whole file of a size that was checked.

    Raises UnreadableImage.
    """
    header, warnings = read_header(data), []
    if header.unknown:
        raise UnreadableImage(f"an HDR file of the kind {header.unknown!r} cannot be read; export it as EXR")
    width, height = header.size
    lines, length = (width, height) if header.by_columns else (height, width)
    try:
        stored = _scanlines(data, header.pixels_at, lines, length)
    except (IndexError, ValueError) as error:
        raise UnreadableImage("the HDR file is damaged or cut off; copy or export it again") from error
    if header.by_columns:
        stored = stored.transpose(1, 0, 2)
    stored = stored[:: -1 if header.flip_y else 1, :: -1 if header.flip_x else 1]
    light = np.empty((height, width, 3), np.float32)
    matrix = None
    if header.primaries is not None and not np.allclose(header.primaries, REC709, atol=READING.same_primaries):
        try:
            matrix = to_rec709(header.primaries)
        except ValueError:
            warnings.append("its line PRIMARIES describes no colours; they are taken as those of sRGB")
    for rows in strips(light.shape):
        part = (stored[rows, :, :3] + np.float32(0.5)) * _SCALE[stored[rows, :, 3]][..., None]
        with np.errstate(over="ignore", invalid="ignore"):  # what floats cannot hold is told further on
            part /= np.array(header.scale, np.float32)
            light[rows] = part if matrix is None else part @ matrix.T
    return light, [*header.warnings, *warnings]


def _scanlines(data: bytes, at: int, lines: int, length: int) -> NDArray[np.uint8]:
    """Pixels (lines, length, 4) as stored. Raises IndexError where the file ends too soon, ValueError where damaged."""
    mark = bytes((2, 2, length >> 8, length & 255)) if length in _PACKED else b""
    if not mark or data[at : at + 4] != mark:
        return _plain_pixels(data, at, lines * length).reshape(lines, length, 4)
    # Each packed byte gives at most 64: without them there is no use in filling the memory first.
    if (len(data) - at) * 64 < 4 * lines * length:
        raise IndexError("cut off")
    out = np.empty((lines, 4, length), np.uint8)
    for line in range(lines):
        if data[at : at + 4] != mark:
            raise ValueError("not packed as those before")
        at += 4
        channels = bytearray()
        for channel in range(1, 5):
            at = _unpack(data, at, channels, channel * length)
        out[line] = np.frombuffer(channels, np.uint8).reshape(4, length)
    return out.transpose(0, 2, 1)


def _unpack(data: bytes, at: int, out: bytearray, length: int) -> int:
    """Appends the runs from byte `at` on until there are so many bytes; returns where the next begins."""
    while len(out) < length:
        count = data[at]
        if count > 128:
            out += data[at + 1 : at + 2] * (count - 128)
            at += 2
        elif count:
            out += data[at + 1 : at + 1 + count]
            at += 1 + count
        else:
            raise ValueError("an empty run")
    if len(out) > length or at > len(data):
        raise ValueError("a run that does not end with its scanline")
    return at


def _plain_pixels(data: bytes, at: int, count: int) -> NDArray[np.uint8]:
    """So many pixels (count, 4) from byte `at` on, where (1, 1, 1, n) stands for n more of the one before, and behind
    another such for 256 n more."""
    found = np.frombuffer(data, np.uint8, (len(data) - at) // 4 * 4, at).reshape(-1, 4)[:count]
    repeats = (found[:, :3] == 1).all(axis=1)
    if not repeats.any():
        if len(found) < count:
            raise IndexError("cut off")
        return found
    if repeats[0]:
        raise ValueError("nothing to repeat")
    number = np.arange(len(found))
    last = np.maximum.accumulate(np.where(repeats, 0, number))  # the pixel that is repeated
    shift = np.minimum(number - last - 1, 4)
    times = np.where(repeats, found[:, 3].astype(np.int64) << (8 * np.maximum(shift, 0)), 1)
    ends = np.cumsum(times)
    needed = int(np.searchsorted(ends, count)) + 1
    if needed > len(found) or ends[needed - 1] != count:
        raise IndexError("cut off")
    pixels: NDArray[np.uint8] = found[np.repeat(last[:needed], times[:needed])]
    return pixels


def encode_radiance(
    shape: tuple[int, ...], light_of: Callable[[slice], NDArray[Any]], lines: dict[str, str]
) -> Iterator[bytes]:
    """A Radiance file of light (H, W, C), C = 1 or 3, in sRGB's primaries, in pieces.

    light_of(rows): the light of some rows, float32. It is called by several threads. lines: of the header.
    """
    height, width = shape[:2]

    def pixels(rows: slice) -> bytes:
        light = light_of(rows)
        stored = _mantissas(light if light.shape[2] == 3 else np.repeat(light, 3, axis=2))
        return _packed(stored) if width in _PACKED else stored.tobytes()

    primaries = " ".join(f"{value:.4f}" for value in REC709)
    header_lines = {**lines, "PRIMARIES": primaries, "FORMAT": "32-bit_rle_rgbe"}
    header = "".join(f"{name}={text}\n" for name, text in header_lines.items())
    yield f"#?RADIANCE\n{header}\n-Y {height} +X {width}\n".encode()
    yield from in_order(pixels, strips(shape))


def _mantissas(light: NDArray[Any]) -> NDArray[np.uint8]:
    """Pixels (h, W, 4) as they are stored: what is negative becomes black, what is too bright as bright as can be."""
    light = np.clip(np.nan_to_num(light), 0, np.float32(255) * _SCALE[255])
    brightest = light.max(axis=2)
    part, exponent = np.frexp(brightest)
    shown = brightest > _LEAST
    scale = np.where(shown, np.ldexp(np.float32(256), -np.where(shown, exponent, 0)), 0)
    out = np.empty((*brightest.shape, 4), np.uint8)
    out[..., :3] = np.minimum(light * scale[..., None], 255)
    out[..., 3] = np.where(shown, exponent + 128, 0)
    return out


def _packed(stored: NDArray[np.uint8]) -> bytes:
    """Scanlines (h, W, 4), each behind its mark and channel by channel: runs of equal bytes, and what lies between."""
    lines, length = 4 * len(stored), stored.shape[1]
    values = stored.transpose(0, 2, 1).reshape(-1)
    differs = np.empty((lines, length), bool)
    differs[:, 0] = True
    np.not_equal(values.reshape(lines, length)[:, 1:], values.reshape(lines, length)[:, :-1], out=differs[:, 1:])
    starts = np.flatnonzero(differs)
    is_run = np.diff(starts, append=values.size) >= _SHORTEST_RUN
    # what is no run goes on until one begins or the line ends
    begins = is_run | (starts % length == 0)
    begins[1:] |= is_run[:-1]
    starts, is_run = starts[begins], is_run[begins]
    lengths = np.diff(starts, append=values.size)
    # neither may be longer than its count can say
    most = np.where(is_run, 127, 128)
    pieces = -(-lengths // most)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    is_run, most = np.repeat(is_run, pieces), np.repeat(most, pieces)
    lengths = np.minimum(np.repeat(lengths, pieces) - number * most, most)
    starts = np.repeat(starts, pieces) + number * most
    sizes = np.where(is_run, 2, 1 + lengths)
    at = np.cumsum(sizes) - sizes + 4 * (1 + starts // (4 * length))
    out = np.empty(int(sizes.sum()) + 4 * len(stored), np.uint8)
    out[at] = np.where(is_run, 128 + lengths, lengths)
    out[at[is_run] + 1] = values[starts[is_run]]
    plain = ~is_run
    from_at = np.flatnonzero(np.repeat(plain, lengths))
    out[from_at + np.repeat(at[plain] + 1 - starts[plain], lengths[plain])] = values[from_at]
    for offset, byte in enumerate((2, 2, length >> 8, length & 255)):
        out[at[starts % (4 * length) == 0] - 4 + offset] = byte
    return out.tobytes()
