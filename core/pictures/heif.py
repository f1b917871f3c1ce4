"""What a HEIC file says about itself before anybody decodes it: its boxes (ISO/IEC 23008-12), sizes and picture data.

Its decoder shows damaged data as gray or colourful blocks without a word, so whatever can be checked is checked here:
where boxes and items lie, that tiles fit their picture, the sizes inside the coded data, and the units that these data
are cut into. Nothing here raises on damaged bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

# px by which a coded picture may be larger than what is shown of it: it is coded in blocks of 64 at most, twice over.
_PADDING = 128
_ALPHA = (b"urn:mpeg:hevc:2015:auxid:1", b"urn:mpeg:mpegB:cicp:systems:auxiliary:alpha")


@dataclass(frozen=True)
class HeifFacts:
    """What a HEIF file says.

    width, height: px of the picture as it is shown, upright; 0 where not found. damage: in words what is broken, or "".
    coding: four letters, "hvc1" for HEVC. primaries, transfer: numbers of ITU-T H.273 where the file gives no ICC
    profile, 2 (unknown) where it does not say.
    """

    width: int = 0
    height: int = 0
    damage: str = ""
    coding: str = ""
    bits: int = 8
    exif: bytes | None = None
    icc: bytes | None = None
    primaries: int = 2
    transfer: int = 2


class Box(NamedTuple):
    """A box of the ISO base media format: its four letters, and where its content lies in the file."""

    kind: bytes
    start: int
    end: int


class _Damaged(Exception):
    """In words what is broken."""


@dataclass
class _Item:
    """coding: its type; extents: (start, end) of its data in the file; properties: in the order they are applied."""

    coding: bytes = b""
    extents: list[tuple[int, int]] = field(default_factory=list)
    properties: list[Box] = field(default_factory=list)


def read_heif(data: bytes) -> HeifFacts:
    """The facts of a file that begins with the `ftyp` box of HEIF."""
    try:
        return _File(data).facts()
    except _Damaged as error:
        return HeifFacts(damage=str(error))
    except (struct.error, IndexError, OverflowError):
        return HeifFacts(damage="its tables are broken")


def boxes(data: bytes, at: int, end: int) -> Iterator[Box]:
    """The boxes between two bytes of a file, one behind the other; what ends beyond `end` is cut there. Raises nothing.
    """
    end = min(end, len(data))
    while at + 8 <= end:
        size, kind = struct.unpack_from(">I4s", data, at)
        start = at + 8
        if size == 1:
            size = int.from_bytes(data[start : start + 8], "big")
            start += 8
        stop = end if size == 0 else at + size
        if stop < start:
            return  # what some phones append is no box
        yield Box(kind, start, min(stop, end))
        at = stop


class _Reader:
    """Big-endian numbers one after the other."""

    def __init__(self, data: bytes, box: Box) -> None:
        self._data, self.at, self.end = data, box.start, box.end

    def take(self, count: int) -> int:
        """The next so many bytes as a number; of none, 0."""
        if self.at + count > self.end:
            raise _Damaged("a table is longer than its box")
        self.at += count
        return int.from_bytes(self._data[self.at - count : self.at], "big")

    def version(self) -> tuple[int, int]:
        """Version and flags, which a full box begins with."""
        return self.take(1), self.take(3)

    def rest(self) -> bytes:
        """What is left of the box."""
        return self._data[self.at : self.end]


class _File:
    """The tables of one file."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._items: dict[int, _Item] = {}
        self._taken = 0  # bytes of items that were looked at
        self._references: list[tuple[bytes, int, list[int]]] = []
        top = list(boxes(data, 0, len(data)))
        meta = next((box for box in top if box.kind == b"meta"), None)
        if meta is None:
            raise _Damaged("it is cut off, or holds no still picture")
        self._inner = {box.kind: box for box in boxes(data, meta.start + 4, meta.end)}
        for kind in (b"pitm", b"iinf", b"iloc", b"iprp"):
            if kind not in self._inner:
                raise _Damaged("it is cut off: its tables are missing")
        reader = self._reader(b"pitm")
        self._primary = reader.take(4 if reader.version()[0] else 2)
        self._read_infos()
        self._read_places()
        self._read_properties()
        if b"iref" in self._inner:
            self._read_references()

    def _reader(self, kind: bytes) -> _Reader:
        return _Reader(self._data, self._inner[kind])

    def _item(self, number: int) -> _Item:
        return self._items.setdefault(number, _Item())

    def _read_infos(self) -> None:
        reader = self._reader(b"iinf")
        reader.take(4 if reader.version()[0] else 2)
        for box in boxes(self._data, reader.at, reader.end):
            entry = _Reader(self._data, box)
            version = entry.version()[0]
            if box.kind == b"infe" and version >= 2:
                number = entry.take(4 if version >= 3 else 2)
                entry.take(2)
                self._item(number).coding = entry.take(4).to_bytes(4, "big")

    def _read_places(self) -> None:
        reader = self._reader(b"iloc")
        version = reader.version()[0]
        sizes = reader.take(2)
        offset_size, length_size, base_size = sizes >> 12, sizes >> 8 & 15, sizes >> 4 & 15
        index_size = sizes & 15 if version else 0
        idat = self._inner.get(b"idat")
        for _ in range(reader.take(4 if version >= 2 else 2)):
            number = reader.take(4 if version >= 2 else 2)
            method = reader.take(2) & 15 if version else 0
            reader.take(2)
            base = reader.take(base_size)
            if method == 1:
                base += idat.start if idat is not None else len(self._data)
            count = reader.take(2)
            if count > 1 and not length_size:
                raise _Damaged("its tables are broken")
            for _ in range(count):
                reader.take(index_size)
                start = base + reader.take(offset_size)
                length = reader.take(length_size) or len(self._data) - start
                # data that lie in another item are used by nobody for pictures: as good as lost
                end = start + length if method < 2 else len(self._data) + 1
                self._item(number).extents.append((start, end))

    def _read_properties(self) -> None:
        inner = list(boxes(self._data, *self._inner[b"iprp"][1:]))
        listed = [box for one in inner if one.kind == b"ipco" for box in boxes(self._data, one.start, one.end)]
        for one in inner:
            if one.kind != b"ipma":
                continue
            reader = _Reader(self._data, one)
            version, flags = reader.version()
            for _ in range(reader.take(4)):
                item = self._item(reader.take(4 if version else 2))
                for _ in range(reader.take(1)):
                    index = reader.take(2) & 0x7FFF if flags & 1 else reader.take(1) & 0x7F
                    if index > len(listed):
                        raise _Damaged("it names properties that it does not have")
                    if index:
                        item.properties.append(listed[index - 1])

    def _read_references(self) -> None:
        reader = self._reader(b"iref")
        size = 4 if reader.version()[0] else 2
        for box in boxes(self._data, reader.at, reader.end):
            entry = _Reader(self._data, box)
            of = entry.take(size)
            self._references.append((box.kind, of, [entry.take(size) for _ in range(entry.take(2))]))

    def facts(self) -> HeifFacts:
        """All of them about the primary picture."""
        primary = self._items.get(self._primary)
        if primary is None or not primary.coding:
            raise _Damaged("its main picture is missing")
        tiles = [self._primary]
        size = self._size_of(primary)
        if primary.coding == b"grid":
            tiles, size = self._tiles(primary)
        coding = self._item(tiles[0]).coding
        if coding == b"hvc1":
            for number in (*tiles, *self._alpha()):
                self._check_coded(self._item(number))
        # transformations belong to the whole picture, colour and depth may stand with the tiles only
        described = [*primary.properties, *self._item(tiles[0]).properties]
        colours = [self._data[box.start : box.end] for box in described if box.kind == b"colr"]
        icc = next((one[4:] for one in colours if one[:4] in (b"prof", b"rICC")), None)
        numbers = next((struct.unpack_from(">HH", one, 4) for one in colours if one[:4] == b"nclx"), (2, 2))
        depths = [self._data[box.start + 5] for box in described if box.kind == b"pixi" and box.end > box.start + 5]
        width, height = self._shown(primary, size)
        return HeifFacts(
            width, height, "", coding.decode("latin-1"), depths[0] if depths else 8, self._exif(), icc,
            *((2, 2) if icc is not None else numbers),
        )  # fmt: skip

    def _size_of(self, item: _Item) -> tuple[int, int]:
        for box in item.properties:
            if box.kind == b"ispe":
                width, height = struct.unpack_from(">II", self._data, box.start + 4)
                return width, height
        raise _Damaged("its header gives no size")

    def _shown(self, item: _Item, size: tuple[int, int]) -> tuple[int, int]:
        """Its size once it is cropped and turned."""
        for box in item.properties:
            if box.kind == b"clap":
                width, by, height, by2 = struct.unpack_from(">IIII", self._data, box.start)
                if not by or not by2 or width > by * size[0] or height > by2 * size[1]:
                    raise _Damaged("it is to be cropped beyond its border")
                size = round(width / by), round(height / by2)
            elif box.kind == b"irot" and self._data[box.start] & 1:
                size = size[::-1]
        return size

    def _tiles(self, grid: _Item) -> tuple[list[int], tuple[int, int]]:
        """The items that a grid is made of, and its size."""
        described = self._bytes_of(grid)
        wide = described[1] & 1
        rows, columns = described[2] + 1, described[3] + 1
        width, height = struct.unpack_from(">II" if wide else ">HH", described, 4)
        tiles = next((to for kind, of, to in self._references if kind == b"dimg" and self._items.get(of) is grid), [])
        if len(tiles) != rows * columns or not all(number in self._items for number in tiles):
            raise _Damaged("tiles of its picture are missing")
        sizes = {self._size_of(self._items[number]) for number in tiles}
        (tile_width, tile_height) = next(iter(sizes))
        # each row and column of tiles shows something
        fits = (columns - 1) * tile_width < width <= columns * tile_width
        fits = fits and (rows - 1) * tile_height < height <= rows * tile_height
        if len(sizes) > 1 or not fits:
            raise _Damaged("its tiles do not fit together")
        return tiles, (width, height)

    def _alpha(self) -> list[int]:
        """The item that holds the primary picture's alpha, if any."""
        return [
            of for kind, of, to in self._references if kind == b"auxl" and self._primary in to
            and self._item(of).coding == b"hvc1" and any(
                self._data[box.start + 4 : box.end].startswith(_ALPHA)
                for box in self._item(of).properties if box.kind == b"auxC")
        ]  # fmt: skip

    def _bytes_of(self, item: _Item) -> bytes:
        if not item.extents or any(end > len(self._data) for _, end in item.extents):
            raise _Damaged("it is cut off: picture data lie beyond its end")
        self._taken += sum(end - start for start, end in item.extents)
        if self._taken > len(self._data):
            raise _Damaged("its picture data overlap")
        return b"".join(self._data[start:end] for start, end in item.extents)

    def _check_coded(self, item: _Item) -> None:
        """Walks through the HEVC units of a picture. Raises _Damaged where they contradict the rest."""
        coded, (width, height) = self._bytes_of(item), self._size_of(item)
        configuration = next((box for box in item.properties if box.kind == b"hvcC"), None)
        if configuration is None or configuration.end - configuration.start < 23:
            raise _Damaged("what its decoder needs is missing")
        length_size = (self._data[configuration.start + 21] & 3) + 1
        units = [*self._configured_units(configuration), *_units(coded, length_size)]
        for unit in units:
            if len(unit) < 3 or unit[0] & 0x80 or unit[-1] == 0 or b"\0\0\0" in unit:
                raise _Damaged("its picture data are broken")
            if unit[0] >> 1 == 33:  # sequence parameters
                coded_size = _coded_size(unit)
                if coded_size[0] > width + _PADDING or coded_size[1] > height + _PADDING:
                    raise _Damaged("its picture data are larger than its header says")
        kinds = {unit[0] >> 1 for unit in units}
        if not kinds & {16, 17, 18, 19, 20, 21} or 33 not in kinds:
            raise _Damaged("its picture data are missing")

    def _configured_units(self, box: Box) -> Iterator[bytes]:
        reader = _Reader(self._data, box)
        reader.take(22)
        for _ in range(reader.take(1)):
            reader.take(1)
            for _ in range(reader.take(2)):
                length = reader.take(2)
                yield reader.rest()[:length]
                reader.take(length)

    def _exif(self) -> bytes | None:
        """The block as a TIFF structure; None where there is none, or none that is whole."""
        described = [of for kind, of, to in self._references if kind == b"cdsc" and self._primary in to]
        for number in described:
            item = self._item(number)
            if item.coding == b"Exif":
                try:
                    block = self._bytes_of(item)
                except _Damaged:
                    return None
                return block[4 + int.from_bytes(block[:4], "big") :] or None
        return None


def _units(coded: bytes, length_size: int) -> Iterator[bytes]:
    at = 0
    while at < len(coded):
        length = int.from_bytes(coded[at : at + length_size], "big")
        at += length_size + length
        if not length or at > len(coded):
            raise _Damaged("its picture data are cut off")
        yield coded[at - length : at]


class _Bits:
    """Bits of an HEVC unit, without what keeps its bytes apart from start codes."""

    def __init__(self, unit: bytes) -> None:
        plain = unit.replace(b"\0\0\x03", b"\0\0")
        self._bits, self._left = int.from_bytes(plain, "big"), 8 * len(plain)

    def take(self, count: int) -> int:
        self._left -= count
        if self._left < 0:
            raise _Damaged("its picture data are broken")
        return self._bits >> self._left & ((1 << count) - 1)

    def golomb(self) -> int:
        """An unsigned Exp-Golomb number (ITU-T H.265, 9.2)."""
        zeros = 0
        while not self.take(1):
            zeros += 1
        return (1 << zeros) - 1 + self.take(zeros)


def _coded_size(unit: bytes) -> tuple[int, int]:
    """(W, H) px that a unit of sequence parameters tells (ITU-T H.265, 7.3.2.2)."""
    bits = _Bits(unit[:200])
    bits.take(16 + 4)
    layers = bits.take(3)
    bits.take(1 + 96)
    present = [bits.take(2) for _ in range(layers)]
    if layers:
        bits.take(2 * (8 - layers))
    for one in present:
        bits.take(88 * (one >> 1) + 8 * (one & 1))
    bits.golomb()
    if bits.golomb() == 3:
        bits.take(1)
    return bits.golomb(), bits.golomb()
