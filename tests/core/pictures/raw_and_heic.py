"""Camera RAW (DNG) and HEIC files for tests, made of arrays."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest

# Factors of the sensor's red, green and blue in white light.
NEUTRAL = (0.5, 1.0, 0.6)
# From XYZ (D65) to sRGB, IEC 61966-2-1: the sensor has sRGB's primaries.
XYZ_TO_SRGB = ((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570))
SHORT, LONG, RATIONAL, SIGNED = 3, 4, 5, 10


def mosaic(light: np.ndarray, neutral: tuple[float, float, float] = NEUTRAL) -> np.ndarray:
    """What a sensor under a red, green, green, blue filter array holds (H, W) uint16 of light (H, W, 3)."""
    cells = light * neutral
    held = np.empty(light.shape[:2])
    for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
        held[row::2, column::2] = cells[row::2, column::2, channel]
    return np.clip(np.rint(held * 65535), 0, 65535).astype(np.uint16)


def dng(
    sensor: np.ndarray, neutral: tuple[float, float, float] = NEUTRAL, seconds: tuple[int, int] | None = (1, 100),
    iso: int = 100, f_number: tuple[int, int] = (4, 1), orientation: int = 1, focal_mm: int = 24,
) -> bytes:  # fmt: skip
    """An uncompressed DNG of a sensor (H, W) uint16."""
    height, width = sensor.shape
    pixels = sensor.astype("<u2").tobytes()
    exif = [
        *([] if seconds is None else [(33434, RATIONAL, [seconds])]), (33437, RATIONAL, [f_number]),
        (34855, SHORT, [iso]), (37386, RATIONAL, [(focal_mm, 1)]),
    ]  # fmt: skip
    first = [
        (254, LONG, [0]), (256, LONG, [width]), (257, LONG, [height]), (258, SHORT, [16]), (259, SHORT, [1]),
        (262, SHORT, [32803]), (271, 2, b"Maker\0"), (272, 2, b"Model\0"), (273, LONG, [0]),
        (274, SHORT, [orientation]), (277, SHORT, [1]), (278, LONG, [height]), (279, LONG, [len(pixels)]),
        (33421, SHORT, [2, 2]), (33422, 1, b"\0\1\1\2"), (34665, LONG, [0]), (50706, 1, b"\1\4\0\0"),
        (50708, 2, b"Maker Model\0"), (50714, LONG, [0]), (50717, LONG, [65535]),
        (50721, SIGNED, [(round(value * 10_000), 10_000) for row in XYZ_TO_SRGB for value in row]),
        (50728, RATIONAL, [(round(value * 10_000), 10_000) for value in neutral]), (50778, SHORT, [21]),
    ]  # fmt: skip
    exif_at = 8 + len(_directory(first, 8))
    pixels_at = exif_at + len(_directory(exif, exif_at))
    places = {273: pixels_at, 34665: exif_at}
    placed = [(tag, kind, [places[tag]] if tag in places else values) for tag, kind, values in first]
    return b"II*\0" + struct.pack("<I", 8) + _directory(placed, 8) + _directory(exif, exif_at) + pixels


def _directory(fields: list, at: int) -> bytes:
    values_at, entries, behind = at + 2 + 12 * len(fields) + 4, struct.pack("<H", len(fields)), b""
    for tag, kind, values in fields:
        form = {SHORT: "<H", LONG: "<I", RATIONAL: "<II", SIGNED: "<iI"}.get(kind, "")
        raw = values if isinstance(values, bytes) else b"".join(
            struct.pack(form, *(value if isinstance(value, tuple) else (value,))) for value in values)  # fmt: skip
        inline = raw.ljust(4, b"\0") if len(raw) <= 4 else struct.pack("<I", values_at + len(behind))
        entries += struct.pack("<HHI", tag, kind, len(values)) + inline
        behind += raw + b"\0" * (len(raw) & 1) if len(raw) > 4 else b""
    return entries + struct.pack("<I", 0) + behind


def heic(pixels: np.ndarray, mode: str = "", **options: object) -> bytes:
    """A HEIC file of levels (H, W) or (H, W, 3 or 4), as exact as HEVC gets; skips without an encoder."""
    encoder = pytest.importorskip("pillow_heif", reason="pillow-heif, which writes HEIC files, is not installed")
    mode = mode or {(): "L", (3,): "RGB", (4,): "RGBA"}[pixels.shape[2:]]
    image = encoder.from_bytes(mode, pixels.shape[1::-1], np.ascontiguousarray(pixels).tobytes())
    stream = io.BytesIO()
    image.save(stream, **{"quality": -1, "chroma": 444, **options})
    return stream.getvalue()
