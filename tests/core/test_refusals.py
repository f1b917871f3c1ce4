"""Files that are no whole picture: each is refused in words, quietly, and before it fills the memory."""

from __future__ import annotations

import io
import struct
import subprocess
import sys
import zlib
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures import opencv
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.system.errors import UnreadableImage
from hypothesis import given, settings
from hypothesis import strategies as st

OpenEXR = pytest.importorskip("OpenEXR")

NOISE = np.random.default_rng(7).random((24, 36, 4))
PICTURE = np.rint(NOISE[..., :3] * 255).astype(np.uint8)


def exr(channels: dict[str, np.ndarray]) -> bytes:
    stream = io.BytesIO()
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels).write(stream)
    return stream.getvalue()


def load(tmp_path: Path, data: bytes, suffix: str) -> Picture:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(data)
    return load_picture(path)


def encoded(array: np.ndarray, suffix: str) -> bytes:
    return cv2.imencode(suffix, array)[1].tobytes()


def damaged_files() -> dict[str, tuple[bytes, str]]:
    files = {suffix: encoded(PICTURE, suffix) for suffix in (".jpg", ".png", ".tif", ".webp", ".bmp")}
    files[".exr"] = exr({name: np.float32(NOISE[..., index]) for index, name in enumerate("RGB")})
    cases = {f"{share} of {suffix}": (data[: int(len(data) * share)], suffix) for suffix, data in files.items()
             for share in (0.02, 0.1, 0.6, 0.95)}
    cases |= {f"last byte of {suffix}": (data[:-1], suffix) for suffix, data in files.items()}
    # a thumbnail has an end marker too
    jpeg = files[".jpg"]
    thumbnail = b"\xff\xe1" + struct.pack(">H", 8 + len(jpeg)) + b"Exif\0\0" + jpeg
    cases["thumbnail"] = (jpeg[:2] + thumbnail + jpeg[2:-200], ".jpg")
    broken = bytearray(files[".png"])
    broken[len(broken) // 2] ^= 1
    cases["checksum"] = (bytes(broken), ".png")
    return cases


@pytest.mark.parametrize("case", damaged_files())
def test_cut_off_files_are_refused_quietly(case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    data, suffix = damaged_files()[case]
    with pytest.raises(UnreadableImage) as error:
        load(tmp_path, data, suffix)
    assert any(word in str(error.value) for word in ("damaged", "cut off", "not a picture")), error.value
    out, err = capfd.readouterr()
    assert out == ""
    assert suffix == ".exr" or err == ""


def test_whole_files_with_something_behind_them_are_read(tmp_path: Path) -> None:
    array = PICTURE
    for suffix in (".jpg", ".png"):
        for tail in (bytes(100), b"MotionPhoto_Data\xff\xd8\xff\xd9" * 3):
            load(tmp_path, encoded(array, suffix) + tail, suffix)
    progressive = cv2.imencode(".jpg", array, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_RST_INTERVAL, 2])[1]
    load(tmp_path, progressive.tobytes(), ".jpg")


def test_what_is_no_picture(tmp_path: Path) -> None:
    def refused(path: Path) -> str:
        with pytest.raises(UnreadableImage) as error:
            load_picture(path)
        assert str(path) in str(error.value)
        return str(error.value)

    assert "no such file" in refused(tmp_path / "nothing.png")
    assert "a folder" in refused(tmp_path)
    (tmp_path / "empty.jpg").touch()
    assert "the file is empty" in refused(tmp_path / "empty.jpg")
    (tmp_path / "text.jpg").write_text("hello, this is a letter and no picture")
    assert "not a picture" in refused(tmp_path / "text.jpg")
    (tmp_path / "a.heic").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic")
    assert "the HEIC file is damaged" in refused(tmp_path / "a.heic")
    (tmp_path / "a.NEF").write_bytes(encoded(PICTURE, ".tif"))
    assert "camera RAW" in refused(tmp_path / "a.NEF") and "16-bit TIFF" in refused(tmp_path / "a.NEF")
    if Path("/dev/zero").exists():
        assert "not a regular file" in refused(Path("/dev/zero"))


@pytest.mark.parametrize(("width", "height"), [(20001, 20000), (65536, 1), (1, 70000), (2**31 - 1, 2**31 - 1), (0, 5)])
@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".webp", ".exr", ".bmp"])
def test_bombs_are_refused_by_their_header(tmp_path: Path, suffix: str, width: int, height: int) -> None:
    array = np.zeros((1, 1, 3), np.uint8)
    data = bytearray(encoded(array, suffix) if suffix != ".exr" else exr({one: np.zeros((1, 1), "f") for one in "RGB"}))
    if suffix == ".png":
        data[16:24] = struct.pack(">II", width, height)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    elif suffix == ".jpg":
        if max(width, height) > 65535:
            pytest.skip("JPEG cannot say so")
        at = data.index(b"\xff\xc0")
        data[at + 5 : at + 9] = struct.pack(">HH", height, width)
    elif suffix == ".tif":
        for tag, value in ((256, width), (257, height)):
            at = data.index(struct.pack("<HHI", tag, 3, 1))
            data[at : at + 12] = struct.pack("<HHII", tag, 4, 1, value)
    elif suffix == ".webp":
        if max(width, height) > 2**24 or width == 0:
            pytest.skip("WebP cannot say so")
        size = struct.pack("<I", width - 1)[:3] + struct.pack("<I", height - 1)[:3]
        body = b"WEBPVP8X" + struct.pack("<I", 10) + bytes(4) + size + data[12:]
        data = bytearray(b"RIFF" + struct.pack("<I", len(body)) + body)
    elif suffix == ".bmp":
        data[18:26] = struct.pack("<II", width, height)
    else:
        for name in (b"displayWindow\0box2i\0", b"dataWindow\0box2i\0"):
            at = data.index(name) + len(name) + 4
            data[at : at + 16] = struct.pack("<4i", 0, 0, width - 1, height - 1)
    # OpenEXR itself finds the nonsensical ones damaged
    words = "damaged|no size" if suffix == ".exr" and not 0 < width < 2**31 - 1 else "too many|gives no size"
    with pytest.raises(UnreadableImage, match=words):
        load(tmp_path, bytes(data), suffix)


def test_names_outside_ascii_and_the_level_of_opencv(tmp_path: Path) -> None:
    log = cv2 if hasattr(cv2, "getLogLevel") else cv2.utils.logging
    before = log.getLogLevel()
    log.setLogLevel(2)
    path = tmp_path / "Übung 写真.png"
    path.write_bytes(encoded(PICTURE, ".png"))
    assert load_picture(str(path)).name == "Übung 写真.png"
    assert log.getLogLevel() == 2
    log.setLogLevel(before)


@pytest.mark.parametrize("newer", [False, True])
def test_opencv_is_quiet_by_either_spelling(monkeypatch: pytest.MonkeyPatch, newer: bool) -> None:
    """`cv2.getLogLevel` moved to `cv2.utils.logging` with OpenCV 4.13."""
    level = [3]
    spelt = SimpleNamespace(getLogLevel=lambda: level[0], setLogLevel=lambda value: level.__setitem__(0, value))
    whole = SimpleNamespace(utils=SimpleNamespace(logging=spelt)) if newer else spelt
    monkeypatch.setattr(opencv, "cv2", whole)
    with opencv.quiet_opencv():
        assert level == [0]
    assert level == [3]


def mutated(seed: int, length: int, changes: list[tuple[int, int]]) -> tuple[bytes, str]:
    suffix = (".jpg", ".png", ".tif", ".exr", ".webp", ".bmp")[seed % 6]
    array = NOISE[:16, :20, : 3 + seed // 6 % 2].astype(np.float32)
    if suffix in (".webp", ".bmp"):
        data = bytearray(encoded(np.rint(array[..., :3] * 255).astype(np.uint8), suffix))
    else:
        exif = Exif(kept=((271, "Somebody"), (306, "2020:01:01 00:00:00"), (33434, (1, 60))))
        alpha = array[..., 3] if array.shape[2] == 4 else None
        data = bytearray(encode_picture(array[..., :3], alpha, 16, suffix, exif=exif)[0])
    for at, value in changes:
        # headers stand at one of the ends
        data[(at % 400 if at % 3 == 0 else -(at % 300) if at % 3 == 1 else at) % len(data)] = value
    return bytes(data[: length % len(data)] if length else data), suffix


@settings(max_examples=250)
@given(st.integers(0, 11), st.one_of(st.just(0), st.integers(0, 10**5)),
       st.lists(st.tuples(st.integers(0, 10**5), st.sampled_from([0, 1, 2, 127, 128, 254, 255]) | st.integers(0, 255)),
                max_size=6))
def test_damage_ends_in_a_picture_or_a_refusal(
    tmp_path: Path, seed: int, length: int, changes: list[tuple[int, int]]
) -> None:
    data, suffix = mutated(seed, length, changes)
    try:
        picture = load(tmp_path, data, suffix)
    except UnreadableImage:
        return
    assert np.isfinite(picture.pixels).all() and picture.pixels.shape == picture.view.shape
    assert picture.alpha is None or (picture.alpha.min() >= 0 and picture.alpha.max() <= 1)


def test_the_decoders_are_loaded_when_they_are_needed() -> None:
    program = "import sys, edf_stitch.core.pictures.picture; print({'OpenEXR', 'exifread', 'bpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-B", "-c", f"import sys; sys.path[:] = {sys.path!r}; {program}"],
                          capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
