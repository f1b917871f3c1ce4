"""Files that hold no picture of those that are read are called by name."""

from __future__ import annotations

import struct

import pytest
from edf_stitch.core.pictures.containers import read_structure
from edf_stitch.core.pictures.foreign import foreign_kind


@pytest.mark.parametrize(("data", "name"), [
    (b"GIF87a", "GIF"), (b"\xff\x0a\x10", "JPEG XL"), (b"\0\0\0\x0cJXL \r\n\x87\n", "JPEG XL"),
    (b"\0\0\0\x0cjP  \r\n\x87\n", "JPEG 2000"), (b"\xff\x4f\xff\x51\0", "JPEG 2000"), (b"8BPS\0\1", "Photoshop"),
    (b"gimp xcf v011", "GIMP"), (b"%PDF-1.7", "PDF"), (b"BLENDER-v402", "Blender"), (b"<html>", "web page"),
    (b"<svg xmlns", "SVG"), (b"PK\3\4", "ZIP"), (b"\x1aE\xdf\xa3", "film"), (b"RIFF\0\0\0\0AVI LIST", "film"),
    (struct.pack(">I", 24) + b"ftypmp42", "film"), (struct.pack(">I", 24) + b"ftypavif", "AVIF"),
])  # fmt: skip
def test_what_it_is(data: bytes, name: str) -> None:
    data += bytes(64)
    found = foreign_kind(data)
    assert found is not None and name in found[0] and read_structure(data) is None


@pytest.mark.parametrize("data", [b"", b"a letter", bytes(64), b"RIFF\0\0\0\0WEBPVP8 "])
def test_nothing_is_said_of_what_is_not_known(data: bytes) -> None:
    assert foreign_kind(data) is None
