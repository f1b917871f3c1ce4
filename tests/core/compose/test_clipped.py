"""What an over-exposed picture's clipped channels were is learnt where the other shows it, and used where not."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.compose.tone.clipped import ClippedLight, ToldLight, clipped_light
from edf_stitch.core.compose.tone.tone_options import CLIPPED, TONE

H, W = 200, 160
SKY = np.array([0.15, 0.3, 0.75])
STOP = 2.0


def scene(seed: int = 0) -> np.ndarray:
    """A sky that gets paler downwards, over gray ground."""
    light = SKY * np.linspace(1, 1.25, H)[:, None, None] * np.ones((1, W, 1))
    light[150:] = 0.2 + 0.1 * np.random.default_rng(seed).random((50, W, 1))
    return light.astype(np.float32)


def over(light: np.ndarray) -> np.ndarray:
    return np.minimum(STOP * light, 1).astype(np.float32)


def test_a_sky_that_clips_in_blue_gets_its_blue_back_where_the_other_does_not_show_it() -> None:
    light, shown = scene(), np.zeros((H, W), bool)
    shown[:, : W // 2] = True
    own = over(light)
    matched = own / np.float32(STOP)
    assert np.abs(matched - light)[:150].max() > 0.2, "blue is missing"
    told = np.where(shown[..., None], light, 0.0).astype(np.float32)  # what is not shown has no say
    table = clipped_light([ToldLight(own, matched, told, shown)])
    assert table is not None and table.factors[0] is table.factors[1] is None
    restored = matched.copy()
    table.restore(own, restored)
    # as near as the colours of a cell of the table are to each other
    assert np.abs(restored - np.minimum(light, TONE.below_white)).max() < 0.03
    unclipped = own < CLIPPED.begins
    assert np.array_equal(restored[unclipped], matched[unclipped])


def test_no_clipped_light_gets_darker_and_none_white() -> None:
    light = scene()
    own, matched = over(light), over(light) / np.float32(STOP)
    for told in (0 * light, 50 * light):
        table = clipped_light([ToldLight(own, matched, told, np.ones((H, W), bool))])
        assert table is not None
        restored = matched.copy()
        table.restore(own, restored)
        assert (restored >= matched).all() and restored.max() <= np.float32(TONE.below_white)
        bright = np.where(own >= 1, np.float32(0.98), matched)
        table.restore(own, bright)
        assert (bright >= np.where(own >= 1, np.float32(0.98), matched)).all()


def test_too_little_that_is_clipped_tells_nothing() -> None:
    light = scene()
    few = np.zeros((H, W), bool)
    few[:2, :4] = True
    matched = over(light) / np.float32(STOP)
    assert clipped_light([ToldLight(over(light), matched, light, few)]) is None
    assert clipped_light([ToldLight(0.5 * light, light, light, np.ones((H, W), bool))]) is None
    assert clipped_light([ToldLight(over(light), matched, light, np.zeros((H, W), bool))]) is None


def test_gray_pictures_have_no_colour_to_tell_by() -> None:
    gray = over(scene())[..., :1]
    assert clipped_light([ToldLight(gray, gray, gray, np.ones((H, W), bool))]) is None


def test_white_becomes_what_the_other_shows_around_there_if_that_has_it_unclipped() -> None:
    light = np.ones((H, W, 3), np.float32) * np.linspace(0.6, 0.7, W, dtype=np.float32)[None, :, None]
    own, shown = np.ones_like(light), np.zeros((H, W), bool)
    shown[:, : 2 * W // 3] = True
    matched = own / np.float32(STOP)
    found = clipped_light([ToldLight(own, matched, light, shown)])
    assert found is not None and found.white is not None
    rows, columns = slice(0, H), slice(0, W)
    white = found.white_at(own, (rows, columns))
    assert np.abs(white - light)[shown].max() < 0.03 and np.abs(white - light).max() < 0.06
    assert np.array_equal(found.white_at(own[50:60, 7:40], (slice(50, 60), slice(7, 40))), white[50:60, 7:40])
    restored = matched.copy()
    found.restore(own, restored)
    assert np.array_equal(restored, matched)
    ClippedLight((np.full((8, 8), 1.5, np.float32),) * 3).restore(own, restored)
    assert np.array_equal(restored, matched), "no channel is left to tell a colour by"
    most = light.copy()
    most[:, : W // 2] = 1
    assert clipped_light([ToldLight(own, matched, most, shown)]) is None, "white for both of them is white"
    assert np.array_equal(ClippedLight((None,)).white_at(own, (rows, columns)), own)


def test_white_of_gray_pictures_too() -> None:
    own, told = np.ones((H, W, 1), np.float32), np.full((H, W, 1), 0.6, np.float32)
    found = clipped_light([ToldLight(own, own / 2, told, np.ones((H, W), bool))])
    assert found is not None and found.factors == (None,)
    assert np.allclose(found.white_at(own, (slice(0, H), slice(0, W))), 0.6, atol=1e-3)
