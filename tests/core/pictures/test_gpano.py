"""Viewers of spheres are told which part of a sphere a picture is, beside its EXIF and profile."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from edf_stitch.core.pictures.containers import tiff_bytes, tiff_directory
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.gpano import SpherePart, sphere_part_told, whole_sphere, xmp_packet
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import load_picture

GPANO = "{http://ns.google.com/photos/1.0/panorama/}"
PART = SpherePart((200, 100), (30, 20, 60, 40), -12.25)
LIGHT = np.random.default_rng(4).random((40, 60, 3)).astype(np.float32)
EXIF = Exif(kept=((271, "Ann's"), (36867, "2020:01:02 03:04:05")))
PROPERTIES = {
    "UsePanoramaViewer": "True", "ProjectionType": "equirectangular", "StitchingSoftware": "EDF Stitch",
    "FullPanoWidthPixels": "200", "FullPanoHeightPixels": "100", "CroppedAreaLeftPixels": "30",
    "CroppedAreaTopPixels": "20", "CroppedAreaImageWidthPixels": "60", "CroppedAreaImageHeightPixels": "40",
    "PoseHeadingDegrees": "347.8",
}  # fmt: skip


def properties(packet: bytes) -> dict[str, str]:
    """The GPano properties of an XMP packet, as an XML reader finds them."""
    root = ElementTree.fromstring(re.sub(rb"<\?xpacket.*?\?>", b"", packet))
    found = root.find(".//{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description")
    assert found is not None
    return {name.removeprefix(GPANO): value for name, value in found.attrib.items() if name.startswith(GPANO)}


def packet_in(data: bytes, suffix: str) -> bytes | None:
    """The XMP packet where the standard says it lies in each kind of file."""
    if suffix == ".tif":
        directory = tiff_directory(data)
        assert directory is not None
        return next((tiff_bytes(data, entry) for entry in directory[0] if entry.tag == 700), None)
    if suffix == ".png":
        at = data.find(b"iTXtXML:com.adobe.xmp\0\0\0\0\0")
        if at < 0:
            return None
        length = int.from_bytes(data[at - 4 : at], "big")
        body = data[at : at + 4 + length]
        assert zlib.crc32(body) == int.from_bytes(data[at + 4 + length : at + 8 + length], "big")
        return body[26:]
    mark = b"http://ns.adobe.com/xap/1.0/\0"
    at = data.find(mark)
    return None if at < 0 else data[at + len(mark) : at - 2 + int.from_bytes(data[at - 2 : at], "big")]


def test_a_packet_names_the_part_and_where_it_looks() -> None:
    assert properties(xmp_packet(PART)) == PROPERTIES
    assert "PoseHeadingDegrees" not in properties(xmp_packet(SpherePart((8, 4), (0, 0, 8, 4))))
    assert SpherePart((8, 4), (0, 0, 8, 4)).is_whole and not PART.is_whole


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_it_lies_beside_exif_and_is_read_back(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"sphere{suffix}"
    path.write_bytes(encode_picture(LIGHT, None, 8, suffix, exif=EXIF, sphere=PART)[0])
    packet = packet_in(path.read_bytes(), suffix)
    assert packet is not None and properties(packet) == PROPERTIES
    back = load_picture(path)
    assert back.exif.kept == EXIF.kept and back.warnings == ()
    plain = tmp_path / f"plain{suffix}"
    plain.write_bytes(encode_picture(LIGHT, None, 8, suffix, exif=EXIF)[0])
    assert np.array_equal(back.view, load_picture(plain).view)
    assert packet_in(plain.read_bytes(), suffix) is None


@pytest.mark.skipif(shutil.which("exiftool") is None, reason="exiftool is not there")
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_another_program_reads_it(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"sphere{suffix}"
    path.write_bytes(encode_picture(LIGHT, None, 8, suffix, exif=EXIF, sphere=PART)[0])
    command = ["exiftool", "-j", "-XMP-GPano:all", "-validate", "-warning", "-error", str(path)]
    said = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)[0]
    assert {name: str(said[name]) for name in PROPERTIES} == PROPERTIES
    assert "Error" not in said


def told(size: tuple[int, int] = (60, 40), **properties: str) -> SpherePart | None:
    """What is read of the packet of PART with some properties changed, or, where they are "", left out."""
    said = {name: text for name, text in {**PROPERTIES, **properties}.items() if text}
    return sphere_part_told(" ".join(f'GPano:{name}="{text}"' for name, text in said.items()).encode(), size)


def test_numbers_that_can_be_are_believed() -> None:
    assert told() == told(FullPanoWidthPixels="+200.0") == SpherePart((200, 100), (30, 20, 60, 40))
    assert told(CroppedAreaLeftPixels="") == SpherePart((200, 100), (0, 20, 60, 40))
    assert told((80, 40), FullPanoWidthPixels="") == whole_sphere((80, 40))


@pytest.mark.parametrize("text", ["-600", "-30", "nan", "inf", "9" * 400, "1px"])
@pytest.mark.parametrize("name", [name for name in PROPERTIES if name.endswith("Pixels")])
def test_of_numbers_that_cannot_be_no_sphere_is_told(name: str, text: str) -> None:
    """The picture is 2:1, as whole spheres are: it is not taken for one."""
    sizes = {"CroppedAreaImageWidthPixels": "80", "CroppedAreaImageHeightPixels": "40"}
    assert told((80, 40), **sizes) is not None
    assert told((80, 40), **{**sizes, name: text}) is None


@pytest.mark.parametrize("tiny", ["0", "0." + "0" * 320 + "1", "0.0000001"])
def test_a_picture_that_calls_itself_next_to_nothing_is_no_sphere(tiny: str) -> None:
    assert told(CroppedAreaImageWidthPixels=tiny) is None
    assert told(CroppedAreaImageWidthPixels=tiny, CroppedAreaImageHeightPixels=tiny) is None
