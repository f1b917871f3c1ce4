"""Toned light rises with light, stays below white where it is not clipped, and white where it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from edf_stitch.core.compose.options import EXPOSURE
from edf_stitch.core.compose.tone.clipped import ClippedLight
from edf_stitch.core.compose.tone.tone_options import TONE
from edf_stitch.core.compose.tone.toned import NO_VIGNETTING, ToneCurve, Toned, Vignetting, near_white
from edf_stitch.core.raster.colour import decode, encode
from edf_stitch.core.raster.picture_map import PictureMap
from hypothesis import given, settings
from hypothesis import strategies as st

H, W = 40, 60
LENS = Vignetting(-0.1, -0.35)
CURVE = ToneCurve(-0.2, -4.0, -1.0)

gains = st.lists(st.floats(0.2, 5.0), min_size=3, max_size=3).map(np.float32)
lenses = st.tuples(st.floats(-0.25, 0.0), st.floats(0.0, 0.4)).map(lambda v: Vignetting(v[0], 2 * v[0] - v[1]))
ends = st.floats(-7.0, -3.0), st.floats(-2.0, float(np.log(EXPOSURE.clipped_light)))
curves = st.none() | st.builds(ToneCurve, st.floats(-0.6, 1.5), *ends)
colours = st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3)


def places(width: int = W, height: int = H) -> PictureMap:
    """A picture pixel for pixel."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return PictureMap(x, y, (width, height))


def toned(light: Any, gain: Any = (1, 1, 1), lens: Vignetting = NO_VIGNETTING, curve: ToneCurve | None = None,
          keeps_white: bool = True, clipped: ClippedLight | None = None) -> np.ndarray:  # fmt: skip
    """Light (h, w, 3) as it is shown."""
    light = np.float32(light)
    height, width = light.shape[:2]
    return Toned(light, np.float32(gain), lens, curve, keeps_white, places(width, height), clipped)[:, :]


def grays(count: int = 1001) -> np.ndarray:
    """(1, N, 3) gray from black to white."""
    return np.repeat(np.linspace(0, 1, count), 3).reshape(1, count, 3)


def test_without_a_roll_off_each_step_does_what_it_says() -> None:
    light = np.random.default_rng(0).random((H, W, 3)) + 0.01
    radius = (np.arange(W) - (W - 1) / 2) ** 2 + ((np.arange(H) - (H - 1) / 2) ** 2)[:, None]
    radius = (radius / radius[0, 0])[..., None]
    # halfway and corner are the values where the squared radius is 1/2 and 1
    lost = np.exp(radius * (4 * -0.1 + 0.35) + radius**2 * (2 * -0.35 + 4 * 0.1))
    assert np.allclose(toned(light, lens=LENS, keeps_white=False), light / lost, rtol=1e-5)
    assert np.allclose([LENS.at(np.float32(0.5)), LENS.at(np.float32(1)), LENS.at(np.float32(0))], [-0.1, -0.35, 0])
    more = np.exp(-0.2 * (np.clip(np.log(light / lost), -4, -1) + 2.5))
    whole = toned(light, (2, 3, 0.5), LENS, CURVE, keeps_white=False)
    assert np.allclose(whole, light / lost * more * [2, 3, 0.5], rtol=1e-4)


def test_below_the_knee_tones_are_those_that_the_other_picture_meets() -> None:
    light = 0.2 * np.random.default_rng(0).random((H, W, 3))
    assert np.array_equal(toned(light, (2, 2.4, 0.7)), toned(light, (2, 2.4, 0.7), keeps_white=False))


@settings(max_examples=150, deadline=None)
@given(colours, colours, gains, lenses, curves)
def test_more_light_is_never_darker(one: list, other: list, gain: np.ndarray, lens: Vignetting, curve: Any) -> None:
    """In any channel, wherever in the picture, with all that may be done to it."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    share = np.linspace(0, 1, 400)[None, :, None]
    ramp = np.repeat(low + share * (high - low), 3, axis=0)
    light = np.float32(ramp)
    shown = Toned(light, gain, NO_VIGNETTING, curve, True, places(400, 3))[:, :]
    assert np.diff(shown, axis=1).min() >= -1e-6
    corner = PictureMap(np.zeros((3, 400), np.float32), np.zeros((3, 400), np.float32), (W, H))
    assert np.diff(Toned(light, gain, lens, curve, True, corner)[:, :], axis=1).min() >= -1e-6


@settings(max_examples=150, deadline=None)
@given(st.lists(st.lists(st.integers(0, 255), min_size=3, max_size=3), min_size=1, max_size=30), gains, lenses, curves,
       st.booleans())  # fmt: skip
def test_nothing_unclipped_becomes_white(
    levels: list, gain: np.ndarray, lens: Vignetting, curve: Any, told: bool
) -> None:
    levels = np.array([[*levels, [255, 255, 249], [249, 249, 249], [249, 255, 240]]], np.uint8)
    field = np.ones((2, 2, 3), np.float32)
    table = ClippedLight((np.full((8, 8), 4.0, np.float32),) * 3, field) if told else None
    light = decode(levels)
    corner = PictureMap(*np.zeros((2, *levels.shape[:2]), np.float32), (W, H))
    for at in (corner, places(levels.shape[1], 1)):
        shown = encode(Toned(light, gain, lens, curve, True, at, table)[:, :], 8)
        unclipped = (levels < EXPOSURE.clipped_level).any(axis=2)
        assert ((shown < EXPOSURE.clipped_level).any(axis=2))[unclipped].all()
        assert told or (shown[~unclipped] >= EXPOSURE.clipped_level).all(), "what is clipped stays white"


@pytest.mark.parametrize("gain", [0.4, 0.66, 1.0, 1.5, 4.0])
def test_tones_are_nowhere_spread_by_much(gain: float) -> None:
    """So that the noise of a sky that is nearly white does not turn into speckles; in levels of a display."""
    shown = encode(toned(decode(np.arange(256, dtype=np.uint8)[None, :, None].repeat(3, 2)), [gain] * 3), 8)[0, :, 0]
    steepest = np.diff(shown[80:251:5].astype(float)).max() / 5
    assert steepest <= max(gain ** (1 / TONE.display_gamma), 1.5 * TONE.steepest) + 0.3


def test_near_white_begins_the_earlier_the_more_white_is_darkened() -> None:
    begins = [float(near_white(np.float32([gain] * 3))) for gain in (1.0, 0.8, 0.6, 0.4, 0.1)]
    assert begins == sorted(begins, reverse=True) and len(set(begins)) == 5
    assert begins[0] == pytest.approx(TONE.most_near_white) and begins[-1] == pytest.approx(TONE.least_near_white)


def test_clouds_stay_neutral_whatever_the_white_balance() -> None:
    bright = toned(np.full((1, 1, 3), 0.94), (2.0, 2.6, 1.8))[0, 0]
    assert np.ptp(bright) < 0.01 < np.ptp(toned(np.full((1, 1, 3), 0.2), (2.0, 2.6, 1.8))[0, 0])


def test_what_needs_no_roll_off_hardly_gets_one() -> None:
    light = grays()
    assert np.abs(toned(light, (1.0, 1.0, 1.0)) - light).max() < 0.02
    assert np.allclose(toned(light, (0.8, 0.8, 0.8))[0, :700], 0.8 * light[0, :700], atol=0.01)


def test_light_beyond_a_map_is_no_trouble() -> None:
    """Behind the camera a map is NaN, and light there is 0."""
    nowhere = PictureMap(*np.full((2, 1, 3), np.nan, np.float32), (W, H))
    shown = Toned(np.zeros((1, 3, 3), np.float32), np.float32([1, 2, 3]), LENS, CURVE, True, nowhere)[:, :]
    assert np.array_equal(shown, np.zeros((1, 3, 3)))


def test_parts_are_those_of_the_whole() -> None:
    light = np.random.default_rng(0).random((300, 200, 3)).astype(np.float32)
    one = Toned(light, np.float32([1.5, 0.7, 2]), LENS, CURVE, True, places(200, 300))
    whole = one[:, :]
    assert one.shape == light.shape and 300 * 200 > 2 * TONE.pixels_at_once
    for rows, columns in ((slice(3, 170), slice(0, 200)), (slice(250, 300), slice(17, 60)), (slice(0, 1), slice(5, 6))):
        assert np.array_equal(one[rows, columns], whole[rows, columns])


def test_gray_pictures_have_one_channel() -> None:
    light = np.linspace(0, 1, 50, dtype=np.float32).reshape(1, 50, 1)
    shown = Toned(light, np.float32([2.0]), LENS, CURVE, True, places(50, 1))[:, :]
    assert shown.shape == light.shape and (np.diff(shown[0, :, 0]) > 0).all()
