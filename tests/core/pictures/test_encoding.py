"""Pictures go out: the same light comes back, in the right depth, with its profile and EXIF."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.containers import read_structure
from edf_stitch.core.pictures.encoding import encode_picture, output_bits, save_picture
from edf_stitch.core.pictures.exr import ExrForm
from edf_stitch.core.pictures.gpano import SpherePart
from edf_stitch.core.pictures.metadata import Exif, embed
from edf_stitch.core.pictures.picture import Picture, in_same_colour_space, load_picture, picture_from_array
from edf_stitch.core.raster.colour import decode, parse_icc
from edf_stitch.core.system.errors import BadRequest, UnwritableOutput

OpenEXR = pytest.importorskip("OpenEXR")

NOISE = np.random.default_rng(11).random((30, 44, 4)).astype(np.float32)
NOISE[:5, :, 3], NOISE[5:9, :, 3] = 1, 0
EXIF = Exif(orientation=6, make="Ann's", model="X", kept=(
    (271, "Ann's"), (272, "X"), (315, "Ann"), (33432, "© Ann"), (33434, (1, 60)), (36867, "2020:01:02 03:04:05")))
SRGB = ((0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410))
DISPLAY_P3 = ((0.51512, 0.24120, -0.00105), (0.29198, 0.69225, 0.04189), (0.15710, 0.06657, 0.78407))


def icc(space: bytes = b"RGB ", primaries=DISPLAY_P3, gamma: float | tuple = 2.2, pcs: bytes = b"XYZ ") -> bytes:
    """A gamma profile; primaries: XYZ relative to D50, one row a primary; gamma: of all channels or of each."""
    curves = [b"curv\0\0\0\0" + struct.pack(">IHxx", 1, round(one * 256))
              for one in (gamma if isinstance(gamma, tuple) else (gamma,) * 3)]
    tags = {b"kTRC": curves[0]} if space == b"GRAY" else {
        **{name: b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(one * 65536) for one in xyz))
           for name, xyz in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)},
        **dict(zip((b"rTRC", b"gTRC", b"bTRC"), curves, strict=True))}
    table, body = struct.pack(">I", len(tags)), b""
    for name, value in tags.items():
        table += struct.pack(">4sII", name, 132 + 12 * len(tags) + len(body), len(value))
        body += value
    header = struct.pack(">12x4s4s4s12x4s", b"mntr", space, pcs, b"acsp").ljust(128, b"\0")
    return header + table + body


def written(tmp_path: Path, data: bytes, suffix: str) -> Picture:
    path = tmp_path / f"out{suffix}"
    path.write_bytes(data)
    return load_picture(path)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("with_alpha", [False, True])
@pytest.mark.parametrize(("suffix", "bits", "step"), [
    (".png", 8, 1 / 255), (".PNG", 16, 1 / 65535), (".tif", 8, 1 / 255), (".tiff", 16, 1 / 65535), (".exr", 16, 1e-6)])
def test_light_comes_back(
    tmp_path: Path, suffix: str, bits: int, step: float, with_alpha: bool, channels: int
) -> None:
    pixels, alpha = NOISE[..., :channels], NOISE[..., 3] if with_alpha else None
    data, warnings = encode_picture(pixels, alpha, bits, suffix)
    assert warnings == ()
    back = written(tmp_path, data, suffix)
    assert back.bits == (32 if suffix == ".exr" else bits)
    # half a step of the encoding is at most 1.2 steps of light
    shown = np.ones(pixels.shape[:2], bool) if alpha is None or suffix != ".exr" else alpha > 0
    assert np.abs(back.pixels - pixels)[shown].max() <= 1.2 * step
    assert (back.alpha is None) == (not with_alpha)
    if alpha is not None:
        assert np.abs(back.alpha - alpha).max() <= 0.51 * step


def test_eight_bit_pictures_keep_their_bytes(tmp_path: Path) -> None:
    picture = picture_from_array(np.rint(NOISE * 255).astype(np.uint8))
    for suffix in (".png", ".tif"):
        data = encode_picture(picture.pixels, picture.alpha, 8, suffix)[0]
        back = written(tmp_path, data, suffix)
        assert np.array_equal(back.view, picture.view) and np.array_equal(back.alpha, picture.alpha)
    structure = read_structure(data)
    assert structure is not None and structure.tiff is not None and structure.tiff.extra == 2, "called straight alpha"
    deep = picture_from_array(np.rint(NOISE * 65535).astype(np.uint16))
    back = written(tmp_path, encode_picture(deep.pixels, deep.alpha, 16, ".png")[0], ".png")
    assert np.array_equal(back.pixels, deep.pixels) and np.array_equal(back.alpha, deep.alpha)


def test_jpeg_is_black_outside(tmp_path: Path) -> None:
    alpha = np.zeros((64, 64), np.float32)
    alpha[:, 32:] = 1
    data, _ = encode_picture(np.full((64, 64, 3), 0.5, np.float32), alpha, 16, ".jpg")
    back = written(tmp_path, data, ".jpg")
    assert back.bits == 8 and back.alpha is None
    assert back.view[:, :24].max() <= 3 and abs(int(back.view[40, 60, 1]) - 188) <= 2


def test_float_is_clipped_with_a_warning_unless_exr(tmp_path: Path) -> None:
    pixels = NOISE[..., :3] * 4
    for suffix, bits in ((".png", 16), (".tif", 16), (".jpg", 8)):
        data, warnings = encode_picture(pixels, None, 32, suffix)
        back = written(tmp_path, data, suffix)
        assert back.bits == bits and back.pixels.max() == 1
        share = (pixels > 1).any(axis=2).mean()
        assert f"{bits} bits" in warnings[0] and f"{share:.2%}" in warnings[0] and ".exr" in warnings[0]
    data, warnings = encode_picture(pixels, None, 32, ".exr")
    assert warnings == () and np.array_equal(written(tmp_path, data, ".exr").pixels, pixels)


def test_exr_is_premultiplied_and_says_who_made_it() -> None:
    data, _ = encode_picture(NOISE[..., :3] * 9, NOISE[..., 3], 32, ".exr", exif=EXIF)
    with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
        header, channels = file.header(), file.channels()
        assert np.allclose(channels["G"].pixels, NOISE[..., 1] * 9 * NOISE[..., 3])
        assert np.array_equal(channels["A"].pixels, NOISE[..., 3]) and channels["A"].pixels.dtype == np.float32
        assert (header["owner"], header["capDate"], header["comments"]) == ("© Ann", "2020:01:02 03:04:05", "Ann's X")
        assert header["compression"] == OpenEXR.ZIP_COMPRESSION


@pytest.mark.parametrize(("suffix", "bits"), [(".jpg", 8), (".png", 8), (".png", 16), (".tif", 8), (".tif", 16)])
@pytest.mark.parametrize("with_alpha", [False, True])
def test_profile_and_exif_go_along(tmp_path: Path, suffix: str, bits: int, with_alpha: bool) -> None:
    profile, alpha = icc(), NOISE[..., 3] if with_alpha else None
    smooth = cv2.GaussianBlur(NOISE[..., :3], (0, 0), 5)
    back = written(tmp_path, encode_picture(smooth, alpha, bits, suffix, profile, EXIF)[0], suffix)
    assert back.icc == profile and back.exif.kept == EXIF.kept and back.exif.orientation == 1
    assert back.pixels.shape == smooth.shape, "upright, whatever the photograph's orientation was"
    # both ways through the profile's own curve
    if suffix != ".jpg":
        assert np.abs(back.pixels - smooth).max() <= 1.2 / (2**bits - 1)
        assert np.allclose(back.view / 255, smooth ** (1 / 2.2), atol=0.004)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_gray_profiles(tmp_path: Path, suffix: str) -> None:
    gray = cv2.GaussianBlur(NOISE[..., :1], (0, 0), 5)[..., None]
    back = written(tmp_path, encode_picture(gray, None, 8, suffix, icc(b"GRAY"))[0], suffix)
    assert back.icc == icc(b"GRAY") and back.pixels.shape[2] == 1
    assert np.abs(back.pixels - gray).max() < 0.02
    # beside alpha, gray is written as colour, where the profile has no place
    if suffix != ".jpg":
        colour = written(tmp_path, encode_picture(gray, NOISE[..., 3], 8, suffix, icc(b"GRAY"))[0], suffix)
        assert colour.icc is None and np.abs(colour.pixels - gray).max() < 0.006


def loaded(tmp_path: Path, pixels: np.ndarray, profile: bytes | None) -> Picture:
    return written(tmp_path, encode_picture(pixels, None, 16, ".png", profile)[0], ".png")


def test_one_profile_for_both_is_kept_and_two_become_srgb(tmp_path: Path) -> None:
    light = NOISE[..., :3] * 0.5 + 0.2
    wide, plain = loaded(tmp_path, light, icc()), loaded(tmp_path, light, None)
    a, b = in_same_colour_space((wide, wide))
    assert a.icc == b.icc == icc() and np.array_equal(a.pixels, wide.pixels)
    a, b = in_same_colour_space((wide, plain))
    assert a.icc is None and b.icc is None and b is plain and a.warnings == ()
    profile = parse_icc(icc())
    assert profile is not None
    assert np.allclose(a.pixels, light @ profile.to_srgb.T, atol=1e-4)
    assert np.abs(a.pixels - light).max() > 0.02, "the primaries do differ"
    assert np.allclose(decode(a.view), a.pixels.clip(0, 1), atol=0.006), "the view follows"
    # the same colours under two profiles
    seen = loaded(tmp_path, (light @ np.linalg.inv(profile.to_srgb).T).astype(np.float32), icc())
    a, b = in_same_colour_space((seen, loaded(tmp_path, light, icc(primaries=SRGB, gamma=1.8))))
    assert np.allclose(a.pixels, b.pixels, atol=2e-3)


def test_profiles_that_are_not_understood(tmp_path: Path) -> None:
    light = NOISE[..., :3]
    lut, plain = loaded(tmp_path, light, icc(pcs=b"Lab ")), loaded(tmp_path, light, None)
    assert np.array_equal(lut.pixels, plain.pixels) and lut.warnings == ()
    a, b = in_same_colour_space((lut, lut))
    assert a.icc == b.icc == icc(pcs=b"Lab ") and a.warnings == (), "out as it came in"
    a, b = in_same_colour_space((plain, lut))
    assert b.icc is None and "taken as sRGB" in b.warnings[0]
    # a CMYK profile describes what the decoder has turned to RGB already
    png = encode_picture(light, None, 8, ".png")[0]
    cmyk = written(tmp_path, embed(png, "png", EXIF, icc(b"CMYK")), ".png")
    assert cmyk.icc is None and "does not fit" in cmyk.warnings[0]


def test_gray_picture_with_a_colour_profile(tmp_path: Path) -> None:
    data = encode_picture(NOISE[..., :1], None, 8, ".png")[0]
    plain = written(tmp_path, data, ".png")
    for gamma in (1.0, (3.0, 1.0, 2.0)):
        picture = written(tmp_path, embed(data, "png", EXIF, icc(gamma=gamma)), ".png")
        assert picture.icc is None and picture.warnings == ()
        assert np.allclose(picture.pixels, plain.view / 255, atol=1e-5), "through the profile's curve, green's"


def test_exr_leaves_the_profile_for_linear_srgb(tmp_path: Path) -> None:
    profile = parse_icc(icc())
    assert profile is not None
    back = written(tmp_path, encode_picture(NOISE[..., :3], None, 8, ".exr", icc())[0], ".exr")
    assert np.allclose(back.pixels, NOISE[..., :3] @ profile.to_srgb.T, atol=1e-5)


def test_depth_of_outputs() -> None:
    assert [output_bits((8, 8), one) for one in (".jpg", ".png", ".tif", ".exr")] == [8, 8, 8, 32]
    assert [output_bits((8, 16), one) for one in (".jpeg", ".png", ".tiff", ".EXR")] == [8, 16, 16, 32]
    assert [output_bits((32, 8), one) for one in (".JPG", ".png", ".tif", ".exr")] == [8, 16, 16, 32]
    for suffix in (".webp", ".gif", ""):
        with pytest.raises(BadRequest, match=r"\.png, \.jpg, \.jpeg, \.tif, \.tiff, \.exr"):
            output_bits((8,), suffix)


def test_saving(tmp_path: Path) -> None:
    path = tmp_path / "Übung.png"
    assert save_picture(path, NOISE[..., :3], NOISE[..., 3], 8, exif=EXIF) == ()
    assert load_picture(path).exif.kept == EXIF.kept
    before = path.read_bytes()
    with pytest.raises(UnwritableOutput, match="exists: use --overwrite"):
        save_picture(path, NOISE[..., :3], None, 8)
    with pytest.raises(BadRequest, match=r"\.webp"):
        save_picture(tmp_path / "a.webp", NOISE[..., :3], None, 8)
    with pytest.raises(UnwritableOutput, match="JPEG holds 65500 pixels"):
        save_picture(tmp_path / "wide.jpg", np.zeros((1, 65501, 3), np.float32), None, 8)
    with pytest.raises(UnwritableOutput, match="no folder"):
        save_picture(tmp_path / "missing" / "a.png", NOISE[..., :3], None, 8)
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    save_picture(path, NOISE[..., :3], None, 8, overwrite=True)
    assert load_picture(path).alpha is None


def test_same_picture_same_bytes() -> None:
    for suffix in (".jpg", ".png", ".tif", ".exr"):
        one, two = (encode_picture(NOISE[..., :3], NOISE[..., 3], 16, suffix, icc(), EXIF)[0] for _ in range(2))
        assert one == two


def test_half_floats_are_small_and_say_what_they_cannot_hold(tmp_path: Path) -> None:
    bright = NOISE[..., :3] * 9
    bright[0, :11, 1] = 1e6
    data, warnings = encode_picture(bright, None, 32, ".exr", exr=ExrForm("half"))
    back = written(tmp_path, data, ".exr").pixels
    assert back[0, 0, 1] == 65504 and np.allclose(back[1:], bright[1:], rtol=6e-4, atol=1e-6)
    assert len(warnings) == 1 and f"{11 / bright[..., 0].size:.2%}" in warnings[0] and "--exr-depth" in warnings[0]
    with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
        assert file.channels()["G"].pixels.dtype == np.float16
    whole = encode_picture(bright, None, 32, ".exr")
    assert whole[1] == () and len(data) < 0.7 * len(whole[0])


def test_dwab_loses_little(tmp_path: Path) -> None:
    smooth = 4 * cv2.GaussianBlur(NOISE[..., :3], (0, 0), 5)
    data, warnings = encode_picture(smooth, NOISE[..., 3], 32, ".exr", exr=ExrForm(compression="dwab"))
    with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
        assert file.header()["compression"] == OpenEXR.DWAB_COMPRESSION
    back = written(tmp_path, data, ".exr")
    shown = NOISE[..., 3] > 0.9
    assert warnings == () and np.allclose(back.alpha, NOISE[..., 3], atol=1e-3)
    assert np.allclose(back.pixels[shown], smooth[shown], rtol=0.02)


@pytest.mark.parametrize("form", [{"depth": "double"}, {"compression": "piz"}])
def test_other_forms_of_exr_are_refused_by_name(form: dict) -> None:
    with pytest.raises(BadRequest, match=next(iter(form.values()))):
        ExrForm(**form)


def test_exr_says_its_primaries_and_whether_it_is_a_whole_sphere() -> None:
    def header(sphere: SpherePart | None, channels: int = 3) -> dict:
        data, _ = encode_picture(NOISE[..., :channels], None, 32, ".exr", sphere=sphere)
        with OpenEXR.File(io.BytesIO(data), separate_channels=True) as file:
            return dict(file.header())

    assert np.allclose(header(None)["chromaticities"], (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329))
    assert "envmap" not in header(None) and "chromaticities" not in header(None, 1)
    assert header(SpherePart((44, 30), (0, 0, 44, 30)))["envmap"] == OpenEXR.ENVMAP_LATLONG
    assert "envmap" not in header(SpherePart((60, 30), (4, 0, 44, 30))), "a part of a sphere is no environment map"
