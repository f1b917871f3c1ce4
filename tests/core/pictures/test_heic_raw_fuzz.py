"""Damaged HEIC and camera RAW files are read or refused, each in a sentence, and the process goes on."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.system.errors import UnreadableImage

from .raw_and_heic import dng, heic, mosaic

if sys.platform != "linux":
    pytest.skip("the mutations are made where memory is measured by /proc", allow_module_level=True)
from .decoder_fuzz import HEIGHT, MUTATIONS, WIDTH

NOISE = cv2.GaussianBlur(np.random.default_rng(8).integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8), (0, 0), 1.5)


def outcomes(files: dict[str, bytes], folder: Path, cases: range, capfd: pytest.CaptureFixture[str]) -> list[str]:
    """What became of each damaged file: "picture" or the refusal."""
    out = []
    for number in cases:
        rng = random.Random(number)
        name = rng.choice(sorted(files))
        data = bytearray(files[name])
        rng.choice(MUTATIONS)(data, rng, files)
        path = folder / name
        path.write_bytes(data)
        try:
            picture = load_picture(path)
            assert np.isfinite(picture.pixels).all() and picture.pixels.shape == picture.view.shape
            out.append("picture")
        except UnreadableImage as error:
            assert str(error).startswith(f"{path}: ") and len(str(error)) < 1000
            out.append(str(error))
    assert not "".join(capfd.readouterr()), "the libraries' own words stay away from the user"
    return out


def test_damaged_heic(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    colour = np.ascontiguousarray(NOISE[..., :3])
    files = {
        "rgb.heic": heic(colour), "alpha.heic": heic(NOISE), "lossy.heic": heic(colour, quality=60, chroma=420),
        "deep.heic": heic(colour.astype(np.uint16) * 257, "RGB;16"),
    }  # fmt: skip
    found = outcomes(files, tmp_path, range(120), capfd)
    assert 20 < found.count("picture") < 70, "the mutations are neither harmless nor all found"


def test_damaged_raw(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    sensor = mosaic(NOISE[..., :3] / 255.0)
    found = outcomes({"a.dng": dng(sensor), "b.dng": dng(sensor, orientation=6)}, tmp_path, range(25), capfd)
    assert 3 < found.count("picture") < 22
