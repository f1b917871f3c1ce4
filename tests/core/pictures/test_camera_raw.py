"""Camera RAW: recognised by what it holds, and developed to scene-linear light with one white and one exposure."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures import decoding, raw_development
from edf_stitch.core.pictures import picture as reading
from edf_stitch.core.pictures.camera_raw import is_raw, raw_bytes, raw_damage, raw_exif, raw_size
from edf_stitch.core.pictures.metadata import read_exif
from edf_stitch.core.pictures.options import READING
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.pictures.raw_clipping import clipped_share, clipping_warnings
from edf_stitch.core.pictures.raw_development import exposure_of_first
from edf_stitch.core.raster.lazy import Coded
from edf_stitch.core.system.errors import UnreadableImage

from .raw_and_heic import NEUTRAL, dng, mosaic

NOISE = cv2.GaussianBlur(np.random.default_rng(8).random((120, 160, 3)), (0, 0), 8)
# from 0.05 to 0.85, so that nothing clips
LIGHT = 0.05 + 0.8 * (NOISE - NOISE.min()) / np.ptp(NOISE)
PICTURE = dng(mosaic(LIGHT))
JPEG, TIFF = (cv2.imencode(suffix, (255 * LIGHT).astype(np.uint8))[1].tobytes() for suffix in (".jpg", ".tif"))


def written(folder: Path, name: str, data: bytes) -> Path:
    (folder / name).write_bytes(data)
    return folder / name


def off(picture: Picture, light: np.ndarray) -> float:
    """By which share of the light the picture is off, for all but a hundredth of it."""
    return float(np.percentile(np.abs(picture.pixels / light - 1), 99))


# --- recognised ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "suffix", "known"), [
    (PICTURE, ".dng", True), (PICTURE, ".tif", True), (PICTURE, "", True), (JPEG, ".nef", False), (TIFF, ".tif", False),
    (TIFF, ".nef", True), (b"II*\0\x10\0\0\0CR\2\0" + bytes(50), ".tif", True), (b"what ever this is", ".nef", True),
    (b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom", ".jpg", True), (b"IIRO\x08\0\0\0", ".jpg", True),
    (b"IIU\0\x18\0\0\0", ".jpg", True), (b"FUJIFILMCCD-RAW 0201", ".jpg", True), (b"\0MRM\0\0", ".jpg", True),
    (b"II\x1a\0\0\0HEAPCCDR", ".jpg", True), (b"II*\0\x08\0\0\0IIII", ".tif", True), (b"", ".nef", True),
    (b"what ever this is", ".jpg", False), (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", ".jpg", False),
])  # fmt: skip
def test_raw_is_recognised_by_what_it_holds(start: bytes, suffix: str, known: bool) -> None:
    assert is_raw(start, suffix) is known


def test_the_sensor_may_stand_in_a_directory_within_another() -> None:
    """As Nikon and Sony have it: a small preview first."""
    inner = 8 + 2 + 3 * 12 + 4
    preview = [(256, 4, 16), (257, 4, 12), (330, 4, inner)]
    sensor = [(256, 4, 6000), (257, 4, 4000), (262, 3, 32803)]
    data = b"II*\0" + struct.pack("<I", 8)
    for directory in (preview, sensor):
        entries = [struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in directory]
        data += struct.pack("<H", 3) + b"".join(entries) + struct.pack("<I", 0)
    assert is_raw(data, ".tif") and raw_size(data) == (6000, 4000)
    assert not is_raw(data[: inner - 16] + bytes(200), ".tif")


def test_size_and_damage_are_seen_before_decoding() -> None:
    assert raw_size(PICTURE) == (160, 120) and not raw_damage(PICTURE)
    assert "cut off" in raw_damage(PICTURE[:-1])
    cr3 = b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom" + struct.pack(">I4s", 108, b"mdat") + bytes(100)
    assert not raw_damage(cr3) and "cut off" in raw_damage(cr3[:-1])
    raf = bytearray(b"FUJIFILMCCD-RAW 0201".ljust(84, b"\0") + struct.pack(">6I", 108, 50, 0, 0, 158, 42) + bytes(92))
    assert not raw_damage(bytes(raf)) and "cut off" in raw_damage(bytes(raf[:-1]))
    assert np.prod(raw_size(cr3)) == len(cr3), "nothing better is known"


def test_exif_under_a_makers_own_number_and_inside_a_preview() -> None:
    for magic in (b"IIRO", b"IIU\0"):
        assert read_exif(raw_exif(magic + PICTURE[4:])).focal_mm == 24
    block = b"Exif\0\0" + PICTURE[:1000]
    preview = b"\xff\xd8\xff\xe1" + struct.pack(">H", len(block) + 2) + block + b"\xff\xd9"
    raf = b"FUJIFILMCCD-RAW 0201".ljust(84, b"\0") + struct.pack(">II", 100, len(preview)) + bytes(8) + preview
    assert read_exif(raw_exif(raf)).make == "Maker"
    assert raw_exif(b"\0MRM") is None


def test_exif_of_canons_boxes() -> None:
    """CR3 has one directory in each of two boxes."""
    def box(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", 8 + len(body)) + kind + body

    def directory(*entries: tuple[int, int, int, bytes]) -> bytes:
        behind, listed = b"", b""
        for tag, kind, count, value in entries:
            listed += struct.pack("<HHII", tag, kind, count, 8 + 2 + 12 * len(entries) + 4 + len(behind))
            behind += value
        return b"II*\0" + struct.pack("<IH", 8, len(entries)) + listed + bytes(4) + behind

    blocks = [
        directory((271, 2, 6, b"Canon\0"), (272, 2, 12, b"Canon EOS R\0")),
        directory((33434, 5, 1, struct.pack("<II", 1, 250)), (37386, 5, 1, struct.pack("<II", 35, 1))),
    ]
    own = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48") + box(b"CMT1", blocks[0]) + box(b"CMT2", blocks[1])
    start = b"\0\0\0\x18ftypcrx \0\0\0\x01crx isom"
    found = read_exif(raw_exif(start + box(b"moov", box(b"uuid", own)) + box(b"mdat", bytes(50))))
    assert (found.make, found.model, found.focal_mm) == ("Canon", "Canon EOS R", 35) and found.number(33434) == 1 / 250
    for damaged in (start, start + box(b"moov", box(b"uuid", own[:40])), start + box(b"moov", own)):
        assert raw_exif(damaged) is None


def test_no_more_of_a_file_is_read_than_tells(tmp_path: Path) -> None:
    assert raw_bytes(written(tmp_path, "a.tif", PICTURE)) == PICTURE
    assert raw_bytes(written(tmp_path, "a.nef", JPEG)) is None
    assert raw_bytes(written(tmp_path, "b.tif", TIFF)) is None and raw_bytes(tmp_path / "none.nef") is None


# --- developed -------------------------------------------------------------------------------------------------------


def test_light_comes_out_linear_and_as_a_float_picture(tmp_path: Path) -> None:
    picture = load_picture(written(tmp_path, "a.tif", PICTURE))
    assert off(picture, LIGHT) < 0.02 and np.median(picture.pixels / LIGHT) == pytest.approx(1, abs=1e-3)
    assert picture.bits == 32 and picture.icc is None and picture.alpha is None and picture.clips_at == 1
    assert (picture.exif.make, picture.exif.focal_mm, picture.exif.orientation) == ("Maker", 24, 1)
    assert isinstance(picture.light, Coded), "six bytes a pixel are held, not twelve"


@pytest.mark.parametrize(("orientation", "turns"), [(1, 0), (3, 2), (6, 3), (8, 1)])
def test_it_comes_out_upright(tmp_path: Path, orientation: int, turns: int) -> None:
    picture = load_picture(written(tmp_path, "a.dng", dng(mosaic(LIGHT), orientation=orientation)))
    assert off(picture, np.rot90(LIGHT, turns)) < 0.02 and picture.exif.orientation == 1


def test_one_white_and_one_exposure_serve_all(tmp_path: Path) -> None:
    """The second camera balanced otherwise and let in an eighth of the light: its time, f-number and ISO say so."""
    first = written(tmp_path, "a.dng", PICTURE)
    files = [written(tmp_path, "none.jpg", JPEG), tmp_path / "missing.dng", first]
    exposure = exposure_of_first(files)
    assert exposure is not None and exposure.white == pytest.approx((2, 1, 1 / 0.6, 1), rel=1e-3)
    dark = dng(mosaic(LIGHT / 8), (0.7, 1.0, 0.4), seconds=(1, 200), f_number=(8, 1), iso=100)
    second = written(tmp_path, "b.dng", dark)
    picture = load_picture(second, exposure=exposure)
    assert off(picture, LIGHT) < 0.02 and picture.clips_at == pytest.approx(8) and not picture.warnings
    assert off(load_picture(second), LIGHT) > 0.2, "by itself it keeps its own"
    bright = written(tmp_path, "c.dng", dng(mosaic(LIGHT), iso=400, seconds=(1, 400)))
    assert off(load_picture(bright, exposure=exposure), LIGHT) < 0.02


def test_what_is_clipped_is_white_and_is_said_where_it_was_exposed_longer(tmp_path: Path) -> None:
    lamp = LIGHT.copy()
    lamp[20:60, 20:60] = 30.0
    exposure = exposure_of_first([written(tmp_path, "a.dng", PICTURE)])
    picture = load_picture(written(tmp_path, "b.dng", dng(mosaic(lamp, NEUTRAL), seconds=(1, 50))), exposure=exposure)
    inside = picture.pixels[25:55, 25:55]
    assert picture.clips_at == pytest.approx(0.5)
    assert np.abs(inside - 0.5).max() < 1e-4, "the most it can say, without a tint"
    (said,) = clipping_warnings(picture)
    assert "8% of it is over-exposed" in said and "1.0 stops more" in said
    assert clipped_share(picture) == pytest.approx(1600 / (120 * 160), rel=0.1)
    alone = load_picture(tmp_path / "b.dng")
    assert clipped_share(alone) == clipped_share(picture) and not clipping_warnings(alone)


def test_what_a_file_does_not_say_is_taken_as_equal_and_said(tmp_path: Path) -> None:
    exposure = exposure_of_first([written(tmp_path, "a.dng", PICTURE)])
    picture = load_picture(written(tmp_path, "b.dng", dng(mosaic(LIGHT), seconds=None)), exposure=exposure)
    assert off(picture, LIGHT) < 0.02 and "does not say its time" in picture.warnings[0]
    assert not load_picture(tmp_path / "b.dng").warnings, "alone there is nothing to compare with"
    absurd = written(tmp_path, "c.dng", dng(mosaic(LIGHT), seconds=(1, 4_000_000_000), iso=1, f_number=(250, 1)))
    assert off(load_picture(absurd, exposure=exposure), LIGHT) < 0.02


def test_without_a_white_balance_daylight_is_taken(tmp_path: Path) -> None:
    data = dng(mosaic(LIGHT, (1, 1, 1)))
    at = data.index(struct.pack("<HH", 50728, 5))
    picture = load_picture(written(tmp_path, "a.dng", data[:at] + struct.pack("<HH", 50999, 5) + data[at + 4 :]))
    assert "that of daylight was taken" in picture.warnings[0]
    assert off(picture, LIGHT) < 0.03, "its sensor has sRGB's primaries and white"


# --- refused ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("data", "words"), [
    (PICTURE[:-500], "the camera RAW file is damaged: it is cut off"), (TIFF, "cannot be decoded.*16-bit TIFF"),
    (b"what ever this is", "cannot be decoded.*16-bit TIFF"), (b"", "the file is empty"),
])  # fmt: skip
def test_what_cannot_be_developed_is_refused(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(UnreadableImage, match=words):
        load_picture(written(tmp_path, "a.nef", data))


def test_a_bomb_is_refused_before_memory_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (decoding, reading, raw_development):
        monkeypatch.setattr(module, "READING", replace(READING, small_pixels=1000, raw_pixels_per_byte=0))
    asked: list[dict[str, object]] = []
    decoded = raw_development.decoded

    def noted(kind: str, data: bytes, wanted: dict[str, object]) -> object:
        facts, samples = decoded(kind, data, wanted)
        asked.append({**facts, "samples": len(samples)})
        return facts, samples

    monkeypatch.setattr(raw_development, "decoded", noted)
    with pytest.raises(UnreadableImage, match="160 × 120 pixels cannot come out of"):
        load_picture(written(tmp_path, "a.dng", PICTURE))
    assert asked[0]["samples"] == 0
