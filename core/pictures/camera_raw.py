"""Camera RAW files from outside: recognised by what they hold, whatever they are called; their size, damage and EXIF.

Most are TIFF inside. Nothing here raises on damaged bytes.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from .containers import TiffEntry, container_brand, read_structure, tiff_directory, tiff_integers
from .heif import boxes
from .metadata import joined_exif

# How files begin that are no TIFF, or one under a number of its maker's: Olympus, Panasonic, Fujifilm, Minolta, Sigma.
_STARTS = (b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILMCCD-RAW", b"\0MRM", b"FOVb")
_TIFF = (b"II*\0", b"MM\0*")
# Endings that count where the bytes look like TIFF or like nothing known.
RAW_SUFFIXES = frozenset(
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .iiq .kdc .mef .mrw .nef .nrw .orf .pef .raf .raw .rw2 .sr2 .srf .srw .x3f"
    .split())
SUBDIRECTORIES, PHOTOMETRIC, DNG_VERSION = 330, 262, 50706
# Values of PhotometricInterpretation: a colour filter array, and linear light of a sensor.
_SENSOR = {32803, 34892}
# Canon's own box in CR3 files.
_CANON = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")
# Directories of a file that are looked at, at most: cameras write fewer than ten.
_MOST_DIRECTORIES = 32


def is_raw(data: bytes, suffix: str) -> bool:
    """Whether these are the bytes of a camera RAW file; suffix: of its name, lower case with its dot."""
    if data.startswith(_STARTS) or data[6:14] == b"HEAPCCDR" or container_brand(data) == "RAW":
        return True
    if not data.startswith(_TIFF):
        return suffix in RAW_SUFFIXES and read_structure(data[:64]) is None
    # marks of Canon and Phase One behind the TIFF header
    if suffix in RAW_SUFFIXES or data[8:10] == b"CR" or data[8:12] in (b"IIII", b"MMMM"):
        return True
    return any(_is_of_sensor(data, entries) for entries in _directories(data))


def raw_bytes(path: Path) -> bytes | None:
    """The bytes of a camera RAW file; None where it is none, or cannot be read. Of others no more is read than tells.
    """
    suffix = path.suffix.lower()
    try:
        if not path.is_file():  # to open a pipe would be to wait for whoever writes into it
            return None
        with open(path, "rb") as file:
            head = file.read(64)
            if not head.startswith(_TIFF) and not is_raw(head, suffix):
                return None
            data = head + file.read()
    except OSError:
        return None
    return data if is_raw(data, suffix) else None


def raw_size(data: bytes) -> tuple[int, int]:
    """(W, H) px of the largest picture that its directories name; of a file that has none of them, as many px as it
    has bytes: lossless compression leaves one and more for each."""
    sizes = [(_first(data, entries, 256), _first(data, entries, 257)) for entries in _directories(_as_tiff(data))]
    return max((*sizes, (0, 0)), key=lambda size: size[0] * size[1]) if any(map(all, sizes)) else (len(data), 1)


def raw_damage(data: bytes) -> str:
    """In words what is broken, as far as that can be seen before it is decoded; else ""."""
    ends = [len(data)]
    if data.startswith(_TIFF):
        for entries in _directories(data):
            for at, length in ((273, 279), (324, 325)):
                starts, lengths = (tiff_integers(data, entries.get(tag)) for tag in (at, length))
                ends += [start + size for start, size in zip(starts, lengths, strict=False)]
    elif data.startswith(b"FUJIFILMCCD-RAW"):
        ends += [sum(int.from_bytes(data[at : at + 4], "big") for at in (place, place + 4)) for place in (84, 100)]
    elif container_brand(data) == "RAW":
        at = 0
        while at + 8 <= len(data):
            size = int.from_bytes(data[at : at + 4], "big")
            size = int.from_bytes(data[at + 8 : at + 16], "big") if size == 1 else size
            if size < 8:
                break
            at += size
            ends.append(at)
    return "it is cut off: picture data lie beyond its end" if max(ends) > len(data) else ""


def raw_exif(data: bytes) -> bytes | None:
    """The file's EXIF as a TIFF structure; None where it keeps it in another way."""
    if container_brand(data) == "RAW":
        return _canon_exif(data)
    if data.startswith(b"FUJIFILMCCD-RAW"):
        start = int.from_bytes(data[84:88], "big")
        preview = read_structure(data[start : start + int.from_bytes(data[88:92], "big")])
        return preview.exif if preview is not None else None
    tiff = _as_tiff(data)
    return tiff if tiff.startswith(_TIFF) else None


def _canon_exif(data: bytes) -> bytes | None:
    """Of a CR3 file, which has its directories in boxes of their own, within one of Canon's within `moov`."""
    parts: dict[bytes, bytes] = {}
    for outer in boxes(data, 0, len(data)):
        for own in boxes(data, outer.start, outer.end) if outer.kind == b"moov" else ():
            if own.kind == b"uuid" and data[own.start : own.start + 16] == _CANON:
                parts |= {box.kind: data[box.start : box.end] for box in boxes(data, own.start + 16, own.end)}
    return joined_exif(parts.get(b"CMT1", b""), parts.get(b"CMT2", b""))


def _as_tiff(data: bytes) -> bytes:
    """The same with TIFF's own number where its maker put another."""
    if data.startswith((b"IIRO", b"IIRS", b"IIU\0")):
        return b"II*\0" + data[4:]
    return b"MM\0*" + data[4:] if data.startswith(b"MMOR") else data


def _directories(data: bytes) -> Iterator[dict[int, TiffEntry]]:
    """Entries by their tags of each directory of a TIFF, those within others too."""
    if not data.startswith(_TIFF):
        return
    waiting: list[int | None] = [None]
    seen: set[int | None] = set()
    while waiting and len(seen) < _MOST_DIRECTORIES:
        at = waiting.pop()
        directory = tiff_directory(data, at) if at not in seen else None
        seen.add(at)
        if directory is None:
            continue
        entries = {entry.tag: entry for entry in directory[0]}
        yield entries
        waiting += [directory[1] or None] if directory[1] else []
        waiting += tiff_integers(data, entries.get(SUBDIRECTORIES))[:_MOST_DIRECTORIES]


def _is_of_sensor(data: bytes, entries: dict[int, TiffEntry]) -> bool:
    return DNG_VERSION in entries or _first(data, entries, PHOTOMETRIC) in _SENSOR


def _first(data: bytes, entries: dict[int, TiffEntry], tag: int) -> int:
    return (tiff_integers(data, entries.get(tag)) or [0])[0]
