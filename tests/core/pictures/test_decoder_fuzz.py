"""The decoders' edge: whatever a file holds, it is read or refused, in little memory and time, and nothing crashes."""

from __future__ import annotations

import io
import os
import select
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.masks import read_mask
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.system.errors import UnreadableImage

HERE = Path(__file__).parent
CASES = 400
SOAK = int(os.environ.get("EDF_SOAK_FILES", 20_000))
# seconds of wall clock without a word before it counts as a hang; and what Python and the libraries get to load
PATIENCE, START = 60, 300

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured by /proc")


def failures(first: int, last: int) -> tuple[int, dict[int, str]]:
    """How many of the cases were read as pictures; those that neither were nor were refused, with what happened."""
    pictures, bad = 0, {}
    while first < last:
        command = [sys.executable, str(HERE / "decoder_fuzz.py"), str(first), str(last)]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as job:
            out = b""
            while select.select([job.stdout], [], [], PATIENCE if out else START)[0]:
                if not (chunk := os.read(job.stdout.fileno(), 1 << 16)):
                    break
                out += chunk
            else:
                job.kill()
        number, outcome = first - 1, ""
        for line in out.decode().splitlines():
            number, outcome = int(line.split()[0]), line.partition(" ")[2].strip()
            pictures += outcome == "picture"
            if outcome not in ("picture", "refused", ""):
                bad[number] = outcome
        assert number >= first, "it did not even begin"
        if not outcome:
            bad[number] = f"ended by signal {-job.returncode}, or hung"
        first = number + 1
    return pictures, bad


def test_mutated_files_are_read_or_refused() -> None:
    pictures, bad = failures(0, CASES)
    assert not bad
    assert CASES * 0.1 < pictures < CASES * 0.6, "the mutations are neither harmless nor all found by a checksum"


@pytest.mark.slow
@pytest.mark.soak
@pytest.mark.parametrize("quarter", range(4))
def test_many_mutated_files_are_read_or_refused(quarter: int) -> None:
    start = CASES + quarter * SOAK // 4
    assert not failures(start, start + SOAK // 4)[1]


def test_a_hang_or_a_crash_would_be_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "decoder_fuzz.py").write_text(
        "import os, sys, time\n"
        "for number in range(int(sys.argv[1]), int(sys.argv[2])):\n"
        "    print(number, end=' ', flush=True)\n"
        "    if number == 1: os.abort()\n"
        "    if number == 2: time.sleep(600)\n"
        "    print('refused' if number < 4 else 'picture', flush=True)\n"
    )
    monkeypatch.setitem(globals(), "HERE", tmp_path)
    monkeypatch.setitem(globals(), "PATIENCE", 3)
    pictures, bad = failures(0, 6)
    assert pictures == 2 and sorted(bad) == [1, 2]


# --- bombs: a header that promises much, a file that holds little ----------------------------------------------------


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png(width: int, height: int, data: bytes) -> bytes:
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def encoded(suffix: str, size: tuple[int, int] = (96, 64), *options: int) -> bytes:
    noise = np.random.default_rng(1).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    noise = noise.astype(np.float32) if suffix == ".hdr" else noise
    return cv2.imencode(suffix, noise, list(options))[1].tobytes()


def patched(data: bytes, old: bytes, new: bytes) -> bytes:
    assert old in data
    return data.replace(old, new, 1)


def exr(size: int) -> bytes:
    """A whole, very small EXR of one value."""
    import OpenEXR

    stream = io.BytesIO()
    plane = np.zeros((64, 96), np.float32)
    kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(kind, {"R": plane, "G": plane, "B": plane}) as file:
        file.write(stream)
    window, lie = struct.pack("<iiii", 0, 0, 95, 63), struct.pack("<iiii", 0, 0, size - 1, size - 1)
    return stream.getvalue().replace(window, lie)


SIDE = 16_000
FLAT = zlib.compress(bytes(3 * SIDE + 1) * 200, 9)  # the first rows of a black picture
BOMBS = {
    "bomb.png": png(SIDE, SIDE, FLAT),
    "bomb.jpg": patched(encoded(".jpg"), struct.pack(">HH", 64, 96), struct.pack(">HH", SIDE, SIDE)),
    "bomb.bmp": patched(encoded(".bmp"), struct.pack("<ii", 96, 64), struct.pack("<ii", SIDE, SIDE)),
    "bomb.tif": patched(
        patched(encoded(".tif"), struct.pack("<HHIHH", 256, 3, 1, 96, 0), struct.pack("<HHII", 256, 4, 1, SIDE)),
        struct.pack("<HHIHH", 257, 3, 1, 64, 0), struct.pack("<HHII", 257, 4, 1, SIDE)),
    "bomb.exr": exr(SIDE),
    "bomb.hdr": patched(encoded(".hdr"), b"-Y 64 +X 96", f"-Y {SIDE} +X {SIDE}".encode())[:5000],
}  # fmt: skip


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_by_its_header(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(BOMBS[name])
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("the decoder was asked"))
    for read in (load_picture, lambda path: read_mask(path, (SIDE, SIDE), "the reference")):
        with pytest.raises(UnreadableImage, match=f"{SIDE} × {SIDE} pixels cannot come out of {len(BOMBS[name])} byt"):
            read(path)


def test_a_webp_of_one_colour_unpacks_a_million_times(tmp_path: Path) -> None:
    path = tmp_path / "flat.webp"
    path.write_bytes(cv2.imencode(".webp", np.zeros((4000, 4000, 3), np.uint8), [cv2.IMWRITE_WEBP_QUALITY, 101])[1])
    assert path.stat().st_size < 4000 * 4000 / 10_000
    with pytest.raises(UnreadableImage, match="4000 × 4000 pixels cannot come out of"):
        load_picture(path)


def test_a_layer_more_than_memory_holds_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    import OpenEXR
    from edf_stitch.core.pictures import decoding

    plane = np.random.default_rng(1).random((64, 96), dtype=np.float32)
    kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(kind, {f"pass{number:02}.{name}": plane for number in range(9) for name in "RGB"}) as file:
        file.write(str(tmp_path / "many.exr"))
    assert load_picture(tmp_path / "many.exr").view.shape == (64, 96, 3)
    monkeypatch.setattr(decoding, "READING", replace(decoding.READING, max_exr_samples=27 * 64 * 96 - 1))
    with pytest.raises(UnreadableImage, match="render only the picture"):
        load_picture(tmp_path / "many.exr")


def test_a_mask_with_little_in_it_is_no_bomb(tmp_path: Path) -> None:
    mask = np.zeros((1500, 2000), np.uint8)
    mask[300:900, 400:1500] = 255
    path = tmp_path / "mask.png"
    path.write_bytes(cv2.imencode(".png", mask, [cv2.IMWRITE_PNG_BILEVEL, 1])[1])
    assert path.stat().st_size < mask.size / 400, "a photograph of this size would be refused"
    assert (read_mask(path, (2000, 1500), "the reference") == (mask > 0)).all()


# --- what OpenCV's PNG reader must not see ---------------------------------------------------------------------------


def test_what_stands_behind_the_end_of_a_png_is_not_read(tmp_path: Path) -> None:
    """OpenCV would ask for as much memory as the next four bytes say."""
    whole = encoded(".png")
    path = tmp_path / "a.png"
    path.write_bytes(whole + struct.pack(">I", 0x30000000) + b"tail")
    assert (load_picture(path).view == cv2.imdecode(np.frombuffer(whole, np.uint8), 1)[..., ::-1]).all()
    path.write_bytes(png(96, 64, b"").replace(chunk(b"IDAT", b""), b"") + struct.pack(">I", 0x30000000) + b"tail")
    with pytest.raises(UnreadableImage, match="it holds no picture data"):
        load_picture(path)


def test_the_first_picture_of_an_animation_is_read_alone(tmp_path: Path) -> None:
    """OpenCV's reader crashes on damaged animations."""
    image = pytest.importorskip("PIL.Image")
    noise = np.random.default_rng(1).integers(0, 256, (2, 64, 96, 3), dtype=np.uint8)
    frames = [image.fromarray(frame) for frame in noise]
    path = tmp_path / "a.png"
    frames[0].save(path, save_all=True, append_images=frames[1:])
    data = path.read_bytes()
    assert b"acTL" in data
    assert (load_picture(path).view == np.asarray(frames[0])).all()
    at = data.index(b"fdAT") + 20
    broken = bytearray(data)
    broken[at] ^= 0xFF
    length = struct.unpack_from(">I", data, data.index(b"fdAT") - 4)[0]
    body = bytes(broken[data.index(b"fdAT") : data.index(b"fdAT") + 4 + length])
    struct.pack_into(">I", broken, data.index(b"fdAT") + 4 + length, zlib.crc32(body))
    path.write_bytes(bytes(broken))
    assert (load_picture(path).view == np.asarray(frames[0])).all()
