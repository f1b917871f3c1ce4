"""Radiance pictures in and out: light comes back to within a mantissa's step, however its pixels lie in the file."""

from __future__ import annotations

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.camera_raw import is_raw
from edf_stitch.core.pictures.containers import read_structure
from edf_stitch.core.pictures.encoding import encode_picture, output_bits
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.pictures.radiance import decode_radiance, encode_radiance
from edf_stitch.core.raster.primaries import to_rec709
from edf_stitch.core.system.errors import UnreadableImage

RANDOM = np.random.default_rng(5)
# 40 stops of range, with runs
LIGHT = (RANDOM.random((30, 44, 3)) * 2.0 ** RANDOM.integers(-20, 20, (30, 44, 1))).astype(np.float32)
LIGHT[4:9, 10:30] = LIGHT[4, 10]
LIGHT[12] = 0


def file_of(light: np.ndarray = LIGHT, lines: dict[str, str] | None = None) -> bytes:
    return b"".join(encode_radiance(light.shape, lambda rows: light[rows], lines or {}))


def by_hand(pixels: bytes, size: str, *lines: str, start: str = "#?RADIANCE") -> bytes:
    return "\n".join([start, *lines, "FORMAT=32-bit_rle_rgbe", "", size, ""]).encode() + pixels


def stored(light: np.ndarray = LIGHT) -> np.ndarray:
    """Pixels (H, W, 4) uint8, plain, as a file narrower than 8 px holds them."""
    return np.concatenate([
        np.frombuffer(file_of(light[:, at : at + 2])[-8 * len(light) :], np.uint8).reshape(len(light), 2, 4)
        for at in range(0, light.shape[1], 2)
    ], axis=1)  # fmt: skip


def close(found: np.ndarray, light: np.ndarray) -> bool:
    """Within half a step of the brightest channel's mantissa, which has 128 at least."""
    step = np.maximum(light.max(axis=2, keepdims=True) / 128, 1e-31)
    return bool((np.abs(found - light) <= 0.501 * step).all())


def loaded(tmp_path: Path, data: bytes) -> Picture:
    (tmp_path / "a.hdr").write_bytes(data)
    return load_picture(tmp_path / "a.hdr")


def test_light_comes_back(tmp_path: Path) -> None:
    data, warnings = encode_picture(LIGHT, None, 8, ".HDR", exif=Exif(kept=((36867, "2020:01:02 03:04:05"),)))
    back = loaded(tmp_path, data)
    assert warnings == () == back.warnings and (back.bits, back.alpha) == (32, None)
    assert close(back.pixels, LIGHT) and (back.pixels[12] == 0).all()
    bright = LIGHT.max(axis=2) > 0
    assert abs(np.median(back.pixels[bright].max(axis=1) / LIGHT[bright].max(axis=1)) - 1) < 5e-4, "no bias"
    assert b"CAPDATE=2020:01:02 03:04:05\n" in data and b"SOFTWARE=EDF Stitch\n" in data
    assert output_bits((8,), ".hdr") == 32 and encode_picture(back.pixels, None, 32, ".hdr")[0][-99:] == data[-99:]


def test_another_program_reads_what_is_written_and_the_other_way_round(tmp_path: Path) -> None:
    data = file_of()
    theirs = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]
    step = np.maximum(LIGHT.max(axis=2, keepdims=True) / 128, 1e-31)
    assert (np.abs(theirs - LIGHT) <= 1.01 * step).all(), "it reads the lower end of a step"
    written = cv2.imencode(".hdr", np.ascontiguousarray(LIGHT[..., ::-1]))[1].tobytes()
    assert close(decode_radiance(written)[0], LIGHT)


def test_runs_make_a_file_small_and_noise_hardly_larger_than_its_pixels() -> None:
    flat = np.full((64, 500, 3), 0.3, np.float32)
    assert len(file_of(flat)) < 64 * 4 * 10 + 200 and close(decode_radiance(file_of(flat))[0], flat)
    noise = RANDOM.random((20, 300, 3)).astype(np.float32)
    assert len(file_of(noise)) < 1.05 * 20 * 300 * 4 + 200


@pytest.mark.parametrize("width", [1, 7, 8, 127, 128, 129, 300])
def test_every_width(width: int) -> None:
    light = np.tile(LIGHT, (1, 7, 1))[:5, :width]
    assert close(decode_radiance(file_of(light))[0], light)


def test_gray_alpha_and_what_floats_may_hold(tmp_path: Path) -> None:
    alpha = np.ones(LIGHT.shape[:2], np.float32)
    alpha[:5], alpha[5:9] = 0, 0.5
    back = loaded(tmp_path, encode_picture(LIGHT[..., 1:2], alpha, 32, ".hdr")[0])
    expected = np.repeat(LIGHT[..., 1:2] * alpha[..., None], 3, axis=2)
    assert close(back.pixels, expected) and (back.pixels[:5] == 0).all()
    odd = np.zeros((4, 9, 3), np.float32)
    odd[0, :4] = [[np.nan, 1, 1], [np.inf, 0, 0], [-1, 2, -3], [1e-35, 0, 0]]
    found = decode_radiance(file_of(odd))[0]
    assert np.isfinite(found).all() and found[0, 1, 0] > 1e38 and (found[0, 3] == 0).all()
    assert abs(found[0, 2, 1] - 2) < 0.01 and found[0, 2].min() < 0.01


ORDERS = {
    "-Y 30 +X 44": lambda a: a, "-Y 30 -X 44": lambda a: a[:, ::-1], "+Y 30 +X 44": lambda a: a[::-1],
    "+Y 30 -X 44": lambda a: a[::-1, ::-1], "+X 44 -Y 30": lambda a: a.transpose(1, 0, 2),
    "-X 44 -Y 30": lambda a: a[:, ::-1].transpose(1, 0, 2), "+X 44 +Y 30": lambda a: a[::-1].transpose(1, 0, 2),
    "-X 44 +Y 30": lambda a: a[::-1, ::-1].transpose(1, 0, 2),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("packed", [False, True])
def test_every_order_of_the_pixels(tmp_path: Path, order: str, packed: bool) -> None:
    lines = np.ascontiguousarray(ORDERS[order](LIGHT))
    pixels = file_of(lines).partition(b"\n\n")[2].partition(b"\n")[2] if packed else stored(lines).tobytes()
    data = by_hand(pixels, order, start="#?RGBE")
    structure = read_structure(data)
    assert structure is not None and (structure.kind, structure.width, structure.height) == ("hdr", 44, 30)
    assert close(loaded(tmp_path, data).pixels, LIGHT)


def test_runs_of_the_first_kind() -> None:
    """(1, 1, 1, n) repeats the pixel before it, a second one 256 n times more."""
    pixels = bytes([128, 64, 32, 129]) + bytes([1, 1, 1, 44, 1, 1, 1, 1]) + bytes([200, 1, 1, 130]) * 19
    found = decode_radiance(by_hand(pixels, "-Y 8 +X 40"))[0].reshape(-1, 3)
    assert np.allclose(found[:301], np.array([128.5, 64.5, 32.5]) / 128)
    assert np.allclose(found[301:], np.array([200.5, 1.5, 1.5]) / 64)
    for damaged in (pixels[4:], pixels[:-4], pixels[:12] + bytes([1, 1, 1, 255])):
        with pytest.raises(UnreadableImage, match="damaged or cut off"):
            decode_radiance(by_hand(damaged, "-Y 8 +X 40"))


def test_exposure_and_colour_correction_are_taken_back(tmp_path: Path) -> None:
    picture = loaded(tmp_path, file_of(lines={"EXPOSURE": "4.0\nEXPOSURE= 0.5", "COLORCORR": "1 2 0.25"}))
    assert close(picture.pixels * np.array([2, 4, 0.5], np.float32), LIGHT) and picture.warnings == ()


@pytest.mark.parametrize(("line", "said"), [
    ("EXPOSURE=bright", "EXPOSURE=bright"), ("EXPOSURE=-1", "EXPOSURE=-1"), ("EXPOSURE=nan", "EXPOSURE=nan"),
    ("EXPOSURE=1e-30", "leave no light"), ("COLORCORR=1 2", "COLORCORR=1 2"), ("PRIMARIES=1 2 3", "PRIMARIES=1 2 3"),
    ("PIXASPECT=1.4", "not square"), ("PRIMARIES=0.3 0.3 0.3 0.3 0.3 0.3 0.3 0.3", "describes no colours"),
])  # fmt: skip
def test_lines_that_cannot_be_followed_are_said(tmp_path: Path, line: str, said: str) -> None:
    picture = loaded(tmp_path, by_hand(stored().tobytes(), "-Y 30 +X 44", line))
    assert len(picture.warnings) == 1 and said in picture.warnings[0]
    assert close(picture.pixels, LIGHT)


def test_primaries_are_those_of_srgb_in_the_end(tmp_path: Path) -> None:
    """Colours of Rec. 2020 and in X, Y, Z; sRGB's own change nothing."""
    plain, _ = decode_radiance(by_hand(stored().tobytes(), "-Y 30 +X 44"))
    assert np.array_equal(loaded(tmp_path, file_of()).pixels, plain)
    rec_2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)
    matrix = to_rec709(rec_2020)
    # ITU-R BT.2087, from 2020 to 709
    assert np.allclose(matrix, [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]],
                       atol=1e-3)  # fmt: skip
    line = "PRIMARIES=" + " ".join(map(str, rec_2020))
    found = loaded(tmp_path, by_hand(stored().tobytes(), "-Y 30 +X 44", line)).pixels
    assert np.allclose(found, decode_radiance(file_of())[0] @ matrix.T, rtol=1e-4, atol=1e-4)
    gray = np.full((10, 10, 3), 0.5, np.float32)
    data = by_hand(stored(gray).tobytes(), "-Y 10 +X 10").replace(b"rgbe", b"xyze")
    assert np.allclose(loaded(tmp_path, data).pixels, 128.5 / 256, atol=1e-3), "equal energy is white"


def test_other_kinds_of_pixels_are_named(tmp_path: Path) -> None:
    with pytest.raises(UnreadableImage, match="'32-bit_rle_spec' cannot be read; export it as EXR"):
        loaded(tmp_path, file_of().replace(b"32-bit_rle_rgbe", b"32-bit_rle_spec"))


@pytest.mark.parametrize("header", [
    b"#?RADIANCE\n", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n", b"#?RADIANCE\n\n-Y 30 +Y 44\n",
    b"#?RADIANCE\n\n-Y thirty +X 44\n", b"#?RADIANCE\n\n-Y 9999999999 +X 44\n", b"#?RGBE\n" + b"x" * 70_000 + b"\n\n",
])  # fmt: skip
def test_a_header_that_is_not_whole(tmp_path: Path, header: bytes) -> None:
    with pytest.raises(UnreadableImage, match="HDR file is damaged"):
        loaded(tmp_path, header)
    assert not is_raw(header, ".hdr")


def test_a_file_that_ends_anywhere_is_refused(tmp_path: Path) -> None:
    data = file_of()
    for end in [*range(10, 150, 3), *range(150, len(data) - 1, 211), len(data) - 1]:
        with pytest.raises(UnreadableImage):
            loaded(tmp_path, data[:end])


def test_damaged_runs_are_refused(tmp_path: Path) -> None:
    data = file_of()
    at = data.index(bytes([2, 2, 0, 44]))
    second = data.index(bytes([2, 2, 0, 44]), at + 4)
    for place, byte in ((at + 4, 0), (at + 4, 255), (second, 3), (second + 3, 45)):
        damaged = bytearray(data)
        damaged[place] = byte
        with pytest.raises(UnreadableImage, match="damaged or cut off"):
            loaded(tmp_path, bytes(damaged))


def test_a_large_one_is_unpacked_in_seconds() -> None:
    light = np.tile(LIGHT, (34, 46, 1))  # 2 MP of noise and runs
    data, began = file_of(light), time.process_time()
    assert close(decode_radiance(data)[0], light)
    assert time.process_time() - began < 5
