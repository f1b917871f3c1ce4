"""PNG files: what other readers get out of them, in one strip or many; the same bytes with any number of threads."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.containers import read_structure
from edf_stitch.core.pictures.png import adler_of_both, encode_png
from edf_stitch.core.raster import arrays
from hypothesis import given
from hypothesis import strategies as st


@pytest.fixture
def small_strips(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(arrays, "PARTS", replace(arrays.PARTS, strip_pixels=400))  # ten lines
    yield


def picture(channels: int, bits: int) -> np.ndarray:
    """(57, 40, C) of what packs well, and of noise."""
    random = np.random.default_rng(channels + bits)
    levels = random.integers(0, 2**bits, (57, 40, channels)).astype(np.uint8 if bits == 8 else np.uint16)
    levels[20:40] = 7
    return levels


def read(data: bytes) -> np.ndarray:
    """By OpenCV, in R, G, B, A order."""
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if found.ndim == 2:
        return found[..., None]
    return cv2.cvtColor(found, cv2.COLOR_BGR2RGB if found.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.usefixtures("small_strips")
def test_every_level_comes_back(channels: int, bits: int) -> None:
    levels = picture(channels, bits)
    data = b"".join(encode_png(levels.shape, bits, lambda rows: levels[rows]))
    structure = read_structure(data)
    assert structure is not None and structure.kind == "png" and not structure.damage
    assert (structure.width, structure.height) == (40, 57)
    back = read(data)
    assert back.dtype == levels.dtype and np.array_equal(back, levels)


@pytest.mark.usefixtures("small_strips")
def test_the_zlib_stream_of_all_strips_is_one_and_its_checksum_right() -> None:
    levels = picture(3, 8)
    data = b"".join(encode_png(levels.shape, 8, lambda rows: levels[rows]))
    parts, at = [], 8
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        if data[at + 4 : at + 8] == b"IDAT":
            parts.append(data[at + 8 : at + 8 + length])
        at += 12 + length
    assert len(parts) > 3
    unpacker = zlib.decompressobj()  # which checks the checksum, where OpenCV does not mind it
    lines = unpacker.decompress(b"".join(parts)) + unpacker.flush()
    assert unpacker.eof and not unpacker.unused_data
    assert len(lines) == 57 * (1 + 40 * 3)


@pytest.mark.usefixtures("small_strips")
def test_the_same_bytes_with_any_number_of_threads() -> None:
    levels = picture(4, 16)
    before, found = cv2.getNumThreads(), set()
    try:
        for threads in (1, 2, 3):
            cv2.setNumThreads(threads)
            found.add(b"".join(encode_png(levels.shape, 16, lambda rows: levels[rows])))
    finally:
        cv2.setNumThreads(before)
    assert len(found) == 1


@given(st.binary(max_size=300), st.binary(max_size=300))
def test_checksums_of_two_texts_make_that_of_both(first: bytes, second: bytes) -> None:
    both = adler_of_both(zlib.adler32(first), zlib.adler32(second), len(second))
    assert both == zlib.adler32(first + second)


def test_checksums_of_long_texts_too() -> None:
    first, second = b"\xff" * 400_000, bytes(range(256)) * 3000
    assert adler_of_both(zlib.adler32(first), zlib.adler32(second), len(second)) == zlib.adler32(first + second)
