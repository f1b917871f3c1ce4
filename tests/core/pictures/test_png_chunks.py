"""What further chunks of a PNG say: gamma, primaries, a transparent level, EXIF in a text."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.raster.colour import decode, parse_icc

SIZE = 24


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png(levels: np.ndarray, depth: int, colour_type: int, *further: bytes) -> bytes:
    """Levels (H, W, C) packed to so many bits, with further chunks before the data."""
    if depth == 16:
        rows = levels.astype(">u2").reshape(len(levels), -1).view(np.uint8)
    else:
        bits = levels.reshape(len(levels), -1, 1) >> np.arange(depth - 1, -1, -1) & 1
        rows = np.packbits(bits.reshape(len(levels), -1).astype(np.uint8), axis=1)
    data = b"".join(b"\0" + row.tobytes() for row in rows)
    head = struct.pack(">IIBBBBB", levels.shape[1], len(levels), depth, colour_type, 0, 0, 0)
    parts = [chunk(b"IHDR", head), *further, chunk(b"IDAT", zlib.compress(data)), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def load(tmp_path: Path, data: bytes) -> Picture:
    (tmp_path / "picture.png").write_bytes(data)
    return load_picture(tmp_path / "picture.png")


@pytest.mark.parametrize(("depth", "colour_type"), [(1, 0), (2, 0), (4, 0), (8, 0), (16, 0), (8, 2), (16, 2)])
def test_one_level_is_transparent(tmp_path: Path, depth: int, colour_type: int) -> None:
    channels = 3 if colour_type == 2 else 1
    levels = np.random.default_rng(depth).integers(0, 1 << depth, (SIZE, SIZE, channels))
    key = levels[3, 4]
    picture = load(tmp_path, png(levels, depth, colour_type, chunk(b"tRNS", key.astype(">u2").tobytes())))
    hidden = (levels == key).all(axis=2)
    assert picture.alpha is not None and np.array_equal(picture.alpha == 0, hidden) and hidden.any()
    assert picture.light.shape[2] == channels
    assert load(tmp_path, png(levels, depth, colour_type)).alpha is None


def test_a_palette_keeps_its_own_transparency(tmp_path: Path) -> None:
    levels = np.random.default_rng(1).integers(0, 4, (SIZE, SIZE, 1))
    palette = chunk(b"PLTE", bytes(range(12)))
    picture = load(tmp_path, png(levels, 8, 3, palette, chunk(b"tRNS", bytes([255, 0, 128]))))
    assert picture.alpha is not None
    assert np.allclose(picture.alpha, np.array([1, 0, 128 / 255, 1])[levels[..., 0]], atol=1e-6)


@pytest.mark.parametrize("gamma", [1.0, 1 / 1.8, 0.7])
@pytest.mark.parametrize("colour_type", [0, 2])
@pytest.mark.parametrize("depth", [8, 16])
def test_light_follows_the_gamma_that_is_stated(tmp_path: Path, gamma: float, colour_type: int, depth: int) -> None:
    levels = np.random.default_rng(1).integers(0, 1 << depth, (SIZE, SIZE, 3 if colour_type == 2 else 1))
    stated = chunk(b"gAMA", struct.pack(">I", round(1e5 * gamma)))
    picture = load(tmp_path, png(levels, depth, colour_type, stated))
    expected = (levels / ((1 << depth) - 1)) ** (1 / gamma)
    assert np.abs(picture.pixels - expected).max() < 2e-4
    assert not picture.warnings
    ignored = load(tmp_path, png(levels, depth, colour_type, stated, chunk(b"sRGB", b"\0")))
    assert np.array_equal(ignored.pixels, decode(levels.astype(np.uint8 if depth == 8 else np.uint16)))


def test_what_means_srgb_needs_no_profile(tmp_path: Path) -> None:
    levels = np.random.default_rng(1).integers(0, 256, (SIZE, SIZE, 3))
    places = struct.pack(">8I", 31270, 32900, 64000, 33000, 30000, 60000, 15000, 6000)
    picture = load(tmp_path, png(levels, 8, 2, chunk(b"gAMA", struct.pack(">I", 45455)), chunk(b"cHRM", places)))
    assert picture.icc is None


def test_wide_primaries_become_a_profile(tmp_path: Path) -> None:
    """Those of Adobe RGB, whose pure green lies outside of sRGB; gray stays gray."""
    levels = np.array([[[255, 255, 255], [128, 128, 128], [0, 255, 0]]])
    places = struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000)
    picture = load(tmp_path, png(levels, 8, 2, chunk(b"gAMA", struct.pack(">I", 45455)), chunk(b"cHRM", places)))
    profile = parse_icc(picture.icc or b"")
    assert profile is not None
    srgb = picture.pixels[0] @ profile.to_srgb.T
    assert np.allclose(srgb[0], 1, atol=2e-3) and np.ptp(srgb[1]) < 1e-3
    # Adobe RGB (1998), 4.3.6: green there is (-0.3985, 1, -0.0429) in linear sRGB
    assert np.allclose(srgb[2], [-0.3985, 1.0, -0.0429], atol=0.005)


@pytest.mark.parametrize("name", [b"tEXt", b"zTXt"])
@pytest.mark.parametrize("keyword", [b"Raw profile type exif", b"Raw profile type APP1"])
def test_exif_in_a_text_turns_the_picture(tmp_path: Path, name: bytes, keyword: bytes) -> None:
    block = b"Exif\0\0II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, 6, 0, 0)
    text = b"\nexif\n%8d\n" % len(block) + block.hex().encode() + b"\n"
    body = keyword + b"\0" + (text if name == b"tEXt" else b"\0" + zlib.compress(text))
    data = png(np.arange(12).reshape(3, 4, 1), 8, 0, chunk(name, body))
    assert load(tmp_path, data).light.shape[:2] == (4, 3)
    stored = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(load(tmp_path, data).view[..., 0], np.rot90(stored, -1))


def test_nonsense_in_chunks_is_left_alone(tmp_path: Path) -> None:
    levels = np.random.default_rng(1).integers(0, 256, (SIZE, SIZE, 3))
    chunks = [chunk(name, body) for name, body in (
        (b"gAMA", bytes(4)), (b"gAMA", b"\0"), (b"cHRM", bytes(32)), (b"cHRM", b"\xff" * 32), (b"tRNS", b"\1"),
        (b"tEXt", b"Raw profile type exif\0\nexif\n 9\nzz"), (b"zTXt", b"Raw profile type exif\0\0nonsense"),
    )]  # fmt: skip
    for one in chunks:
        assert load(tmp_path, png(levels, 8, 2, one)).pixels.shape == (SIZE, SIZE, 3)
