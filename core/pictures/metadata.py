"""EXIF of the pictures: what the geometry needs to know, and the tags that go along to the panorama.

Reading is ExifRead's work. Writing starts from nothing: a clean block of known tags, so that no GPS position, maker
note, thumbnail or stale size of the photograph ends up in the panorama. Focal lengths stay behind too: they describe
the sensor, and whoever stitched the panorama again would get a wrong camera from them.
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from dataclasses import dataclass, replace
from typing import Any

from .containers import tiff_bytes, tiff_directory
from .options import WRITING
from .png import chunk

SOFTWARE = "EDF Stitch"
_JPEG_SEGMENT = 65533  # bytes a JPEG segment holds after its length
_BYTE, _ASCII, _SHORT, _LONG, _RATIONAL, _UNDEFINED, _SIGNED_RATIONAL = 1, 2, 3, 4, 5, 7, 10
# ExifRead's name, tag number, type to write. The first group stands in the first directory, the second in the Exif one.
_IMAGE_TAGS = (
    ("Image Make", 271, _ASCII), ("Image Model", 272, _ASCII), ("Image DateTime", 306, _ASCII),
    ("Image Artist", 315, _ASCII), ("Image Copyright", 33432, _ASCII),
)
_EXIF_TAGS = (
    ("EXIF ExposureTime", 33434, _RATIONAL), ("EXIF FNumber", 33437, _RATIONAL),
    ("EXIF ExposureProgram", 34850, _SHORT), ("EXIF ISOSpeedRatings", 34855, _SHORT),
    ("EXIF DateTimeOriginal", 36867, _ASCII), ("EXIF DateTimeDigitized", 36868, _ASCII),
    ("EXIF OffsetTime", 36880, _ASCII), ("EXIF OffsetTimeOriginal", 36881, _ASCII),
    ("EXIF OffsetTimeDigitized", 36882, _ASCII), ("EXIF ExposureBiasValue", 37380, _SIGNED_RATIONAL),
    ("EXIF SubSecTime", 37520, _ASCII), ("EXIF SubSecTimeOriginal", 37521, _ASCII),
    ("EXIF LensMake", 42035, _ASCII), ("EXIF LensModel", 42036, _ASCII),
)


@dataclass(frozen=True)
class Exif:
    """What a picture's EXIF says; an empty text, None or orientation 1 where it says nothing (or nonsense).

    orientation: 1..8 as stored in the file. width, height (ExifImageWidth/Height) in pixels and focal_plane_*_per_mm in
    sensor pixels per mm belong to the picture as the sensor held it, unless `upright` turned them. heading: degrees
    from true north to the east at which the camera looked. software: the program that wrote it. undistorted: whether
    the file says that its lens's distortion was removed, which XMP does. kept: (tag number, value) of the tags that are
    written again; a value is a text, an integer, or (numerator, denominator).
    """

    orientation: int = 1
    make: str = ""
    model: str = ""
    lens: str = ""
    focal_mm: float | None = None
    focal35_mm: float | None = None
    digital_zoom: float | None = None
    focal_plane_x_per_mm: float | None = None
    focal_plane_y_per_mm: float | None = None
    width: int | None = None
    height: int | None = None
    heading: float | None = None
    software: str = ""
    undistorted: bool = False
    kept: tuple[tuple[int, str | int | tuple[int, int]], ...] = ()

    def upright(self) -> Exif:
        """The same with width, height and focal plane as they are after the orientation has been applied."""
        if self.orientation < 5:
            return self
        return replace(
            self, width=self.height, height=self.width,
            focal_plane_x_per_mm=self.focal_plane_y_per_mm, focal_plane_y_per_mm=self.focal_plane_x_per_mm,
        )

    def text(self, tag: int) -> str:
        """The kept text of a tag number, "" where there is none."""
        return next((value for number, value in self.kept if number == tag and isinstance(value, str)), "")

    def number(self, tag: int) -> float:
        """The kept number of a tag number, 0 where there is none."""
        value = next((value for number, value in self.kept if number == tag and not isinstance(value, str)), 0)
        return value[0] / value[1] if isinstance(value, tuple) else float(value)


def read_exif(block: bytes | None) -> Exif:
    """Reads a raw EXIF block (a TIFF structure or a whole TIFF file); an empty Exif where damaged. Raises nothing."""
    first_page = _first_directory_only(block) if block else None
    if first_page is None:
        return Exif()
    import logging

    import exifread

    # ExifRead logs what it stumbles over, and without a handler Python prints that to the user.
    logging.getLogger("exifread").setLevel(logging.CRITICAL)
    try:
        tags = exifread.process_file(io.BytesIO(first_page), details=False, extract_thumbnail=False)
    except Exception:  # damaged blocks make ExifRead raise whatever their bytes happen to mean
        return Exif()
    kept = [(number, _value(tags.get(name), kind)) for name, number, kind in _IMAGE_TAGS + _EXIF_TAGS]
    per_mm = {2: 1 / 25.4, 3: 0.1}.get(int(_number(tags.get("EXIF FocalPlaneResolutionUnit"), 1, 5) or 2))
    plane = [_number(tags.get(f"EXIF FocalPlane{axis}Resolution"), 1, 1e6) for axis in "XY"]
    plane_per_mm = [None if value is None or per_mm is None else value * per_mm for value in plane]
    north = tags.get("GPS GPSImgDirectionRef")  # T is the true one; M, the magnetic, lies elsewhere
    size = [_number(tags.get(f"EXIF ExifImage{side}"), 1, 1e6) for side in ("Width", "Length")]
    return Exif(
        orientation=int(_number(tags.get("Image Orientation"), 1, 8) or 1),
        make=_text(tags.get("Image Make")), model=_text(tags.get("Image Model")),
        lens=_text(tags.get("EXIF LensModel")), software=_text(tags.get("Image Software")),
        focal_mm=_number(tags.get("EXIF FocalLength"), 0.1, 10000),
        focal35_mm=_number(tags.get("EXIF FocalLengthIn35mmFilm"), 1, 10000),
        digital_zoom=_zoom(tags.get("EXIF DigitalZoomRatio")),
        focal_plane_x_per_mm=plane_per_mm[0], focal_plane_y_per_mm=plane_per_mm[1],
        width=None if size[0] is None else int(size[0]), height=None if size[1] is None else int(size[1]),
        heading=_number(tags.get("GPS GPSImgDirection"), 0, 360) if _text(north) == "T" else None,
        kept=tuple((number, value) for number, value in kept if value is not None),
    )


def joined_exif(first: bytes, second: bytes) -> bytes | None:
    """One EXIF block of two that hold a directory each, that of the picture and EXIF's own, both little-endian, as
    Canon keeps them; None where one of them is damaged."""
    fields: list[list[Field]] = []
    for block in (first, second):
        directory = tiff_directory(block) if block[:4] == b"II*\0" else None
        if directory is None:
            return None
        fields.append([(entry.tag, entry.kind, entry.values, tiff_bytes(block, entry)) for entry in directory[0]])
    return b"II*\0" + struct.pack("<I", 8) + _directories(fields[0], fields[1], 8)


def _first_directory_only(block: bytes) -> bytes | None:
    """The block without its thumbnail and further pages: damaged ones lead ExifRead on long walks."""
    directory = tiff_directory(block) if block[:4] in (b"II*\0", b"MM\0*") else None
    if directory is None:
        return None
    if not directory[1]:
        return block
    order = "<" if block[:2] == b"II" else ">"
    (first,) = struct.unpack_from(order + "I", block, 4)
    patched = bytearray(block)
    struct.pack_into("<I", patched, first + 2 + 12 * len(directory[0]), 0)
    return bytes(patched)


def _text(tag: Any) -> str:
    values = getattr(tag, "values", "")
    if isinstance(values, bytes):  # not UTF-8: cameras of that age write their own code page
        values = values.decode("latin-1")
    return "".join(letter for letter in values if letter.isprintable()).strip() if isinstance(values, str) else ""


def _number(tag: Any, least: float, most: float) -> float | None:
    """The tag's first value, None where it is absent, not a number or outside [least, most]."""
    try:
        value = float(tag.values[0])
    except (AttributeError, IndexError, TypeError, ValueError, ArithmeticError):
        return None
    return value if math.isfinite(value) and least <= value <= most else None


def _zoom(tag: Any) -> float | None:
    """A digital zoom above 1; cameras write 0 or 1 where there was none."""
    ratio = _number(tag, 1.0, 100.0)
    return ratio if ratio is not None and ratio > 1.0 else None


def _value(tag: Any, kind: int) -> str | int | tuple[int, int] | None:
    if kind == _ASCII:
        return _text(tag) or None
    if _number(tag, -1e9, 1e9) is None:
        return None
    value = tag.values[0]
    if kind == _SHORT:
        return int(value) if 0 <= value < 65536 else None
    top, bottom = int(value.numerator), int(value.denominator)
    fits = 0 <= top < 2**32 if kind == _RATIONAL else abs(top) < 2**31
    return (top, bottom) if fits and 0 < bottom < 2**31 else None


def exif_block(exif: Exif) -> bytes:
    """A fresh EXIF block (little-endian TIFF structure): the kept tags, orientation 1 and this program's name."""
    first, second = _fields(exif)
    return b"II*\0" + struct.pack("<I", 8) + _directories(first, second, 8)


Field = tuple[int, int, int, bytes]  # tag, type, count, value


def _fields(exif: Exif) -> tuple[list[Field], list[Field]]:
    kinds = {number: kind for _, number, kind in _IMAGE_TAGS + _EXIF_TAGS}
    fields = {number: _field(number, kinds[number], value) for number, value in exif.kept if number in kinds}
    image = {number for _, number, _ in _IMAGE_TAGS}
    first = [field for number, field in fields.items() if number in image]
    second = [field for number, field in fields.items() if number not in image]
    first += [_field(274, _SHORT, 1), _field(305, _ASCII, SOFTWARE)]
    second += [(36864, _UNDEFINED, 4, b"0232")]  # ExifVersion, which readers expect in the Exif directory
    return first, second


def _field(number: int, kind: int, value: str | int | tuple[int, int]) -> Field:
    if isinstance(value, str):
        # cut at a whole letter
        raw = value.encode()[:WRITING.max_text_bytes].decode(errors="ignore").encode() + b"\0"
        return number, kind, len(raw), raw
    if isinstance(value, tuple):
        return number, kind, 1, struct.pack("<II" if kind == _RATIONAL else "<ii", *value)
    return number, kind, 1, struct.pack("<H" if kind == _SHORT else "<I", value)


def _directories(first: list[Field], second: list[Field], at: int) -> bytes:
    """Both directories for byte position `at`, the Exif one (34665) behind the first."""
    length = len(_directory([*first, _field(34665, _LONG, 0)], at))
    return _directory([*first, _field(34665, _LONG, at + length)], at) + _directory(second, at + length)


def _directory(fields: list[Field], at: int) -> bytes:
    values_at = at + 2 + 12 * len(fields) + 4
    entries, values = struct.pack("<H", len(fields)), b""
    for number, kind, count, raw in sorted(fields):
        if len(raw) > 4:
            entries += struct.pack("<HHII", number, kind, count, values_at + len(values))
            values += raw + b"\0" * (len(raw) & 1)
        else:
            entries += struct.pack("<HHI", number, kind, count) + raw.ljust(4, b"\0")
    return entries + struct.pack("<I", 0) + values


def embed(
    encoded: bytes, kind: str, exif: Exif, icc: bytes | None, straight_alpha: bool = False, xmp: bytes | None = None
) -> bytes:
    """The encoded picture with EXIF and, where given, an ICC profile and an XMP packet put in.

    encoded: bytes as `png` and OpenCV write them; kind: jpeg, png or tiff (little-endian, classic). straight_alpha: say
    in a TIFF that the fourth sample is a straight alpha.
    """
    if kind == "jpeg":
        return _embed_jpeg(encoded, exif, icc, xmp)
    if kind == "png":
        return _embed_png(encoded, exif, icc, xmp)
    return _embed_tiff(encoded, exif, icc, straight_alpha, xmp)


def _embed_jpeg(encoded: bytes, exif: Exif, icc: bytes | None, xmp: bytes | None) -> bytes:
    def segment(marker: int, body: bytes) -> bytes:
        return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body

    parts = [encoded[:2], segment(0xE1, b"Exif\0\0" + exif_block(exif))]
    if xmp:
        parts.append(segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + xmp))
    if icc:
        step = _JPEG_SEGMENT - 14
        pieces = [icc[at : at + step] for at in range(0, len(icc), step)]
        if len(pieces) < 256:  # the count is one byte
            parts += [segment(0xE2, b"ICC_PROFILE\0" + bytes([number, len(pieces)]) + piece)
                      for number, piece in enumerate(pieces, 1)]
    return b"".join([*parts, encoded[2:]])


def _embed_png(encoded: bytes, exif: Exif, icc: bytes | None, xmp: bytes | None) -> bytes:
    header_end = 8 + 12 + 13
    profile = chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(icc)) if icc else b""
    packet = chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + xmp) if xmp else b""
    return encoded[:header_end] + profile + chunk(b"eXIf", exif_block(exif)) + packet + encoded[header_end:]


def _embed_tiff(encoded: bytes, exif: Exif, icc: bytes | None, straight_alpha: bool, xmp: bytes | None) -> bytes:
    directory = tiff_directory(encoded)
    assert directory is not None and encoded[:4] == b"II*\0", "written by OpenCV a moment ago"
    first, second = _fields(exif)
    if icc:
        first.append((34675, _UNDEFINED, len(icc), icc))
    if xmp:
        first.append((700, _BYTE, len(xmp), xmp))
    if straight_alpha:
        first.append(_field(338, _SHORT, 2))
    new = {field[0] for field in first}
    first += [(entry.tag, entry.kind, entry.values, tiff_bytes(encoded, entry))
              for entry in directory[0] if entry.tag not in new]
    # The old directory stays where it is, unused: moving the picture data would mean rewriting their offsets.
    at = len(encoded) + (len(encoded) & 1)
    return encoded[:4] + struct.pack("<I", at) + encoded[8:].ljust(at - 8, b"\0") + _directories(first, second, at)
