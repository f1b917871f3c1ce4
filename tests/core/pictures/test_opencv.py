"""What libraries print while they decode is heard and not shown, and damage in a JPEG found by it."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.opencv import decoded
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.system.errors import UnreadableImage
from edf_stitch.core.system.streams import overheard

NOISE = cv2.GaussianBlur(np.random.default_rng(3).integers(0, 256, (90, 120, 3), np.uint8), (0, 0), 2)


def jpeg(*options: int) -> bytes:
    return cv2.imencode(".jpg", NOISE, list(options))[1].tobytes()


@pytest.mark.parametrize("options", [
    (), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_RST_INTERVAL, 4),
])
def test_damage_inside_a_jpeg_is_found_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], options: tuple[int, ...]
) -> None:
    whole = jpeg(*options)
    assert decoded(whole) is not None
    found = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        at = len(whole) // 3 + seed * len(whole) // 50
        data = whole[:at] + rng.integers(0, 255, 30, np.uint8).tobytes() + whole[at + 30 :]
        (tmp_path / "picture.jpg").write_bytes(data)
        try:
            load_picture(tmp_path / "picture.jpg")
        except UnreadableImage as error:
            assert "damaged" in str(error)
            found += 1
    assert found >= 15, "some damage reads as other blocks, and ends where it should"
    assert capfd.readouterr() == ("", "")


def test_filling_before_the_end_marker_is_no_damage(capfd: pytest.CaptureFixture[str]) -> None:
    whole = jpeg()
    for filling in (bytes(500), b"\xaa" * 3):
        assert decoded(whole[:-2] + filling + whole[-2:]) is not None
    with pytest.raises(UnreadableImage, match="damaged"):
        decoded(whole[:-2] + bytes(range(1, 90)) + whole[-2:])
    assert capfd.readouterr().err == ""


def test_lines_of_others_are_passed_on(capfd: pytest.CaptureFixture[str]) -> None:
    with overheard(lambda line: "library" in line) as lines:
        os.write(2, b"edf: a message\na library complains\n")
        assert not lines
    assert lines == ["a library complains"]
    assert capfd.readouterr().err == "edf: a message\n"


@pytest.mark.parametrize(("marker", "bits", "words"), [(0xC3, 8, "without loss"), (0xC1, 12, "12 bits")])
def test_kinds_of_jpeg_that_are_not_read_are_named(tmp_path: Path, marker: int, bits: int, words: str) -> None:
    whole = jpeg()
    at = whole.index(b"\xff\xc0")
    data = whole[:at] + struct.pack("BB", 0xFF, marker) + whole[at + 2 : at + 4] + bytes([bits]) + whole[at + 5 :]
    (tmp_path / "picture.jpg").write_bytes(data)
    with pytest.raises(UnreadableImage, match=words):
        load_picture(tmp_path / "picture.jpg")
