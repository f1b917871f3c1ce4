"""TIFF files to raw samples: every depth, byte order, plane and tile, which OpenCV scrambles or refuses.

Compressed JPEG pieces and LZW go through libjpeg and libtiff all the same (see `tiff_pieces`), and so do whole files of
kinds that only they know: fax, Lab, LogLuv.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..system.errors import UnreadableImage
from .containers import TiffEntry, tiff_bytes, tiff_directory, tiff_integers, tiff_layout
from .tiff_pieces import JPEG, UNPACKED_HERE, damaged, jpeg_piece, unpacked

_FOREIGN = {
    6: "JPEG of the old kind", 33003: "JPEG 2000", 33005: "JPEG 2000", 34712: "JPEG 2000", 34887: "LERC",
    34925: "LZMA", 34892: "lossy JPEG of a DNG", 50000: "Zstandard", 34926: "Zstandard", 50001: "WebP",
    34927: "WebP", 50002: "JPEG XL", 52546: "JPEG XL",
}  # fmt: skip
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _CMYK, _YCBCR = 0, 1, 2, 3, 5, 6
_COLOURS = {_WHITE_IS_ZERO: 1, _BLACK_IS_ZERO: 1, _RGB: 3, _PALETTE: 1, _CMYK: 4, _YCBCR: 3}
# Colours that libtiff turns into RGB with another white than theirs.
_FOREIGN_COLOURS = {8: "CIELab", 9: "ICCLab", 10: "ITULab"}
_UNSIGNED, _SIGNED, _FLOAT, _UNDEFINED = 1, 2, 3, 4
# Channels that a picture may have: spectral stacks have hundreds, and what they show is no picture.
_MOST_SAMPLES = 64
# samples that are unpacked from odd numbers of bits at once, so that memory stays bounded
_BITS_AT_ONCE = 1 << 22
_REVERSED = bytes(int(f"{value:08b}"[::-1], 2) for value in range(256))


@dataclass(frozen=True)
class _Layout:
    """How the first page stores its samples; extras: what ExtraSamples says (None: it is absent)."""

    order: str
    size: tuple[int, int]
    samples: int
    bits: int
    kind: int
    compression: int
    predictor: int
    photometric: int
    planar: bool
    piece: tuple[int, int]
    tiled: bool
    starts: list[int]
    lengths: list[int]
    extras: list[int] | None
    backwards: bool
    tables: bytes
    palette: list[int]

    @property
    def colours(self) -> int:
        """Samples of a pixel that are colour."""
        if self.photometric in (_WHITE_IS_ZERO, _BLACK_IS_ZERO) and self.samples >= 3:
            # scientific programs call three channels gray; nobody means two kinds of transparency
            return 3
        return _COLOURS[self.photometric]

    @property
    def alpha_at(self) -> int | None:
        """The sample that is transparency, None where there is none."""
        if self.samples <= self.colours:
            return None
        if self.extras is None:  # simple programs leave the tag out
            return self.colours if self.samples == self.colours + 1 else None
        for number, meaning in enumerate(self.extras[: self.samples - self.colours]):
            if meaning in (1, 2):
                return self.colours + number
        return None


@dataclass(frozen=True)
class TiffSamples:
    """raw: (H, W, 1 to 4) uint8, uint16 or float32 in R, G, B, A order, not turned; associated: colours are multiplied
    by alpha; warnings in words."""

    raw: NDArray[np.generic]
    associated: bool
    warnings: tuple[str, ...]


def read_tiff(data: bytes) -> TiffSamples | None:
    """The first page of a TIFF file; None for the kinds that are left to OpenCV.

    Raises UnreadableImage for what is damaged, and for compressions and kinds of samples that nothing here reads.
    """
    layout = _layout(data)
    _refuse_layout(layout)
    if _left_to_opencv(layout):
        return None
    _refuse_samples(layout)
    if layout.samples < layout.colours:
        raise UnreadableImage(
            f"a TIFF file of {layout.samples} channels where its colours need {layout.colours}; export it again as RGB"
        )
    alpha_at = layout.alpha_at
    wanted = [*range(layout.colours), *([] if alpha_at is None else [alpha_at])]
    raw = _scaled(_samples(data, layout, wanted), layout)
    associated = alpha_at is not None and layout.extras is not None and layout.extras[alpha_at - layout.colours] == 1
    left = layout.samples - len(wanted)
    what = "a channel that is no transparency (infrared, a saved selection) is"
    if left > 1:
        what = f"{left} channels beyond its colours are"
    warnings = (f"{what} left out",) if left else ()
    return TiffSamples(raw, associated, warnings)


def _layout(data: bytes) -> _Layout:
    directory = tiff_directory(data)
    entries: dict[int, TiffEntry] = {entry.tag: entry for entry in directory[0]} if directory is not None else {}

    def values(tag: int) -> list[int]:
        found = tiff_integers(data, entries.get(tag))
        if tag in entries and len(found) < entries[tag].values:
            raise UnreadableImage("the TIFF file is damaged: its directory is cut off; copy or export it again")
        return found

    def first(tag: int, otherwise: int) -> int:
        return (values(tag) or [otherwise])[0]

    width, height, samples = first(256, 0), first(257, 0), first(277, 1)
    bits, kinds = values(258) or [1], values(339) or [_UNSIGNED]
    if len(set(bits)) > 1 or len(set(kinds)) > 1:
        raise UnreadableImage("a TIFF file whose channels differ in depth; export it with one depth for all")
    tiled = 322 in entries
    rows = min(first(278, height) or height, height)
    tables = entries.get(347)
    return _Layout(
        tiff_layout(data)[0], (width, height), samples, bits[0], kinds[0], first(259, 1), first(317, 1),
        first(262, _BLACK_IS_ZERO), first(284, 1) == 2 and samples > 1,
        (first(322, 0), first(323, 0)) if tiled else (width, rows), tiled, values(324 if tiled else 273),
        values(325 if tiled else 279), values(338) or None, first(266, 1) == 2,
        b"" if tables is None else tiff_bytes(data, tables), values(320),
    )  # fmt: skip


def _left_to_opencv(layout: _Layout) -> bool:
    """Whether only libtiff knows this kind, or libjpeg with it."""
    if layout.photometric not in _COLOURS or layout.compression not in UNPACKED_HERE:
        return True
    if layout.compression != JPEG:
        return layout.photometric == _YCBCR
    return layout.bits != 8 or layout.planar or layout.samples not in (1, 3)


def _refuse_layout(layout: _Layout) -> None:
    """Raises UnreadableImage by name for compressions and colours that are not read, and for what is no picture."""
    if layout.photometric in _FOREIGN_COLOURS:
        name = _FOREIGN_COLOURS[layout.photometric]
        raise UnreadableImage(f"this TIFF holds {name} colours, which are not read; save it as RGB")
    if layout.compression in _FOREIGN:
        name = _FOREIGN[layout.compression]
        raise UnreadableImage(f"this TIFF is compressed as {name}, which is not read; save it with LZW or ZIP instead")
    if layout.samples > _MOST_SAMPLES:
        raise UnreadableImage(f"a TIFF file of {layout.samples} channels is no picture; export three of them as RGB")


def _refuse_samples(layout: _Layout) -> None:
    """Raises UnreadableImage by name for numbers that are not read."""
    depth = f"{layout.bits}-bit"
    if layout.kind == _FLOAT and layout.bits not in (16, 32, 64):
        raise UnreadableImage(f"{depth} float samples cannot be read; save the picture with 16 or 32 bits (float)")
    if layout.kind == _SIGNED:
        raise UnreadableImage(f"int{layout.bits} samples (with a sign) cannot be read; save the picture with 8 or 16 "
                              "bits without a sign, or as float")  # fmt: skip
    if layout.kind not in (_UNSIGNED, _FLOAT, _UNDEFINED):
        raise UnreadableImage("complex numbers are no picture; save it with 8 or 16 bits, or as float")
    if layout.kind != _FLOAT and not 1 <= layout.bits <= 16:
        raise UnreadableImage(f"{depth} integer samples cannot be read; save the picture with 8 or 16 bits, or as "
                              "float")  # fmt: skip


def _samples(data: bytes, layout: _Layout, wanted: list[int]) -> NDArray[np.generic]:
    """The wanted samples (H, W, len(wanted)) as stored: uint8, uint16, or float of 16 to 64 bits."""
    (width, height), (piece_width, piece_rows) = layout.size, layout.piece
    if piece_width < 1 or piece_rows < 1 or piece_width * piece_rows > 4 * width * height + _BITS_AT_ONCE:
        raise damaged()
    across = -(-width // piece_width)
    in_plane = across * -(-height // piece_rows)
    planes = layout.samples if layout.planar else 1
    if min(len(layout.starts), len(layout.lengths)) < planes * in_plane:
        raise UnreadableImage("the TIFF file is damaged: parts of its picture are missing; copy or export it again")
    out = np.empty((height, width, len(wanted)), _stored_type(layout).newbyteorder("="))
    at_once = max(1, _BITS_AT_ONCE // (piece_width * piece_rows))
    for plane in range(planes):
        if layout.planar and plane not in wanted:
            continue
        into = out[..., wanted.index(plane) : wanted.index(plane) + 1] if layout.planar else out
        for start in range(0, in_plane, at_once):
            numbers = range(start, min(start + at_once, in_plane))
            places = [(number // across * piece_rows, number % across * piece_width) for number in numbers]
            pieces = _pieces(data, layout, [plane * in_plane + number for number in numbers], places)
            for piece, (top, left) in zip(pieces, places, strict=True):
                into[top : top + piece_rows, left : left + piece_width] = (
                    piece[: height - top, : width - left] if layout.planar
                    else piece[: height - top, : width - left, wanted]
                )  # fmt: skip
    return out


def _pieces(
    data: bytes, layout: _Layout, numbers: list[int], places: list[tuple[int, int]]
) -> list[NDArray[np.generic]]:
    """Strips or tiles (h, w, samples) by their numbers; places: (top, left) px."""
    (width, height), (piece_width, piece_rows) = layout.size, layout.piece
    packed = [data[layout.starts[number] : layout.starts[number] + layout.lengths[number]] for number in numbers]
    rows = [piece_rows if layout.tiled else min(piece_rows, height - top) for top, _ in places]
    if layout.compression == JPEG:
        sizes = [(piece_width if layout.tiled else width, count) for count in rows]
        found = [jpeg_piece(one, layout.tables, size, layout.photometric == _YCBCR)
                 for one, size in zip(packed, sizes, strict=True)]  # fmt: skip
        if any(one.shape[2] != layout.samples for one in found):
            raise damaged()
        return list(found)
    if layout.backwards:
        packed = [one.translate(_REVERSED) for one in packed]
    samples = 1 if layout.planar else layout.samples
    row_bytes = -(-piece_width * samples * layout.bits // 8)
    plain = unpacked(packed, rows, row_bytes, layout.compression)
    return [_numbers(one, layout, (count, piece_width, samples)) for one, count in zip(plain, rows, strict=True)]


def _stored_type(layout: _Layout) -> np.dtype[np.generic]:
    """What a sample is held in as it is stored, in the file's order of bytes."""
    if layout.kind == _FLOAT:
        return np.dtype(f"{layout.order}f{layout.bits // 8}")
    return np.dtype(np.uint8) if layout.bits <= 8 else np.dtype(f"{layout.order}u2")


def _numbers(plain: bytes, layout: _Layout, shape: tuple[int, int, int]) -> NDArray[np.generic]:
    """Samples (rows, width, samples) of the bytes of a piece, in this machine's order, predictor undone."""
    rows, width, samples = shape
    kind, native = _stored_type(layout), _stored_type(layout).newbyteorder("=")
    if layout.predictor == 3 and layout.kind == _FLOAT:
        # differences of bytes, whose most significant ones come first in each row
        parts = np.frombuffer(plain, np.uint8).reshape(rows, -1, samples).cumsum(axis=1, dtype=np.uint8)
        parts = parts.reshape(rows, kind.itemsize, width * samples).transpose(0, 2, 1)
        return np.ascontiguousarray(parts).view(kind.newbyteorder(">")).astype(native).reshape(shape)
    if kind.itemsize * 8 != layout.bits:
        found: NDArray[np.generic] = _odd_bits(plain, layout.bits, shape).astype(native)
    else:
        found = np.frombuffer(plain, kind).reshape(shape).astype(native)
    if layout.predictor == 2:
        whole = found.view(f"u{native.itemsize}")
        whole = whole.cumsum(axis=1, dtype=whole.dtype)
        if layout.kind != _FLOAT:
            whole &= np.array((1 << layout.bits) - 1, whole.dtype)
        found = whole.view(native)
    return found


def _odd_bits(plain: bytes, bits: int, shape: tuple[int, int, int]) -> NDArray[np.uint16]:
    """Samples of a number of bits that is no whole bytes, packed from the highest on; rows begin at whole bytes."""
    rows, width, samples = shape
    packed = np.frombuffer(plain, np.uint8).reshape(rows, -1)
    out = np.empty((rows, width * samples), np.uint16)
    weights = (1 << np.arange(bits - 1, -1, -1)).astype(np.uint16)
    step = max(1, _BITS_AT_ONCE // max(1, width * samples))
    for top in range(0, rows, step):
        single = np.unpackbits(packed[top : top + step], axis=1, count=width * samples * bits)
        out[top : top + step] = single.reshape(-1, width * samples, bits) @ weights
    return out.reshape(shape)


def _scaled(stored: NDArray[np.generic], layout: _Layout) -> NDArray[np.generic]:
    """The samples as uint8 or uint16 of full range, or float32; black is zero, and palette and inks are R, G, B."""
    if layout.kind == _FLOAT:
        with np.errstate(over="ignore"):  # what float32 cannot hold is infinite, which is told further on
            return stored.astype(np.float32)
    if layout.photometric == _PALETTE:
        return _by_palette(stored, layout)
    full = 255 if layout.bits <= 8 else 65535
    most = (1 << layout.bits) - 1
    if most != full:
        levels = (np.arange(most + 1) * full + most // 2) // most
        stored = levels.astype(stored.dtype)[stored]
    if layout.photometric == _WHITE_IS_ZERO:
        stored[..., : layout.colours] = full - stored[..., : layout.colours]  # type: ignore[operator]
    if layout.photometric == _CMYK:
        ink = full - stored[..., :4].astype(np.uint64)
        light = (ink[..., :3] * ink[..., 3:] // full).astype(stored.dtype)
        return np.concatenate([light, stored[..., 4:]], axis=2)
    return stored


def _by_palette(stored: NDArray[np.generic], layout: _Layout) -> NDArray[np.generic]:
    """8-bit colours of the numbers in a palette; alpha beside them is kept."""
    colours = 1 << layout.bits
    if len(layout.palette) < 3 * colours or layout.bits > 8:
        raise UnreadableImage("the TIFF file is damaged: its palette is missing; copy or export it again")
    table = np.array(layout.palette[: 3 * colours], np.uint32).reshape(3, colours).T
    # old files hold 8 bits there
    eight = (table if table.max() < 256 else table >> 8).astype(np.uint8)
    return np.concatenate([eight[stored[..., 0]], stored[..., 1:]], axis=2)
