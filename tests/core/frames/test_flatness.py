"""Spheres, fisheye circles and pictures of nothing are told from flat photographs."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.frames import flatness
from edf_stitch.core.frames.flatness import kind_of, usable
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.gpano import SpherePart, whole_sphere, xmp_packet
from edf_stitch.core.pictures.picture import load_picture, picture_from_array
from edf_stitch.core.system.errors import UnreadableImage


def texture(height: int, width: int, seed: int = 1) -> np.ndarray:
    """A field of blobs of some sizes, levels 60 to 255."""
    noise = np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)
    levels = sum(cv2.GaussianBlur(noise, (0, 0), sigma) * sigma for sigma in (1.5, 5, 15))
    return (60 + 195 * (levels - levels.min()) / np.ptp(levels)).astype(np.uint8)


def sphere(height: int, seed: int = 1) -> np.ndarray:
    """A texture in space as all directions see it."""
    latitude, longitude = np.mgrid[0.5:height, 0.5 : 2 * height] * np.pi / height
    rays = [np.sin(latitude) * np.cos(longitude), np.sin(latitude) * np.sin(longitude), np.cos(latitude)]
    rng = np.random.default_rng(seed)
    levels = np.zeros((height, 2 * height, 3))
    for _ in range(40):
        phase = sum(weight * axis for weight, axis in zip(rng.normal(0, 9, 3), rays, strict=True))
        levels += np.sin(phase + rng.uniform(0, 6.3))[..., None] * rng.random(3)
    return (255 * (levels - levels.min()) / np.ptp(levels)).astype(np.uint8)


def circle(
    height: int, width: int, radius: float, centre: tuple[float, float] = (0.5, 0.5), soft: float = 0.0
) -> np.ndarray:
    row, column = np.mgrid[:height, :width]
    off = np.hypot(column - centre[0] * width, row - centre[1] * height)
    disc = (off < radius * min(height, width)).astype(np.float32)
    if soft:
        disc = cv2.GaussianBlur(disc, (0, 0), soft)
    return (texture(height, width) * disc[..., None]).astype(np.uint8)


def kind(levels: np.ndarray) -> str:
    return kind_of(picture_from_array(levels))


@pytest.mark.parametrize("height", [100, 300, 700])
def test_a_sphere_is_known_by_its_ends_and_poles(height: int) -> None:
    levels = sphere(height)
    assert kind(levels) == "sphere"
    assert kind(levels.astype(np.uint16) * 257) == "sphere"
    assert kind(levels[: height // 2]) == "flat", "of another shape"
    compressed = cv2.imdecode(cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, 70])[1], cv2.IMREAD_COLOR)
    assert kind(compressed) == "sphere"


@pytest.mark.parametrize("seed", range(5))
def test_a_wide_photograph_is_none(seed: int) -> None:
    assert kind(texture(200, 400, seed)) == "flat"
    assert kind(np.tile(texture(200, 200, seed), (1, 2, 1))) == "flat", "a pattern, but no poles"
    closed, share = texture(200, 400, seed).astype(float), np.linspace(0, 1, 60)[None, :, None]
    closed[:, -60:] = (1 - share) * closed[:, -60:] + share * closed[:, 59::-1]
    assert kind(closed.astype(np.uint8)) == "flat", "its ends meet, but it has no poles"
    assert kind(np.random.default_rng(seed).integers(0, 9, (200, 400, 3), np.uint8)) == "flat", "night"
    fog = 128 + np.random.default_rng(seed).integers(0, 3, (200, 400, 3))
    assert kind(fog.astype(np.uint8)) == "flat"


def framed(levels: np.ndarray, width: int, border: np.ndarray) -> np.ndarray:
    """A picture under a border of so many px, of one colour or one for each row."""
    out = np.broadcast_to(border, levels.shape).astype(np.uint8)
    out[width:-width, width:-width] = levels[width:-width, width:-width]
    return out


def on_backdrop(height: int) -> np.ndarray:
    """A thing before a backdrop that falls off downwards and alike to both sides."""
    row, column = np.mgrid[:height, : 2 * height] / height
    light = 250 - 120 * row - 60 * np.abs(column - 1) * np.sin(np.pi * row)
    levels = np.repeat(light[..., None], 3, axis=2)
    quarter = height // 4
    levels[quarter:-quarter, quarter:-quarter] = texture(height - 2 * quarter, 2 * height - 2 * quarter)
    return levels.astype(np.uint8)


FALLING = np.linspace(230, 40, 300)[:, None, None]
PLAIN_ENDS = {
    "gray": np.full((300, 600, 3), 128, np.uint8), "black": np.zeros((300, 600, 3), np.uint8),
    "falling": np.broadcast_to(FALLING, (300, 600, 3)).astype(np.uint8),
    "framed": framed(texture(300, 600), 10, np.array(255)),
    "thinly framed": framed(texture(300, 600), 3, np.array(255)),
    "framed in black": framed(texture(300, 600), 20, np.array(0)),
    "framed in what falls off": framed(texture(300, 600), 12, FALLING), "backdrop": on_backdrop(300),
}  # fmt: skip


@pytest.mark.parametrize("name", PLAIN_ENDS)
@pytest.mark.parametrize("quality", [None, 95, 70])
def test_what_is_plain_along_its_ends_is_no_sphere(name: str, quality: int | None) -> None:
    levels = PLAIN_ENDS[name]
    if quality is not None:
        encoded = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        levels = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    assert kind(levels) == "flat"


@pytest.mark.parametrize("height", [100, 300, 700])
def test_a_sphere_is_known_without_its_poles_and_by_night(height: int) -> None:
    found = sphere(height)
    for level in (0, 255):
        levels = found.copy()
        levels[: height // 5] = levels[-height // 8 :] = level
        assert kind(levels) == "sphere"
    assert kind(found // 12) == "sphere"
    clear = np.dstack([levels, np.where(levels.min(axis=2) == 255, 0, 255).astype(np.uint8)])
    assert kind(clear) == "sphere"


def test_a_sphere_that_only_looks_like_one_is_told(tmp_path: Path) -> None:
    said = read_frame([texture(80, 90), picture_from_array(sphere(100), "found.jpg")], StitchOptions()).warnings
    assert len(said) == 1 and said[0].startswith("found.jpg: taken for a whole sphere because its ends meet")
    told = with_xmp(sphere(100), xmp_packet(whole_sphere((200, 100))), tmp_path / "told.jpg")
    assert read_frame([texture(80, 90), told], StitchOptions()).warnings == ()


def with_xmp(levels: np.ndarray, xmp: bytes, path: Path) -> Path:
    """A JPEG file with a packet of XMP."""
    data = cv2.imencode(".jpg", levels)[1].tobytes()
    segment = b"http://ns.adobe.com/xap/1.0/\0" + xmp
    path.write_bytes(data[:2] + b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment + data[2:])
    return path


@pytest.mark.parametrize("xmp", [
    b'<rdf:Description GPano:ProjectionType="equirectangular"/>',
    b"<GPano:ProjectionType>cylindrical</GPano:ProjectionType>",
    xmp_packet(SpherePart((100, 50), (90, 0, 160, 120))),
])  # fmt: skip
def test_what_goes_around_in_another_way_than_a_sphere_is_refused(tmp_path: Path, xmp: bytes) -> None:
    """A part of which nobody knows what part it is, a cylinder, numbers that cannot be."""
    with pytest.raises(UnreadableImage, match="directions all around, but not as an equirectangular sphere"):
        usable(load_picture(with_xmp(texture(120, 160), xmp, tmp_path / "picture.jpg")))


def test_a_file_that_calls_itself_a_sphere_is_believed(tmp_path: Path) -> None:
    whole = with_xmp(texture(80, 160), b'<x GPano:ProjectionType="equirectangular"/>', tmp_path / "whole.jpg")
    assert usable(load_picture(whole)).part == whole_sphere((160, 80))
    part = SpherePart((400, 200), (100, 20, 160, 120))
    assert usable(load_picture(with_xmp(texture(120, 160), xmp_packet(part), tmp_path / "part.jpg"))).part == part
    half = usable(load_picture(with_xmp(texture(60, 80), xmp_packet(part), tmp_path / "resized.jpg")))
    assert half.part == SpherePart((200, 100), (50, 10, 80, 60))
    assert usable(picture_from_array(sphere(100))).part == whole_sphere((200, 100)), "by its ends and poles"
    assert usable(picture_from_array(texture(100, 200))).part is None


@pytest.mark.parametrize("levels", [
    circle(300, 300, 0.48), circle(300, 450, 0.45), circle(450, 300, 0.45), circle(600, 800, 0.6),
    circle(900, 900, 0.42, (0.47, 0.53)), circle(300, 300, 0.45, soft=1.5),
    np.hstack([circle(300, 300, 0.45), circle(300, 300, 0.46)]),
], ids=["square", "wide", "high", "cut", "aside", "shrunk", "two"])  # fmt: skip
@pytest.mark.parametrize("quality", [None, 60])
def test_the_circle_of_a_fisheye_is_known(levels: np.ndarray, quality: int | None) -> None:
    if quality is not None:
        encoded = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        levels = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    picture = picture_from_array(levels)
    two = levels.shape[1] == 2 * levels.shape[0]
    assert kind_of(picture) == ("circles" if two else "circle")
    if two:
        with pytest.raises(UnreadableImage, match="two circles of fisheye lenses on black: cut them apart"):
            usable(picture)


def test_dark_corners_and_lamps_are_no_circles() -> None:
    row, column = np.mgrid[:300, :450]
    off = np.hypot(column - 225, row - 150) / 270
    vignette = (texture(300, 450) * np.clip(1.3 - 1.3 * off**2, 0, 1)[..., None]).astype(np.uint8)
    assert kind(vignette) == "flat"
    assert kind(circle(300, 450, 0.1)) == "flat", "a lamp at night"
    assert kind(np.pad(texture(200, 300), ((50, 50), (75, 75), (0, 0)))) == "flat", "a black frame"
    assert kind(np.zeros((200, 300, 3), np.uint8)) == "flat"


def test_a_circle_is_found_to_a_pixel() -> None:
    found = usable(picture_from_array(circle(900, 1200, 0.42, (0.47, 0.53)))).circle
    assert found == pytest.approx([0.47 * 1200, 0.53 * 900, 378], abs=2)
    assert usable(picture_from_array(texture(300, 450))).circle is None


def test_a_circle_is_searched_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    searched = []
    found = flatness._circles_in
    monkeypatch.setattr(flatness, "_circles_in", lambda view: searched.append(view.shape) or found(view))
    pictures = [picture_from_array(circle(300, 300, 0.45), "a.png"), picture_from_array(texture(300, 450), "b.png")]
    frame = read_frame(pictures, StitchOptions())
    assert len(searched) == 2 and [camera is not None for camera in frame.known] == [True, False]


def test_whatever_is_to_be_stitched_is_looked_at() -> None:
    """Files, arrays, and Pictures that were read already, as Blender's are."""
    levels = np.hstack([circle(300, 300, 0.45)] * 2)
    for source in (levels, picture_from_array(levels)):
        with pytest.raises(UnreadableImage, match="two circles"):
            read_frame([texture(300, 450), source], StitchOptions())


def test_a_picture_of_nothing_is_refused() -> None:
    nothing = np.dstack([texture(80, 90), np.zeros((80, 90, 1), np.uint8)])
    with pytest.raises(UnreadableImage, match="entirely transparent"):
        usable(picture_from_array(nothing))
