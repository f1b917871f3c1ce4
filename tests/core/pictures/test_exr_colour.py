"""What an EXR's header says of colours and pixels, and what its channels are."""

from __future__ import annotations

import contextlib
import io
import struct
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from edf_stitch.core.pictures.picture import Picture, load_picture
from edf_stitch.core.raster.primaries import REC709, rgb_to_xyz, to_rec709
from edf_stitch.core.system.errors import UnreadableImage

HEIGHT, WIDTH = 10, 14
# SMPTE ST 2065-1
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767)
LIGHT = np.random.default_rng(7).random((HEIGHT, WIDTH, 3)).astype(np.float32)


def exr(channels: dict[str, np.ndarray], **header: object) -> bytes:
    stream = io.BytesIO()
    start = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(start | header, {name: np.ascontiguousarray(one) for name, one in channels.items()}) as file:
        file.write(stream)
    return stream.getvalue()


def rgb(light: np.ndarray, names: str = "RGB") -> dict[str, np.ndarray]:
    return {name: light[..., number].astype(np.float32) for number, name in enumerate(names)}


def load(tmp_path: Path, data: bytes) -> Picture:
    (tmp_path / "picture.exr").write_bytes(data)
    return load_picture(tmp_path / "picture.exr")


@pytest.mark.parametrize("names", ["RGB", "RGBA"])
def test_other_primaries_are_brought_to_those_of_rec709(tmp_path: Path, names: str) -> None:
    stored = LIGHT @ np.linalg.inv(to_rec709(AP0)).T
    if names == "RGBA":
        alpha = np.full((HEIGHT, WIDTH, 1), 0.5)
        stored = np.concatenate([stored * alpha, alpha], axis=2)
    picture = load(tmp_path, exr(rgb(stored, names), chromaticities=AP0))
    assert np.abs(picture.pixels - LIGHT).max() < 1e-5
    same = load(tmp_path, exr(rgb(LIGHT), chromaticities=REC709))
    assert np.array_equal(same.pixels, LIGHT)
    nonsense = load(tmp_path, exr(rgb(LIGHT), chromaticities=(0.0,) * 8))
    assert np.array_equal(nonsense.pixels, LIGHT)


def luminance_chroma(light: np.ndarray, step: int, **attributes: bytes) -> bytes:
    """An uncompressed file of Y, RY and BY by hand, chroma at every `step` pixels: OpenEXR's module writes none."""
    weights = rgb_to_xyz(REC709)[1]
    luminance = light @ weights
    chroma = {name: (light[..., index] / luminance - 1)[::step, ::step] for name, index in (("RY", 0), ("BY", 2))}

    def attribute(name: bytes, kind: bytes, value: bytes) -> bytes:
        return name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value

    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, one, one)
        for name, one in (("BY", step), ("RY", step), ("Y", 1))
    )
    window = struct.pack("<4i", 0, 0, WIDTH - 1, HEIGHT - 1)
    head = b"\x76\x2f\x31\x01" + struct.pack("<I", 2) + b"".join([
        attribute(b"channels", b"chlist", listed + b"\0"), attribute(b"compression", b"compression", b"\0"),
        attribute(b"dataWindow", b"box2i", window), attribute(b"displayWindow", b"box2i", window),
        attribute(b"lineOrder", b"lineOrder", b"\0"), attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        attribute(b"screenWindowCenter", b"v2f", bytes(8)),
        attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)), b"\0",
    ])  # fmt: skip
    lines = []
    for row in range(HEIGHT):
        planes = [chroma["BY"][row // step], chroma["RY"][row // step]] if row % step == 0 else []
        body = b"".join(plane.astype("<f4").tobytes() for plane in [*planes, luminance[row]])
        lines.append(struct.pack("<ii", row, len(body)) + body)
    at = len(head) + 8 * HEIGHT + np.cumsum([0, *map(len, lines[:-1])])
    return head + at.astype("<u8").tobytes() + b"".join(lines)


def test_luminance_and_chroma_are_colours(tmp_path: Path) -> None:
    assert np.abs(load(tmp_path, luminance_chroma(LIGHT, 1)).pixels - LIGHT).max() < 1e-5
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    smooth = np.stack([1 + row / HEIGHT, 1 + column / WIDTH, 2 - row / HEIGHT], axis=2)
    picture = load(tmp_path, luminance_chroma(smooth, 2))
    inner = np.s_[:-1, :-1]  # in the last row and column chroma is what it was beside them
    assert picture.light.shape[2] == 3 and np.abs(picture.pixels - smooth)[inner].max() < 0.02


def test_deep_data_are_named(tmp_path: Path) -> None:
    depth = np.empty((2, 3), object)
    for place in np.ndindex(depth.shape):
        depth[place] = np.ones(1, np.float32)
    stream = io.BytesIO()
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline}
    with OpenEXR.File(header, dict.fromkeys("RGB", depth)) as file:
        file.write(stream)
    with pytest.raises(UnreadableImage, match="deep data.*flatten"):
        load(tmp_path, stream.getvalue())


def test_alpha_that_is_nowhere_set_hides_nothing(tmp_path: Path) -> None:
    nowhere = np.concatenate([LIGHT, np.zeros((HEIGHT, WIDTH, 1))], axis=2)
    picture = load(tmp_path, exr(rgb(nowhere, "RGBA")))
    assert picture.alpha is None and np.array_equal(picture.pixels, LIGHT)
    assert "its alpha is 0 everywhere" in picture.warnings[0]
    nothing = load(tmp_path, exr(rgb(0 * nowhere, "RGBA")))
    assert nothing.alpha is not None and not nothing.alpha.any()


@pytest.mark.parametrize(("ratio", "size"), [(1.5, (HEIGHT, 21)), (2.0, (HEIGHT, 28)), (0.5, (20, WIDTH))])
def test_pixels_that_are_not_square_are_stretched(tmp_path: Path, ratio: float, size: tuple[int, int]) -> None:
    square = exr(rgb(LIGHT))
    at = square.index(b"pixelAspectRatio\0float\0") + 27  # OpenEXR's module cannot write another one

    def shaped(value: float) -> bytes:
        return square[:at] + struct.pack("<f", value) + square[at + 4 :]

    picture = load(tmp_path, shaped(ratio))
    assert picture.light.shape[:2] == size and abs(picture.pixels.mean() - LIGHT.mean()) < 0.01
    assert f"its pixels are {ratio:g} times as wide as high" in picture.warnings[0]
    assert not load(tmp_path, shaped(30)).warnings


def test_what_openexr_prints_of_damage_is_not_shown(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    whole = exr(rgb(np.round(np.random.default_rng(1).random((64, 64, 3)), 1)))  # few values, which pack well
    refused = 0
    for at in range(len(whole) // 2, len(whole) - 8, 8):
        with contextlib.suppress(UnreadableImage):
            load(tmp_path, whole[:at] + b"\xff" * 8 + whole[at + 8 :])
            refused -= 1
        refused += 1
    assert refused > 0 and capfd.readouterr() == ("", "")
