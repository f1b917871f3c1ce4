"""Exposures of one view become its radiance: clip-aware, by exposure time, and what moved is there once."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.frames.brackets import Bracket, brackets_in
from edf_stitch.core.frames.merging import MergedBracket, _resampled, merged
from edf_stitch.core.frames.reading import read_frame
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import Picture, picture_from_array

from ..textured_room import circle, flat, sphere, turned
from .exposed_views import HEIGHT, WIDTH, bracket_of, painted_world, shot, view_of

WORLD = painted_world()
VIEW = view_of(WORLD)


def merge(pictures: list[Picture]) -> tuple[Picture, MergedBracket]:
    (bracket,) = brackets_in(pictures, len(pictures))
    return merged(pictures, bracket)


def off(found: Picture, light: np.ndarray) -> np.ndarray:
    """By which share each pixel's channels are off, their mean."""
    return np.abs(found.pixels / light - 1).mean(axis=2)


def test_radiance_is_right_over_many_stops() -> None:
    """16 stops, of which 8-bit exposures 4 stops apart show 15.7 with grain of a level."""
    deep = view_of(painted_world(16.0)) * np.float32(0.3)
    found, about = merge(bracket_of(deep))
    bright = deep.max(axis=2)
    ceiling = bright < 3.9
    twelve = ceiling & (bright > 3.9 / 2**12)
    assert twelve.mean() > 0.5 and np.median(off(found, deep)[twelve]) < 0.02
    assert about.clipped == pytest.approx((~ceiling).mean(), abs=0.01)
    shown = found.pixels.max(axis=2)
    assert np.log2(shown.max() / shown[shown > 0].min()) > 14
    # the darkest that is shown is as dark as it should be, within its rounding
    last = ceiling & (bright < 3.9 / 2**12) & (bright > 3.9 / 2**14)
    assert last.sum() > 1000 and np.median(np.abs(found.pixels[..., 0] / deep[..., 0] - 1)[last]) < 0.2
    one = shot(deep)
    assert np.median(off(one, deep)[twelve]) > 2 * np.median(off(found, deep)[twelve])


def test_weights_are_those_of_the_exposures_times() -> None:
    """Where all are well exposed, the brightest counts most: grain is what the exposures' sum has."""
    light = np.full((HEIGHT, WIDTH, 3), 0.05, np.float32) * (1 + 0.3 * VIEW / VIEW.max())
    pictures = [shot(light, stops, f"{stops}", noise=4.0, seed=3) for stops in (0, -1, 1)]
    bracket = Bracket((1, 0, 2), (-1.0, 0.0, 1.0), (np.eye(3),) * 3, 0.0)
    found, _ = merged(pictures, bracket)
    grain = [float(np.std(one.pixels / 2.0**stops / light)) for one, stops in zip(pictures, (0, -1, 1), strict=True)]
    assert float(np.std(found.pixels / light)) < 0.85 * min(grain)


def test_what_only_one_shows_unclipped_is_taken_from_it() -> None:
    light = VIEW.copy()
    light[100:140, 100:160] = (3.0, 2.5, 2.0)  # a window: clipped at 0 and +2
    light[200:240, 300:360] = (0.002, 0.0015, 0.001)  # a cupboard: 1 to 6 levels at 0
    found, about = merge(bracket_of(light))
    assert np.median(off(found, light)[102:138, 102:158]) < 0.02
    assert np.median(off(found, light)[202:238, 302:358]) < 0.1
    assert about.clipped < 1e-3 and about.moved == 0 and about.shift == 0
    # beyond all of them it stays at the darkest's white
    light[100:140, 100:160] = 50.0
    found, about = merge(bracket_of(light))
    assert np.median(found.pixels[102:138, 102:158]) == pytest.approx(4.0, rel=0.01)
    assert about.clipped == pytest.approx(40 * 60 / (HEIGHT * WIDTH), rel=0.05)


def test_the_result_is_a_float_picture_that_says_what_the_middle_one_says() -> None:
    pictures = [replace(one, exif=Exif(make="Ann", model=one.name), icc=b"profile", warnings=(one.name[:1],))
                for one in bracket_of(VIEW)]  # fmt: skip
    found, about = merge(pictures)
    assert (found.bits, found.name, found.exif.model, found.icc) == (32, "a+0.png", "a+0.png", b"profile")
    assert found.alpha is None and found.warnings == ("a",) and found.view.shape == VIEW.shape
    assert about.names == ("a-2.png", "a+0.png", "a+2.png") and np.allclose(about.stops, (-2, 0, 2), atol=0.02)


@pytest.mark.parametrize("brightness", [0.9, 0.02])
def test_what_moves_is_there_once_and_nothing_else_changes(brightness: float) -> None:
    """A thing that stands elsewhere in each exposure; three ghosts of it would be a mean of it and what is behind."""
    lights = []
    for x in (100, 220, 340):
        light = VIEW.copy()
        light[150:210, x : x + 50] = brightness * np.array([1, 0.7, 0.5], np.float32)
        lights.append(light)
    pictures = [shot(light, stops, f"{stops}") for light, stops in zip(lights, (0, -2, 2), strict=True)]
    bracket = Bracket((1, 0, 2), (-2.0, 0.0, 2.0), (np.eye(3),) * 3, 0.0)
    found, about = merged(pictures, bracket)
    touched = np.zeros((HEIGHT, WIDTH), bool)
    for x in (100, 220, 340):
        touched[135:225, x - 15 : x + 65] = True
    still = off(found, VIEW)[~touched]
    assert np.median(still) < 0.02 and np.percentile(still, 99) < 0.1
    assert 0.03 < about.moved < 0.2
    for x in (100, 220, 340):
        inner = np.s_[155:205, x + 5 : x + 45]
        as_one = [np.median(np.abs(found.pixels[inner] / light[inner] - 1).max(axis=2)) for light in lights]
        assert min(as_one) < 0.1, "all of it from one exposure"


def test_a_camera_with_another_curve_moves_nothing() -> None:
    # the curve is that of a picture whose contrast was raised after the exposure, by three stops from dark to bright
    curved = []
    for one in bracket_of(VIEW):
        level = np.float32(one.view) / 255
        raised = np.rint(255 * (0.5 + 0.5 * np.tanh(3 * (level - 0.5)) / np.tanh(1.5))).astype(np.uint8)
        curved.append(replace(one, view=raised, light=one.light))
    _, about = merged(curved, Bracket((1, 0, 2), (-2.0, 0.0, 2.0), (np.eye(3),) * 3, 0.0))
    assert about.moved < 0.04


def test_exposures_from_the_hand_are_brought_onto_the_middle_one() -> None:
    shifts = ((0.0, 0.0, 0.0), (5.3, -2.1, 0.4), (-3.0, 4.4, -0.3))
    lights = [view_of(WORLD, 100 + dx, 60 + dy, turn) for dx, dy, turn in shifts]
    pictures = [shot(light, stops, f"{stops}") for light, stops in zip(lights, (0, -2, 2), strict=True)]
    found, about = merge(pictures)
    inner = np.s_[12:-12, 12:-12]
    assert np.median(off(found, lights[0])[inner]) < 0.025, "resampling softens by little"
    assert about.shift > 0.005 and about.moved < 0.01
    # at the border, where only the middle one shows something, it is shown
    edge = off(found, lights[0])[:, :2]
    assert np.isfinite(found.pixels).all() and np.median(edge) < 0.1
    # unaligned it would be a blur
    doubled, _ = merged(pictures, Bracket((1, 0, 2), (-2.0, 0.0, 2.0), (np.eye(3),) * 3, 0.0))
    assert np.median(off(doubled, lights[0])[inner]) > 1.3 * np.median(off(found, lights[0])[inner])


def test_sixteen_bits_are_merged_too() -> None:
    pictures = []
    for stops in (0, -2, 2):
        level = np.rint(65535 * np.clip(VIEW * 2.0**stops, 0, 1) ** (1 / 2.2)).astype(np.uint16)
        pictures.append(replace(shot(VIEW, stops, f"{stops}"), view=(level // 257).astype(np.uint8), bits=16))
    found, _ = merge(pictures)
    assert found.bits == 32 and found.pixels.dtype == np.float32


def test_the_same_bytes_again() -> None:
    pictures = bracket_of(cv2.GaussianBlur(VIEW, (0, 0), 1))
    first, second = (merge(pictures)[0].pixels for _ in range(2))
    assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize("move", [(0.0, 3.3, 0.2), (0.0, -7.6, -0.3), (4.0, 400.0, 0.0)])
def test_rows_are_resampled_as_the_whole_is(move: tuple[float, float, float]) -> None:
    """Some rows at a time, with as many of the exposure's as they show; the last move leaves nothing of it."""
    dx, dy, turn = move
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    homography = np.array([[c, -s, dx], [s, c, dy], [1e-6, -2e-6, 1]])
    rng = np.random.default_rng(3)
    light, weight = rng.random((HEIGHT, WIDTH, 3), np.float32), rng.random((HEIGHT, WIDTH), np.float32)
    asked = []

    def of_rows(rows: slice) -> tuple[np.ndarray, np.ndarray]:
        asked.append(rows.stop - rows.start)
        return light[rows], weight[rows]

    whole = cv2.warpPerspective(np.dstack([light, weight]), homography, (WIDTH, HEIGHT),
                                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)  # fmt: skip
    for top in range(0, HEIGHT, 40):
        rows = slice(top, min(HEIGHT, top + 40))
        shown, mass = _resampled(of_rows, rows, homography, light.shape)
        # positions are rounded to 1/32 px
        assert np.abs(np.dstack([shown, mass]) - whole[rows]).max() < 0.1
    assert max(asked, default=0) < 60


@pytest.mark.parametrize(("kind", "views"), [("sphere", 8), ("circle", 1)])
def test_a_bracket_of_a_sphere_is_a_sphere_and_one_of_a_circle_a_circle(kind: str, views: int) -> None:
    """No file says it; exposures that are too dark for it to be seen take part."""
    at = np.zeros(3)
    levels = sphere(at, np.eye(3), 200) if kind == "sphere" else circle(at, np.eye(3), 140, (320, 300))
    exposures = [
        picture_from_array(np.rint(levels * gain ** (1 / 2.2)).clip(0, 255).astype(np.uint8), f"{gain}.png")
        for gain in (0.25, 1.0, 4.0)
    ]
    still = picture_from_array(flat(at, turned(25), 190.0, (320, 240)), "still.png")
    frame = read_frame([*exposures, still], StitchOptions(brackets="auto"))
    assert [one.names for one in frame.brackets] == [("0.25.png", "1.0.png", "4.0.png")]
    assert sum(camera is not None for camera in frame.known) == views and len(frame.pictures) == views + 1
