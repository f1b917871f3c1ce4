"""Files that are often mistaken for pictures that are read: what each is, and what to do with it."""

from __future__ import annotations

from .containers import container_brand

_RENDERED = "export it as PNG or TIFF"
_FILM = "a film", "export its frames as PNG or JPEG"
_FILM_BRANDS = {b"isom", b"iso2", b"iso4", b"iso5", b"iso6", b"mp41", b"mp42", b"avc1", b"qt  ", b"M4V ", b"3gp4"}
# How they begin, what they are called, and what helps.
_STARTS = (
    ((b"GIF87a", b"GIF89a"), "a GIF", _RENDERED),
    ((b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n"), "a JPEG XL picture", _RENDERED),
    ((b"\0\0\0\x0cjP  \r\n\x87\n", b"\xff\x4f\xff\x51"), "a JPEG 2000 picture", _RENDERED),
    ((b"8BPS",), "a Photoshop document", "save a copy of it as TIFF or PNG"),
    ((b"gimp xcf",), "a GIMP document", _RENDERED),
    ((b"%PDF-",), "a PDF document", "save its picture as PNG or TIFF"),
    ((b"BLENDER",), "a Blender file", "render it to EXR or PNG"),
    ((b"<!DOCTYPE", b"<!doctype", b"<html", b"<HTML"), "a web page", "download the picture itself again"),
    ((b"<svg",), "a drawing (SVG)", _RENDERED),
    ((b"PK\3\4",), "a ZIP archive", "unpack it"),
    ((b"\x1aE\xdf\xa3",), *_FILM),
)


def foreign_kind(data: bytes) -> tuple[str, str] | None:
    """What a file is that holds no picture of those that are read, and what to do; None where it is not known."""
    if container_brand(data) == "AVIF":
        return "an AVIF picture", "export it as PNG or JPEG"
    for starts, name, advice in _STARTS:
        if data.startswith(starts):
            return name, advice
    is_avi = data[:4] == b"RIFF" and data[8:12] == b"AVI "
    return _FILM if is_avi or (data[4:8] == b"ftyp" and data[8:12] in _FILM_BRANDS) else None
