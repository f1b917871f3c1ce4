"""Loading pictures: every format, depth and orientation comes in the same, and everything else is refused in words."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, in_same_colour_space, load_picture, picture_from_array
from edf_stitch.core.raster.colour import decode, encode
from edf_stitch.core.system.errors import BadRequest, UnreadableImage

OpenEXR = pytest.importorskip("OpenEXR")

HEIGHT, WIDTH = 24, 36
NOISE = np.random.default_rng(7).random((HEIGHT, WIDTH, 4))
SMOOTH = np.clip(cv2.GaussianBlur(NOISE, (0, 0), 4) * 4 - 1.5, 0, 1)  # what JPEG can hold


def image(dtype: type, channels: int) -> np.ndarray:
    if dtype is np.float32:
        return (NOISE[..., :channels] * 3).astype(np.float32)
    return np.rint(NOISE[..., :channels] * np.iinfo(dtype).max).astype(dtype)


def bgr(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array[..., [2, 1, 0, 3][: array.shape[2]]] if array.shape[2] > 2 else array)


def png_chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def tiff(array: np.ndarray, big_endian: bool = False, bigtiff: bool = False, pages: int = 1, **tags: int) -> bytes:
    """An uncompressed TIFF of one strip a page; tags: orientation, extra (alpha), photometric."""
    order = ">" if big_endian else "<"
    offset, step = ("Q", 20) if bigtiff else ("I", 12)
    array = array.astype(array.dtype.newbyteorder(order))
    kinds = {"f": 3, "u": 1, "i": 2}
    entries = {
        256: ("I", array.shape[1]), 257: ("I", array.shape[0]), 258: ("H", *[array.itemsize * 8] * array.shape[2]),
        259: ("H", 1), 262: ("H", tags.get("photometric", 2 if array.shape[2] > 2 else 1)), 277: ("H", array.shape[2]),
        278: ("I", array.shape[0]), 279: ("I", array.nbytes), 339: ("H", *[kinds[array.dtype.kind]] * array.shape[2]),
    }
    if "orientation" in tags:
        entries[274] = ("H", tags["orientation"])
    if "extra" in tags and array.shape[2] in (2, 4):
        entries[338] = ("H", tags["extra"])
    start = {False: b"II", True: b"MM"}[big_endian] + struct.pack(order + "H", 43 if bigtiff else 42)
    data = start + (struct.pack(order + "HHQ", 8, 0, 16) if bigtiff else struct.pack(order + "I", 8))
    for page in range(pages):
        entries[273] = ("I", 0)
        values_at = len(data) + (8 if bigtiff else 2) + step * len(entries) + (8 if bigtiff else 4)
        pixels_at = values_at + 40
        entries[273] = ("I", pixels_at)
        body, values = struct.pack(order + ("Q" if bigtiff else "H"), len(entries)), b""
        for tag, (kind, *numbers) in sorted(entries.items()):
            raw = struct.pack(f"{order}{len(numbers)}{kind}", *numbers)
            body += struct.pack(order + "HH" + offset, tag, {"H": 3, "I": 4}[kind], len(numbers))
            if len(raw) > struct.calcsize(order + offset):
                body += struct.pack(order + offset, values_at + len(values))
                values += raw
            else:
                body += raw.ljust(struct.calcsize(order + offset), b"\0")
        following = pixels_at + array.nbytes if page < pages - 1 else 0
        data += body + struct.pack(order + offset, following) + values.ljust(40, b"\0") + array.tobytes()
    return data


def exr(channels: dict[str, np.ndarray], **header: object) -> bytes:
    stream = io.BytesIO()
    start = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(start | header, {name: np.ascontiguousarray(one) for name, one in channels.items()}).write(stream)
    return stream.getvalue()


def box(left: int, top: int, right: int, bottom: int) -> tuple[np.ndarray, np.ndarray]:
    return np.array([left, top], np.int32), np.array([right, bottom], np.int32)


def with_orientation(data: bytes, suffix: str, orientation: int) -> bytes:
    block = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    if suffix == ".jpg":
        return data[:2] + b"\xff\xe1" + struct.pack(">H", 8 + len(block)) + b"Exif\0\0" + block + data[2:]
    if suffix == ".png":
        return data[:33] + png_chunk(b"eXIf", block) + data[33:]
    size = struct.pack("<I", WIDTH - 1)[:3] + struct.pack("<I", HEIGHT - 1)[:3]
    body = b"WEBPVP8X" + struct.pack("<I", 10) + b"\x18\0\0\0" + size + data[12:]
    body += b"EXIF" + struct.pack("<I", len(block)) + block
    return b"RIFF" + struct.pack("<I", len(body)) + body


def load(tmp_path: Path, data: bytes, suffix: str) -> Picture:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(data)
    return load_picture(path)


def encoded(array: np.ndarray, suffix: str) -> bytes:
    options = {".webp": [cv2.IMWRITE_WEBP_QUALITY, 101], ".jpg": [cv2.IMWRITE_JPEG_QUALITY, 100]}.get(suffix, [])
    return tiff(array, extra=2) if suffix == ".tif" else cv2.imencode(suffix, bgr(array), options)[1].tobytes()


# How an upright picture lies in the file, and the orientation that says so (EXIF 2.3, 4.6.4): the side where the stored
# row 0 and column 0 are seen.
STORED = {
    1: lambda a: a, 2: lambda a: a[:, ::-1], 3: lambda a: a[::-1, ::-1], 4: lambda a: a[::-1],
    5: lambda a: a.swapaxes(0, 1), 6: lambda a: np.rot90(a, 1), 7: lambda a: a[::-1, ::-1].swapaxes(0, 1),
    8: lambda a: np.rot90(a, -1),
}


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize(("suffix", "dtype", "channels"), [
    (".jpg", np.uint8, 3), (".jpg", np.uint8, 1), (".png", np.uint8, 3), (".png", np.uint8, 4), (".png", np.uint16, 3),
    (".png", np.uint16, 1), (".webp", np.uint8, 3), (".webp", np.uint8, 4), (".tif", np.uint8, 1),
    (".tif", np.uint8, 3), (".tif", np.uint8, 4), (".tif", np.uint16, 1), (".tif", np.uint16, 3),
    (".tif", np.uint16, 4), (".tif", np.float32, 1), (".tif", np.float32, 3), (".tif", np.float32, 4),
])
def test_orientation_is_applied_once(
    tmp_path: Path, orientation: int, suffix: str, dtype: type, channels: int
) -> None:
    upright = image(dtype, channels) if suffix != ".jpg" else np.rint(SMOOTH[..., :channels] * 255).astype(np.uint8)
    stored = np.ascontiguousarray(STORED[orientation](upright))
    if suffix == ".tif":
        data = tiff(stored, orientation=orientation, extra=2)
    else:
        data = encoded(stored, suffix)
        data = with_orientation(data, suffix, orientation) if suffix != ".webp" or orientation < 5 else webp_turned(
            data, orientation)
    picture = load(tmp_path, data, suffix)
    plain = load(tmp_path, encoded(upright, suffix), suffix)
    assert picture.exif.orientation == orientation
    assert picture.pixels.shape == (HEIGHT, WIDTH, min(channels, 3))
    assert np.abs(picture.view.astype(int) - plain.view).max() <= (12 if suffix == ".jpg" else 0)
    if suffix != ".jpg":
        assert np.array_equal(picture.pixels, plain.pixels)
        assert (picture.alpha is None) == (channels < 4)
        assert channels < 4 or np.array_equal(picture.alpha, plain.alpha)
    assert picture.pixels.flags.c_contiguous and picture.view.flags.c_contiguous


def webp_turned(data: bytes, orientation: int) -> bytes:
    turned = with_orientation(data, ".webp", orientation)
    return turned[:24] + turned[27:30] + turned[24:27] + turned[30:]  # width and height change places in the header


def test_orientation_of_bigtiff_and_big_endian(tmp_path: Path) -> None:
    upright = image(np.uint16, 3)
    for options in ({"bigtiff": True}, {"big_endian": True}):
        picture = load(tmp_path, tiff(np.rot90(upright), orientation=6, **options), ".tif")
        assert np.array_equal(picture.pixels, decode(upright))


def test_focal_plane_turns_with_the_picture(tmp_path: Path) -> None:
    # Exif directory with ExifImageWidth 4000, ExifImageHeight 3000
    block = b"II*\0" + struct.pack("<IH" + "HHII" * 2 + "I", 8, 2, 274, 3, 1, 6, 34665, 4, 1, 38, 0)
    block += struct.pack("<H" + "HHII" * 2 + "I", 2, 40962, 4, 1, 4000, 40963, 4, 1, 3000, 0)
    plain = cv2.imencode(".jpg", np.zeros((8, 8), np.uint8))[1].tobytes()
    data = plain[:2] + b"\xff\xe1" + struct.pack(">H", 8 + len(block)) + b"Exif\0\0" + block + plain[2:]
    exif = load(tmp_path, data, ".jpg").exif
    assert (exif.orientation, exif.width, exif.height) == (6, 3000, 4000)


@pytest.mark.parametrize(("suffix", "dtype"), [
    (".png", np.uint8), (".png", np.uint16), (".tif", np.uint8), (".tif", np.uint16), (".tif", np.float32),
    (".webp", np.uint8), (".bmp", np.uint8), (".exr", np.float32)])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_every_format_and_depth_gives_its_light(tmp_path: Path, suffix: str, dtype: type, channels: int) -> None:
    if (suffix, channels) in ((".webp", 1), (".bmp", 4)):
        pytest.skip("the format does not hold that")
    array = image(dtype, channels)
    if channels == 4:  # values in range and alpha of all kinds
        array[..., 3] = NOISE[..., 3] * (1 if dtype is np.float32 else np.iinfo(dtype).max)
    if suffix == ".exr":
        stored = array[..., :3] * array[..., 3:] if channels == 4 else array
        names = "Y" if channels == 1 else "RGBA"
        data = exr({name: (stored if name != "A" else array)[..., index]
                    for index, name in enumerate(names[:channels])})
    else:
        data = encoded(array, suffix)
    picture = load(tmp_path, data, suffix)
    colour = array[..., : min(channels, 3)]
    light = colour if dtype is np.float32 else decode(colour)
    assert picture.bits == np.dtype(dtype).itemsize * 8
    assert picture.pixels.dtype == np.float32 and picture.view.dtype == np.uint8
    if channels == 4:
        full = 1 if dtype is np.float32 else np.iinfo(dtype).max
        assert picture.alpha is not None and picture.alpha.dtype == np.float32
        assert np.allclose(picture.alpha, array[..., 3] / full, atol=1e-6)
        seen = picture.alpha > 0  # WebP clears what is not seen
        assert np.allclose(picture.pixels[seen], light[seen], rtol=1e-5, atol=1e-6)
    else:
        assert picture.alpha is None
        assert np.array_equal(picture.pixels, light)
        if dtype is np.uint8:
            assert np.array_equal(picture.view, array)
        if dtype is np.uint16:
            assert np.array_equal(picture.view, np.rint(array / 257).astype(np.uint8))


def test_odd_png_kinds(tmp_path: Path) -> None:
    def png(colour_type: int, rows: bytes, extra: bytes = b"") -> bytes:
        header = struct.pack(">IIBBBBB", 2, 1, 8, colour_type, 0, 0, 0)
        return (b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + extra + png_chunk(b"IDAT", zlib.compress(rows))
                + png_chunk(b"IEND", b""))

    gray_alpha = load(tmp_path, png(4, bytes([0, 100, 51, 200, 255])), ".png")
    assert gray_alpha.view.tolist() == [[[100], [200]]] and gray_alpha.alpha is not None
    assert np.allclose(gray_alpha.alpha, [[0.2, 1]])
    opaque = load(tmp_path, png(4, bytes([0, 100, 255, 200, 255])), ".png")
    assert opaque.alpha is None and opaque.pixels.shape == (1, 2, 1)
    palette = png_chunk(b"PLTE", bytes([10, 20, 30, 40, 50, 60])) + png_chunk(b"tRNS", bytes([51]))
    coloured = load(tmp_path, png(3, bytes([0, 0, 1]), palette), ".png")
    assert coloured.view.tolist() == [[[10, 20, 30], [40, 50, 60]]] and coloured.alpha is not None
    assert np.allclose(coloured.alpha, [[0.2, 1]])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_alpha_of_a_tiff(tmp_path: Path, dtype: type) -> None:
    full = np.iinfo(dtype).max
    straight = image(dtype, 4)
    straight[0, 0, 3] = 0
    for tags in ({"extra": 2}, {}):  # straight, not said
        picture = load(tmp_path, tiff(straight, **tags), ".tif")
        assert np.array_equal(picture.pixels, decode(straight[..., :3]))
        assert picture.alpha is not None and np.allclose(picture.alpha, straight[..., 3] / full, atol=1e-6)
    multiplied = straight.copy()
    multiplied[..., :3] = np.rint(straight[..., :3] * (straight[..., 3:] / full))
    picture = load(tmp_path, tiff(multiplied, extra=1), ".tif")
    solid = straight[..., 3] > full // 2
    assert np.abs(picture.pixels - decode(straight[..., :3]))[solid].max() < 0.02
    assert (picture.pixels[0, 0] == 0).all()


def test_other_tiff_kinds(tmp_path: Path) -> None:
    array = image(np.uint16, 1)
    for dtype in (np.uint8, np.uint16):
        negative = load(tmp_path, tiff(np.iinfo(dtype).max - array.astype(dtype), photometric=0), ".tif")
        assert np.array_equal(negative.pixels, decode(array.astype(dtype)))
    pages = load(tmp_path, tiff(array, pages=3), ".tif")
    assert np.array_equal(pages.pixels, decode(array))
    assert "3 pages" in pages.warnings[0]
    assert load(tmp_path, tiff(array), ".tif").warnings == ()
    double = load(tmp_path, tiff(NOISE[..., :3]), ".tif")
    assert double.bits == 32 and np.array_equal(double.pixels, NOISE[..., :3].astype(np.float32))
    with pytest.raises(UnreadableImage, match="int16 samples"):
        load(tmp_path, tiff(array.astype(np.int16)), ".tif")


def test_exr_layers(tmp_path: Path) -> None:
    a, b = image(np.float32, 3), image(np.float32, 4)[..., 1:]

    def layer(name: str, pixels: np.ndarray) -> dict[str, np.ndarray]:
        return {f"{name}.{component}": pixels[..., index] for index, component in enumerate("RGB")}

    depth = {"ViewLayer.Depth.Z": a[..., 0], **{f"ViewLayer.Normal.{one}": a[..., 0] for one in "XYZ"}}
    render = load(tmp_path, exr({**layer("ViewLayer.Combined", a), **layer("ViewLayer.DiffCol", b), **depth}), ".exr")
    assert np.array_equal(render.pixels, a) and render.warnings == ()
    both = load(tmp_path, exr({**layer("Aux.Combined", a), **layer("Composite.Combined", b)}), ".exr")
    assert np.array_equal(both.pixels, b), "what the compositor made comes first"
    two = load(tmp_path, exr({**layer("A.Combined", a), **layer("B.Combined", b)}), ".exr")
    assert np.array_equal(two.pixels, a) and "'A.Combined' was taken, not 'B.Combined'" in two.warnings[0]
    other = load(tmp_path, exr({**layer("V.DiffCol", a), **layer("V.GlossCol", b)}), ".exr")
    assert "no combined picture" in other.warnings[0]
    with pytest.raises(UnreadableImage, match="no layer with the channels R, G, B or Y"):
        load(tmp_path, exr(depth), ".exr")
    with pytest.raises(UnreadableImage, match="no layer with the channels"):
        load(tmp_path, exr({"R": a[..., 0], "G": a[..., 1]}), ".exr")


def test_exr_of_several_parts(tmp_path: Path) -> None:
    a = image(np.float32, 3)
    start = {"type": OpenEXR.scanlineimage}
    parts = [
        OpenEXR.Part({**start, "name": "ViewLayer.Depth"}, {"Z": a[..., 0].copy()}),
        OpenEXR.Part({**start, "name": "ViewLayer.DiffCol"}, {name: a[..., 2].copy() for name in "RGB"}),
        OpenEXR.Part({**start, "name": "ViewLayer.Combined"}, {name: a[..., i].copy() for i, name in enumerate("RGB")}),
    ]
    stream = io.BytesIO()
    OpenEXR.File(parts).write(stream)
    assert np.array_equal(load(tmp_path, stream.getvalue(), ".exr").pixels, a)


def test_exr_windows_and_half(tmp_path: Path) -> None:
    half = image(np.float32, 3).astype(np.float16)
    channels = {name: half[..., index] for index, name in enumerate("RGB")}
    inside = load(tmp_path, exr(channels, dataWindow=box(5, 3, 4 + WIDTH, 2 + HEIGHT), displayWindow=box(0, 0, 59, 49)),
                  ".exr")
    assert inside.pixels.shape == (50, 60, 3) and inside.alpha is not None
    assert np.array_equal(inside.pixels[3 : 3 + HEIGHT, 5 : 5 + WIDTH], half.astype(np.float32))
    assert inside.alpha.sum() == WIDTH * HEIGHT == inside.alpha[3 : 3 + HEIGHT, 5 : 5 + WIDTH].sum()
    # overscan: more was rendered than the frame shows, and the frame does not start at 0
    window = box(-2, -3, WIDTH - 3, HEIGHT - 4)
    crop = load(tmp_path, exr(channels, dataWindow=window, displayWindow=box(1, 0, 10, 7)), ".exr")
    assert np.array_equal(crop.pixels, half[3:11, 3:13].astype(np.float32)) and crop.alpha is None
    window = box(100, 100, 99 + WIDTH, 99 + HEIGHT)
    apart = load(tmp_path, exr(channels, dataWindow=window, displayWindow=box(0, 0, 9, 9)), ".exr")
    assert apart.alpha is not None and not apart.alpha.any()


def test_nan_that_signals_is_read_without_a_word(tmp_path: Path) -> None:
    """As flipped bits make it: arithmetic with it warns, which pytest makes an error of."""
    colour = {name: np.full((40, 60), 0.5, np.float32) for name in "RGB"}
    alpha = np.ones((40, 60), np.float32)
    alpha.view(np.uint32)[3, 4] = 0x7F800001
    path = tmp_path / "a.exr"
    path.write_bytes(exr({**colour, "A": alpha}))
    picture = load_picture(path)
    assert picture.alpha is not None and picture.alpha[3, 4] == 0 and picture.alpha.sum() == 40 * 60 - 1


@pytest.mark.parametrize("suffix", [".exr", ".tif"])
def test_pixels_that_are_no_numbers(tmp_path: Path, suffix: str) -> None:
    array = image(np.float32, 3)
    array[0, :9, 1] = np.nan
    array[1, :9, 2] = np.inf

    def data() -> bytes:
        return tiff(array) if suffix == ".tif" else exr({name: array[..., i] for i, name in enumerate("RGB")})

    picture = load(tmp_path, data(), suffix)
    assert picture.alpha is not None and picture.alpha.sum() == HEIGHT * WIDTH - 18
    assert np.isfinite(picture.pixels).all() and not picture.pixels[:2, :9].any() and not picture.alpha[:2, :9].any()
    assert f"{18 / (HEIGHT * WIDTH):.2%} of the pixels are not finite" in picture.warnings[0]
    array[: HEIGHT // 2 + 1] = -np.inf
    with pytest.raises(UnreadableImage, match="not finite numbers"):
        load(tmp_path, data(), suffix)


def test_light_that_the_blend_cannot_go_beyond_is_made_less(tmp_path: Path) -> None:
    array = image(np.float32, 3)
    array[0, 0], array[0, 1], array[0, 2] = 3.4e38, -3.4e38, np.nan
    picture = load(tmp_path, exr({name: array[..., i] for i, name in enumerate("RGB")}), ".exr")
    assert picture.alpha is not None and picture.alpha.sum() == HEIGHT * WIDTH - 1
    assert (picture.pixels[0, 0] == np.float32(1e31)).all() and (picture.pixels[0, 1] == np.float32(-1e31)).all()
    assert np.array_equal(picture.pixels[1:], array[1:])


def test_a_float_view_shows_dark_and_bright_pictures_alike() -> None:
    light = SMOOTH[..., :3].astype(np.float32) + 0.01
    views = [picture_from_array(light * np.float32(factor)).view.astype(int) for factor in (1, 1e-6, 5e4, 1e30)]
    assert all(np.abs(view - views[0]).max() <= 1 for view in views)
    assert 60 < np.median(views[0]) < 200
    # linear up to the encoding: the sun in a corner does not swallow the scene, and nothing is bent
    sun = light.copy()
    sun[:2, :3] = 1e5
    assert picture_from_array(sun).view[5:].std() > 0.5 * views[0][5:].std()
    ratio = decode(views[0].astype(np.uint8))[5:15] / light[5:15]
    assert ratio.std() / ratio.mean() < 0.1
    for empty in (np.zeros((4, 4)), np.full((4, 4), 1e-44, np.float32), np.full((4, 4), 3e38, np.float32)):
        assert picture_from_array(empty).view.shape == (4, 4, 1)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64, ">u2", ">f4"])
@pytest.mark.parametrize("channels", [None, 1, 2, 3, 4])
def test_arrays(dtype: object, channels: int | None) -> None:
    kind = np.dtype(dtype)  # type: ignore[call-overload]
    native = np.float32 if kind.kind == "f" else kind.newbyteorder("=").type
    array = image(native, channels or 1).astype(kind)
    picture = picture_from_array(array if channels else array[..., 0], "Render")
    colours = 3 if (channels or 1) > 2 else 1
    colour = array[..., :colours].astype(native)
    assert np.array_equal(picture.pixels, colour if kind.kind == "f" else decode(colour))
    assert (picture.alpha is not None) == (channels in (2, 4))
    assert picture.bits == (32 if kind.kind == "f" else kind.itemsize * 8)
    assert (picture.name, picture.exif, picture.icc) == ("Render", Exif(), None)
    before = picture.view.copy()
    array[:] = 0
    assert np.array_equal(picture.view, before), "the picture does not hang on the caller's array"


@pytest.mark.parametrize("array", [
    [[1]], np.zeros((4, 4), bool), np.zeros((4, 4), np.int32), np.zeros((4, 4, 5)), np.zeros(4), np.zeros((0, 4, 3)),
    np.zeros((1, 4, 4, 3)), np.zeros((4, 4), complex), np.full((4, 4), np.nan)])
def test_other_arrays_are_a_bad_call(array: object) -> None:
    with pytest.raises(BadRequest, match="^mine: "):
        picture_from_array(array, "mine")  # type: ignore[arg-type]


def test_pair_of_gray_and_colour_and_of_two_exposures() -> None:
    gray, colour = picture_from_array(image(np.uint8, 1)), picture_from_array(image(np.uint8, 3))
    a, b = in_same_colour_space((gray, colour))
    assert b is colour and a.pixels.shape == a.view.shape == colour.pixels.shape
    assert np.array_equal(a.pixels[..., 0], gray.pixels[..., 0]) and np.array_equal(a.view[..., 2], gray.view[..., 0])
    light = SMOOTH[..., :3].astype(np.float32)
    dim, bright = picture_from_array(light), picture_from_array(light * 2)
    a, b = in_same_colour_space((dim, bright))
    assert np.abs(dim.view.astype(int) - bright.view).max() <= 1
    assert np.array_equal(a.pixels, dim.pixels)
    seen = (b.view < 250) & (a.view > 60)
    assert np.allclose(decode(b.view)[seen] / decode(a.view)[seen], 2, rtol=0.05), "twice the light shows"
    far = in_same_colour_space((dim, picture_from_array(light * 1000)))
    assert np.abs(far[0].view.astype(int) - far[1].view).max() <= 1, "both can be seen"


def test_encoding_is_what_decoding_undoes() -> None:
    """The view of an 8-bit picture and the encoding of its light are the same bytes."""
    picture = picture_from_array(image(np.uint8, 3))
    assert np.array_equal(encode(picture.pixels, 8), picture.view)
