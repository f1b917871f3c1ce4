"""TIFF files of every kind: depths, orders of bytes, planes, tiles, codecs, predictors, further channels."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.pictures.tiff import read_tiff
from edf_stitch.core.system.errors import UnreadableImage

tifffile = pytest.importorskip("tifffile")
WIDTH, HEIGHT = 53, 37
FLOAT = 3


def scene(dtype: type, channels: int = 3) -> np.ndarray:
    noise = np.random.default_rng(4).random((HEIGHT, WIDTH, channels))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3).reshape(noise.shape)
    smooth = (smooth - smooth.min()) / np.ptp(smooth)
    return (smooth * (1 if np.dtype(dtype).kind == "f" else np.iinfo(dtype).max)).astype(dtype)


def written(array: np.ndarray, **options: object) -> bytes:
    how = {name: options.pop(name) for name in ("byteorder", "bigtiff") if name in options}
    stream = io.BytesIO()
    with tifffile.TiffWriter(stream, **how) as file:
        file.write(array, **{"photometric": "rgb", "metadata": None} | options)
    return stream.getvalue()


def by_hand(strips: list[bytes], bits: list[int], samples: int, rows: int, **tags: object) -> bytes:
    """A little-endian TIFF of these strips; tags: numbers as t317=2, or lists."""
    values = {256: [WIDTH], 257: [HEIGHT], 258: bits, 259: [1], 262: [2 if samples >= 3 else 1],
              277: [samples], 278: [rows], 279: [len(strip) for strip in strips]}  # fmt: skip
    for name, value in tags.items():
        values[int(name[1:])] = value if isinstance(value, list) else [value]
    size = 8 + sum(map(len, strips))
    values[273] = [8 + sum(map(len, strips[:number])) for number in range(len(strips))]
    body, far, far_at = struct.pack("<H", len(values)), b"", size + 2 + 12 * len(values) + 4
    for tag, numbers in sorted(values.items()):
        raw = struct.pack(f"<{len(numbers)}I", *numbers)
        body += struct.pack("<HHI", tag, 4, len(numbers))
        body += raw if len(raw) == 4 else struct.pack("<I", far_at + len(far))
        far += raw if len(raw) > 4 else b""
    return b"II*\0" + struct.pack("<I", size) + b"".join(strips) + body + struct.pack("<I", 0) + far


def packed(array: np.ndarray, bits: int) -> bytes:
    """Rows of samples of so many bits, each from a whole byte on."""
    flat = array.reshape(len(array), -1, 1) >> np.arange(bits - 1, -1, -1) & 1
    return np.packbits(flat.reshape(len(array), -1).astype(np.uint8), axis=1).tobytes()


def raw(data: bytes) -> np.ndarray:
    found = read_tiff(data)
    assert found is not None
    return found.raw


def load(tmp_path: Path, data: bytes) -> Picture:
    (tmp_path / "picture.tif").write_bytes(data)
    return load_picture(tmp_path / "picture.tif")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("options", [
    {}, {"planarconfig": "separate"}, {"byteorder": ">"}, {"byteorder": ">", "bigtiff": True}, {"tile": (16, 16)},
    {"tile": (16, 32), "planarconfig": "separate", "compression": "zlib"}, {"compression": "zlib", "rowsperstrip": 5},
], ids=str)  # fmt: skip
def test_every_depth_order_plane_and_tile(dtype: type, options: dict[str, object]) -> None:
    array = scene(dtype)
    stored = np.moveaxis(array, 2, 0) if "planarconfig" in options else array
    expected = array.astype(np.float32) if np.dtype(dtype).kind == "f" else array
    assert np.array_equal(raw(written(stored, **options)), expected)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("rows", [1, 4, 5, HEIGHT])
def test_strips_of_lzw_by_another_program(channels: int, dtype: type, rows: int) -> None:
    """Rows of an odd and of an even number of bytes, in strips of an odd and of an even number of rows."""
    array = scene(dtype, channels)
    options = [cv2.IMWRITE_TIFF_COMPRESSION, 5, cv2.IMWRITE_TIFF_ROWSPERSTRIP, rows]
    bgr = array if channels == 1 else array[..., [2, 1, 0, 3][:channels]]
    assert np.array_equal(raw(cv2.imencode(".tif", bgr, options)[1].tobytes()), array)


@pytest.mark.parametrize("bits", [1, 2, 4, 6, 10, 12, 14])
@pytest.mark.parametrize("predictor", [1, 2])
def test_samples_of_odd_bits_fill_their_range(bits: int, predictor: int) -> None:
    levels = scene(np.uint16, 3) >> (16 - bits)
    most = (1 << bits) - 1
    stored = levels.copy()
    if predictor == 2:
        stored[:, 1:] = (levels[:, 1:].astype(int) - levels[:, :-1]) & most
    strips = [zlib.compress(packed(stored[top : top + 10], bits)) for top in range(0, HEIGHT, 10)]
    found = raw(by_hand(strips, [bits] * 3, 3, 10, t259=8, t317=predictor))
    full = 255 if bits <= 8 else 65535
    assert found.dtype == (np.uint8 if bits <= 8 else np.uint16)
    assert np.array_equal(found, np.rint(levels * (full / most)).astype(found.dtype))


def test_differences_of_float_bytes_and_of_wide_samples() -> None:
    """Predictor 3 of floats, whose bytes are sorted by weight; 2 of 16 bits and of floats."""
    for kind in ("<f4", "<f2"):
        array = scene(np.float32).astype(kind)
        size = array.itemsize
        sorted_bytes = array.astype(kind.replace("<", ">")).view(np.uint8).reshape(HEIGHT, -1, size).transpose(0, 2, 1)
        flat = sorted_bytes.reshape(HEIGHT, -1, 3)
        flat = np.concatenate([flat[:, :1], np.diff(flat, axis=1)], axis=1)
        data = by_hand([zlib.compress(flat.tobytes())], [8 * size] * 3, 3, HEIGHT, t259=8, t317=3, t339=[FLOAT] * 3)
        assert np.array_equal(raw(data), array.astype(np.float32))
    array = scene(np.uint16)
    different = np.concatenate([array[:, :1], np.diff(array, axis=1)], axis=1)
    data = by_hand([zlib.compress(different.tobytes())], [16] * 3, 3, HEIGHT, t259=8, t317=2)
    assert np.array_equal(raw(data), array)


def test_bits_from_the_lowest_on_and_packed_runs() -> None:
    levels = scene(np.uint8, 1) >> 7
    backwards = bytes(int(f"{byte:08b}"[::-1], 2) for byte in packed(levels, 1))
    assert np.array_equal(raw(by_hand([backwards], [1], 1, HEIGHT, t266=2)), levels * 255)
    array = np.zeros((HEIGHT, WIDTH, 1), np.uint8)
    array[:, :7, 0] = np.arange(7)
    row = bytes([6, *range(7), 257 - (WIDTH - 7), 0, 128])
    assert np.array_equal(raw(by_hand([row * HEIGHT], [8], 1, HEIGHT, t259=32773)), array)


def test_palette_and_inks() -> None:
    numbers = scene(np.uint8, 1) >> 4
    colours = np.random.default_rng(1).integers(0, 65536, (3, 16))
    data = by_hand([packed(numbers, 4)], [4], 1, HEIGHT, t262=3, t320=colours.ravel().tolist())
    assert np.array_equal(raw(data), (colours.T >> 8).astype(np.uint8)[numbers[..., 0]])
    ink = scene(np.uint16, 4)
    light = (65535 - ink[..., :3].astype(float)) * (65535 - ink[..., 3:].astype(float)) / 65535
    found = raw(by_hand([ink.tobytes()], [16] * 4, 4, HEIGHT, t262=5))
    assert np.abs(found - light).max() <= 1


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize(("channels", "extras", "alpha"), [
    (4, [0], None), (4, [2], 3), (4, [1], 3), (5, [2, 0], 3), (5, [0, 2], 4), (5, [0, 0], None), (2, [2], 1),
    (2, [0], None), (4, [], 3),
])  # fmt: skip
def test_only_what_is_called_transparent_is(
    tmp_path: Path, dtype: type, channels: int, extras: list[int], alpha: int | None
) -> None:
    array = scene(dtype, channels)
    kind = [FLOAT if dtype is np.float32 else 1] * channels
    bits = [8 * array.itemsize] * channels
    for planar in (1, 2):
        strips = [array.tobytes()] if planar == 1 else [array[..., one].tobytes() for one in range(channels)]
        further = {"t338": extras} if extras else {}
        data = by_hand(strips, bits, channels, HEIGHT, t284=planar, t339=kind, **further)
        found, colours = read_tiff(data), 3 if channels > 2 else 1
        assert found is not None and found.associated == (extras == [1])
        expected = array[..., [*range(colours), *([] if alpha is None else [alpha])]]
        assert np.array_equal(found.raw, expected)
        picture = load(tmp_path, data)
        assert (picture.alpha is None) == (alpha is None)
        unused = channels - colours - (alpha is not None)
        assert any("left out" in warning for warning in picture.warnings) == (unused > 0)


def test_a_jpeg_inside_is_read_in_its_colours() -> None:
    pillow = pytest.importorskip("PIL.Image")
    array = scene(np.uint8)
    for mode, channels in (("RGB", 3), ("L", 1), ("YCbCr", 3)):
        image = pillow.fromarray(array if channels == 3 else array[..., 0]).convert(mode)
        stream = io.BytesIO()
        image.save(stream, "tiff", compression="jpeg", quality=95)
        expected = array if channels == 3 else array[..., :1]
        assert np.abs(raw(stream.getvalue()).astype(int) - expected).mean() < 4, mode


def damaged(data: bytes, share: float = 0.5, length: int = 40) -> bytes:
    """The data in the middle of the longest strip overwritten."""
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        page = file.pages[0]
        offset, count = max(zip(page.dataoffsets, page.databytecounts, strict=True), key=lambda one: one[1])
    at = offset + int(share * count)
    noise = np.random.default_rng(2).integers(0, 256, length, np.uint8).tobytes()
    return data[:at] + noise + data[at + length :]


@pytest.mark.parametrize(("dtype", "compression"), [
    (np.uint8, 5), (np.uint16, 5), (np.uint8, 8), (np.uint16, 8), (np.uint8, 7),
])  # fmt: skip
def test_damage_inside_the_data_is_found_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], dtype: type, compression: int
) -> None:
    if compression == 7:
        pillow = pytest.importorskip("PIL.Image")
        stream = io.BytesIO()
        pillow.fromarray(scene(dtype)).save(stream, "tiff", compression="jpeg", quality=95)
        data = stream.getvalue()
    else:
        data = cv2.imencode(".tif", scene(dtype), [cv2.IMWRITE_TIFF_COMPRESSION, compression])[1].tobytes()
    load(tmp_path, data)
    with pytest.raises(UnreadableImage, match="damaged"):
        load(tmp_path, damaged(data))
    assert capfd.readouterr() == ("", "")


def test_data_that_end_too_soon_are_damage() -> None:
    array = scene(np.uint8)
    for strips, tags in (
        ([array.tobytes()[:-3]], {}), ([zlib.compress(array.tobytes()[:-3])], {"t259": 8}),
        ([zlib.compress(array.tobytes())[:-60]], {"t259": 8}), ([b"\x81\0" * 9], {"t259": 32773}),
        ([array[:10].tobytes()], {"t278": 10}),
    ):
        with pytest.raises(UnreadableImage, match="damaged"):
            raw(by_hand(strips, [8] * 3, 3, HEIGHT, **tags))


@pytest.mark.parametrize(("photometric", "name"), [(8, "CIELab"), (9, "ICCLab"), (10, "ITULab")])
def test_colours_that_are_not_read_are_named(photometric: int, name: str) -> None:
    """libtiff makes a yellowish picture of CIELab, whose white is another one."""
    data = by_hand([scene(np.uint8).tobytes()], [8] * 3, 3, HEIGHT, t262=photometric)
    with pytest.raises(UnreadableImage, match=f"holds {name} colours, which are not read; save it as RGB"):
        read_tiff(data)


@pytest.mark.parametrize(("compression", "name"), [
    (50002, "JPEG XL"), (50001, "WebP"), (50000, "Zstandard"), (34712, "JPEG 2000"), (34887, "LERC"), (34925, "LZMA"),
    (6, "JPEG of the old kind"),
])  # fmt: skip
def test_codecs_that_are_not_read_are_named(compression: int, name: str) -> None:
    data = by_hand([scene(np.uint8).tobytes()], [8] * 3, 3, HEIGHT, t259=compression)
    with pytest.raises(UnreadableImage, match=f"compressed as {name}, which is not read; save it with"):
        read_tiff(data)


@pytest.mark.parametrize(("bits", "kind", "samples", "words"), [
    (32, 1, 3, "32-bit integer"), (16, 2, 3, "int16"), (64, 6, 3, "complex"), (24, FLOAT, 3, "24-bit float"),
    (8, 1, 200, "200 channels"),
])  # fmt: skip
def test_numbers_that_are_not_read_are_named(bits: int, kind: int, samples: int, words: str) -> None:
    data = by_hand([bytes(100)], [bits] * samples, samples, HEIGHT, t339=[kind] * samples)
    with pytest.raises(UnreadableImage, match=words):
        read_tiff(data)


def test_numbers_without_a_kind_are_taken_for_whole_ones() -> None:
    array = scene(np.uint16)
    assert np.array_equal(raw(by_hand([array.tobytes()], [16] * 3, 3, HEIGHT, t339=[4] * 3)), array)
