"""What a picture file says about itself before anybody decodes it: kind, size, damage, EXIF, ICC profile.

Decoders find damage too late (a decompression bomb has filled the memory) or not at all (OpenCV decodes half a JPEG
without a word). Nothing here raises on damaged bytes: what cannot be read counts as absent.
"""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass, replace
from typing import NamedTuple

from . import png_chunks
from .bmp import bmp_is_opaque, bmp_size
from .heif import HeifFacts, read_heif
from .options import READING
from .radiance_header import is_radiance, read_header

# The first marker after JPEG's entropy-coded data: FF not followed by a stuffed 00, a restart marker or filling FF.
_JPEG_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_TIFF_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
_TIFF_INTEGERS = {1: "B", 3: "H", 4: "I", 13: "I", 16: "Q"}


@dataclass(frozen=True)
class TiffFacts:
    """What the first page of a TIFF says: tag values, 0 where absent. `extra`: 1 premultiplied, 2 straight alpha."""

    orientation: int = 1
    samples: int = 1
    bits: int = 1
    photometric: int = 1
    extra: int = 0
    pages: int = 1


@dataclass(frozen=True)
class Structure:
    """A picture file from outside. kind: png, jpeg, tiff, webp, bmp, heic, hdr or exr; width, height px, or 0.

    damage says in words what is broken, or is empty. exif: the raw block as a TIFF structure (for TIFF the file
    itself). gray: a PNG without colour, which decoders may widen to RGBA for the sake of its alpha. opaque: what a
    decoder takes for alpha is none. transparent: the level of each channel that a PNG shows nothing at, or none.
    """

    kind: str
    width: int = 0
    height: int = 0
    damage: str = ""
    exif: bytes | None = None
    icc: bytes | None = None
    gray: bool = False
    opaque: bool = False
    transparent: tuple[int, ...] = ()
    tiff: TiffFacts | None = None
    heif: HeifFacts | None = None


class TiffEntry(NamedTuple):
    """One entry of a TIFF directory; `at` is where its value stands in the file."""

    tag: int
    kind: int
    values: int
    at: int


def read_structure(data: bytes) -> Structure | None:
    """Walks through the file's container; None where it is none of the kinds this program reads. Raises nothing."""
    if data[:3] == b"\xff\xd8\xff":
        return _jpeg(data)
    if data[:8] == b"\x89PNG\r\n\x1a\n":
        return _png(data)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return _webp(data)
    if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _tiff(data)
    if data[:4] == b"\x76\x2f\x31\x01":
        return Structure("exr")
    if container_brand(data) == "HEIC":
        facts = read_heif(data)
        return Structure("heic", facts.width, facts.height, facts.damage, facts.exif, facts.icc, heif=facts)
    if is_radiance(data):
        header = read_header(data)
        return Structure("hdr", *header.size, header.damage)
    if data[:2] == b"BM" and len(data) >= 26:
        return Structure("bmp", *bmp_size(data), opaque=bmp_is_opaque(data))
    return None


# Brands of the ISO base media container (bytes 8-12 of the file), and what they stand for.
_BRANDS = {b"crx ": "RAW", b"avif": "AVIF", b"avis": "AVIF"} | dict.fromkeys(
    (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs", b"mif1", b"msf1"), "HEIC")


def container_brand(data: bytes) -> str:
    """"HEIC", "AVIF" or "RAW" (Canon's CR3) where the file is an ISO base media container of one of these, else ""."""
    if data[4:8] != b"ftyp":
        return ""
    # the general brands come first in some AVIF files, whose own brand then follows among the compatible ones
    brands = [data[8:12], *(data[at : at + 4] for at in range(16, min(64, _u32(data, 0)), 4))]
    kinds = [_BRANDS[brand] for brand in brands if brand in _BRANDS]
    return "AVIF" if "AVIF" in kinds else kinds[0] if kinds else ""


# GPano's property of XMP, as an attribute or an element; whatever it says, the picture is not flat
_SURROUND = re.compile(rb"GPano:ProjectionType\s*(?:=\s*[\"']|>)\s*(?i:equirectangular|cylindrical)")


def says_surround(data: bytes) -> bool:
    """Whether a file's XMP calls it a map of many directions (GPano)."""
    return _SURROUND.search(data) is not None


# Properties of XMP by which cameras and Adobe's programs say that they removed the lens's distortion; a profile alone
# is what would be done to camera RAW
_UNDISTORTED, _PROFILE_USED, _DONE = (
    re.compile(name + rb"\s*(?:=\s*[\"']|>)\s*(?i:true|1)\b")
    for name in (rb"aux:DistortionCorrectionAlreadyApplied", rb"crs:LensProfileEnable", rb"crs:AlreadyApplied")
)


def says_undistorted(data: bytes) -> bool:
    """Whether a file's XMP says that its lens's distortion was removed."""
    return bool(_UNDISTORTED.search(data) or (_PROFILE_USED.search(data) and _DONE.search(data)))


def _u32(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 4], "big")


def _bounded_inflate(packed: bytes) -> bytes | None:
    try:
        stream = zlib.decompressobj()
        plain = stream.decompress(packed, READING.max_icc_bytes)
    except zlib.error:
        return None
    return plain if stream.eof else None


def _jpeg(data: bytes) -> Structure:
    found = Structure("jpeg", damage="it is cut off: its end marker is missing")
    parts: dict[int, bytes] = {}
    parts_needed, at = 0, 2
    # Walked segment by segment: a plain search for FF D9 would find the embedded thumbnail's end or miss the real one
    # before what some phones append.
    while (marker_at := _JPEG_MARKER.search(data, at)) is not None:
        marker, at = data[marker_at.start() + 1], marker_at.end()
        if marker == 0xD9:
            found = replace(found, damage="")
            break
        if marker in (0x01, 0xD8):
            continue
        length = int.from_bytes(data[at : at + 2], "big")
        segment = data[at + 2 : at + length]
        if length < 2 or at + length > len(data):
            break
        at += length
        if marker in _JPEG_FRAMES and len(segment) >= 5 and not found.width:
            height, width = struct.unpack_from(">HH", segment, 1)
            found = replace(found, width=width, height=height)
        elif marker == 0xE1 and segment.startswith(b"Exif\0") and found.exif is None:
            found = replace(found, exif=segment[6:])
        elif marker == 0xE2 and segment.startswith(b"ICC_PROFILE\0") and len(segment) > 14:
            parts_needed = segment[13]
            parts.setdefault(segment[12], segment[14:])
    if parts and sorted(parts) == list(range(1, parts_needed + 1)):
        found = replace(found, icc=b"".join(parts[number] for number in sorted(parts)))
    return found


def _png(data: bytes) -> Structure:
    found = Structure("png", damage="it is cut off: its end chunk is missing")
    at, holds_data = 8, False
    further: dict[bytes, list[bytes]] = {}
    while at + 12 <= len(data):
        length, name = _u32(data, at), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if at + 12 + length > len(data):
            break
        if zlib.crc32(body, zlib.crc32(name)) != _u32(data, at + 8 + length):
            # capital first letter: a chunk the picture cannot do without
            if name[:1].isupper():
                return replace(found, damage=f"its chunk {name!r} does not match its checksum")
        elif name == b"IHDR" and length == 13:
            found = replace(found, width=_u32(body, 0), height=_u32(body, 4), gray=body[9] in (0, 4))
        elif name == b"eXIf":
            found = replace(found, exif=body)
        elif name == b"iCCP":
            found = replace(found, icc=_bounded_inflate(body[body.find(b"\0") + 2 :]))
        elif name in png_chunks.KEPT:
            further.setdefault(name, []).append(body)
        holds_data = holds_data or name == b"IDAT"
        if name == b"IEND":
            damage = "" if holds_data else "it holds no picture data"
            return replace(found, damage=damage, transparent=png_chunks.transparent_level(further, data[25], data[24]),
                           exif=found.exif or png_chunks.exif_in_text(further, READING.max_icc_bytes),
                           icc=found.icc or png_chunks.profile_of(further, found.gray))
        at += 12 + length
    return found


def neutral_png(data: bytes) -> bytes:
    """The same PNG with nothing but its first picture: the chunks that hold it, up to the end chunk.

    OpenCV's reader of animations crashes on damaged ones and believes any length, even behind the end.
    """
    parts, at = [data[:8]], 8
    while at + 12 <= len(data):
        end = at + 12 + _u32(data, at)
        # decoders mind tRNS of some kinds of pictures: without a palette it is `Structure.transparent`
        if data[at + 4 : at + 8] in (b"IHDR", b"PLTE", b"IDAT", b"IEND", *[b"tRNS"] * (data[25] == 3)):
            parts.append(data[at:end])
        if data[at + 4 : at + 8] == b"IEND":
            break
        at = end
    return b"".join(parts)


def _webp(data: bytes) -> Structure:
    found = Structure("webp")
    if int.from_bytes(data[4:8], "little") + 8 > len(data):
        found = replace(found, damage="it is cut off: shorter than its header says")
    at = 12
    while at + 8 <= len(data):
        name, length = data[at : at + 4], int.from_bytes(data[at + 4 : at + 8], "little")
        body = data[at + 8 : at + 8 + length]
        width = height = 0
        if name == b"VP8X" and length >= 10:
            width, height = int.from_bytes(body[4:7], "little") + 1, int.from_bytes(body[7:10], "little") + 1
        elif name == b"VP8 " and body[3:6] == b"\x9d\x01\x2a" and len(body) >= 10:
            width, height = (size & 0x3FFF for size in struct.unpack_from("<HH", body, 6))
        elif name == b"VP8L" and body[:1] == b"\x2f" and len(body) >= 5:
            packed = int.from_bytes(body[1:5], "little")
            width, height = (packed & 0x3FFF) + 1, (packed >> 14 & 0x3FFF) + 1
        elif name == b"EXIF":
            found = replace(found, exif=body.removeprefix(b"Exif\0\0"))
        elif name == b"ICCP":
            found = replace(found, icc=body[:READING.max_icc_bytes])
        if width and not found.width:
            found = replace(found, width=width, height=height)
        at += 8 + length + (length & 1)
    return found


def tiff_directory(data: bytes, at: int | None = None) -> tuple[list[TiffEntry], int] | None:
    """The directory (IFD) at byte `at`, or the first one: its entries and where the next directory stands (0: none).

    data: a TIFF structure, classic or BigTIFF. None where it is damaged. Raises nothing.
    """
    order, big = tiff_layout(data)
    try:
        if at is None:
            (at,) = struct.unpack_from(order + ("Q" if big else "I"), data, 8 if big else 4)
        (count,) = struct.unpack_from(order + ("Q" if big else "H"), data, at)
        if count > 4096:
            return None
        at += 8 if big else 2
        step, inline = (20, 8) if big else (12, 4)
        entries = []
        for position in range(at, at + step * count, step):
            tag, kind, values = struct.unpack_from(order + ("HHQ" if big else "HHI"), data, position)
            value_at = position + step - inline
            if values * _TIFF_SIZES.get(kind, 1) > inline:
                (value_at,) = struct.unpack_from(order + ("Q" if big else "I"), data, value_at)
            entries.append(TiffEntry(tag, kind, values, value_at))
        (following,) = struct.unpack_from(order + ("Q" if big else "I"), data, at + step * count)
        return entries, following
    except (struct.error, OverflowError):
        return None


def tiff_bytes(data: bytes, entry: TiffEntry) -> bytes:
    """The value of a directory entry as it stands in the file, cut off where the file ends."""
    return data[entry.at : entry.at + entry.values * _TIFF_SIZES.get(entry.kind, 1)]


def tiff_layout(data: bytes) -> tuple[str, bool]:
    """The byte order ("<" or ">") of a TIFF structure, and whether it is a BigTIFF."""
    return "<" if data[:2] == b"II" else ">", b"+" in data[2:4]


def tiff_integers(data: bytes, entry: TiffEntry | None) -> list[int]:
    """The values of a directory entry, none where it is absent or holds something else."""
    letter = _TIFF_INTEGERS.get(entry.kind) if entry is not None else None
    if entry is None or letter is None:
        return []
    raw = tiff_bytes(data, entry)
    count = len(raw) // struct.calcsize("<" + letter)
    return list(struct.unpack_from(f"{tiff_layout(data)[0]}{count}{letter}", raw))


def _tiff(data: bytes) -> Structure:
    directory = tiff_directory(data)
    if directory is None:
        return Structure("tiff", damage="it is cut off: its directory is missing")
    entries = {entry.tag: entry for entry in directory[0]}

    def first(tag: int, otherwise: int) -> int:
        return (tiff_integers(data, entries.get(tag)) or [otherwise])[0]

    starts = tiff_integers(data, entries.get(273) or entries.get(324))
    lengths = tiff_integers(data, entries.get(279) or entries.get(325))
    damage = ""
    if not starts:
        damage = "it holds no picture data"
    elif any(start + length > len(data) for start, length in zip(starts, lengths, strict=False)):
        damage = "it is cut off: picture data lie beyond its end"
    profile = entries.get(34675)
    facts = TiffFacts(
        orientation=first(274, 1), samples=first(277, 1), bits=first(258, 1), photometric=first(262, 1),
        extra=first(338, 0), pages=_tiff_pages(data, directory[1]),
    )
    icc = tiff_bytes(data, profile)[:READING.max_icc_bytes] if profile is not None else None
    return Structure("tiff", first(256, 0), first(257, 0), damage, data, icc, tiff=facts)


def _tiff_pages(data: bytes, following: int) -> int:
    """Pages of full size; reduced copies (NewSubfileType 1) do not count. Stops at a loop, and at 1000."""
    pages = 1
    seen: set[int] = set()
    while following and following not in seen and len(seen) < 1000:
        seen.add(following)
        directory = tiff_directory(data, following)
        if directory is None:
            break
        kind = next((entry for entry in directory[0] if entry.tag == 254), None)
        pages += not (tiff_integers(data, kind) or [0])[0] & 1
        following = directory[1]
    return pages


def neutral_tiff(data: bytes) -> bytes:
    """The same TIFF with orientation 1 and its alpha called premultiplied, so that decoders pass samples on as is.

    OpenCV turns some depths and not others, and libtiff multiplies 8-bit colours by a straight alpha.
    """
    directory = tiff_directory(data)
    patched = bytearray(data)
    for entry in directory[0] if directory is not None else []:
        if entry.tag in (274, 338) and entry.kind == 3 and entry.values >= 1 and entry.at + 2 <= len(patched):
            struct.pack_into(tiff_layout(data)[0] + "H", patched, entry.at, 1)
    return bytes(patched)
