"""BMP files with the headers that OS/2 and other programs write."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.pictures.picture import load_picture

WIDTH, HEIGHT = 13, 9
NOISE = np.random.default_rng(3).integers(1, 255, (HEIGHT, WIDTH, 4), np.uint8)
MASKS = struct.pack("<4I", 0xFF0000, 0xFF00, 0xFF, 0xFF000000)


def bmp(header: int, bits: int, compression: int = 0, masks: bytes = b"", fourth: np.ndarray | None = None) -> bytes:
    if header == 12:
        head = struct.pack("<IHHHH", 12, WIDTH, HEIGHT, 1, bits)
    else:
        head = struct.pack("<IiiHHIIiiII", header, WIDTH, HEIGHT, 1, bits, compression, 0, 0, 0, 0, 0)
        head = (head + masks).ljust(max(header, 40 + len(masks)), b"\0")
    pixels = NOISE[::-1, :, [2, 1, 0, 3]].copy()
    if fourth is not None:
        pixels[..., 3] = fourth
    rows = pixels[..., : bits // 8].reshape(HEIGHT, -1)
    rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % 4)))
    at = 14 + len(head)
    return struct.pack("<2sIHHI", b"BM", at + rows.size, 0, 0, at) + head + rows.tobytes()


@pytest.mark.parametrize(("data", "transparent"), [
    (bmp(12, 24), False), (bmp(40, 24), False), (bmp(64, 24), False),
    (bmp(40, 32, fourth=np.zeros(1)), False), (bmp(40, 32, 3, MASKS[:12]), False), (bmp(52, 32, 3, MASKS[:12]), False),
    (bmp(52, 32, 3, MASKS[:12], np.zeros(1)), False), (bmp(56, 32, 3, MASKS), True), (bmp(108, 32, 3, MASKS), True),
    (bmp(124, 32, 3, MASKS[:12] + bytes(4)), False), (bmp(40, 32), False),
])  # fmt: skip
def test_size_colours_and_what_is_alpha(tmp_path: Path, data: bytes, transparent: bool) -> None:
    (tmp_path / "picture.bmp").write_bytes(data)
    picture = load_picture(tmp_path / "picture.bmp")
    assert np.array_equal(picture.view, NOISE[..., :3])
    if transparent:
        assert picture.alpha is not None and np.allclose(picture.alpha, NOISE[..., 3] / 255, atol=1e-6)
    else:
        assert picture.alpha is None


def test_a_palette_of_three_bytes_a_colour(tmp_path: Path) -> None:
    levels = np.random.default_rng(5).integers(0, 16, (HEIGHT, 16), np.uint8)
    colours = np.random.default_rng(6).integers(0, 256, (16, 3), np.uint8)
    rows = np.packbits(np.unpackbits(levels[::-1, :, None], axis=2)[..., 4:].reshape(HEIGHT, -1), axis=1)
    head = struct.pack("<IHHHH", 12, 16, HEIGHT, 1, 4) + colours[:, ::-1].tobytes()
    at = 14 + len(head)
    data = struct.pack("<2sIHHI", b"BM", at + rows.size, 0, 0, at) + head + rows.tobytes()
    (tmp_path / "picture.bmp").write_bytes(data)
    assert np.array_equal(load_picture(tmp_path / "picture.bmp").view, colours[levels])
