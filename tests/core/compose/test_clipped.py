"""What an over-exposed picture's clipped channels were is learnt where the other shows it, and used where not."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.compose.clipped import clipped_colours
from edf_stitch.core.compose.options import CLIPPED

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
    table = clipped_colours(own, matched, told, shown)
    assert table is not None and table.factors[0] is table.factors[1] is None
    restored = matched.copy()
    table.restore(own, restored)
    # as near as the colours of a cell of the table are to each other
    assert np.abs(restored - np.minimum(light, CLIPPED.most)).max() < 0.03
    unclipped = own < CLIPPED.begins
    assert np.array_equal(restored[unclipped], matched[unclipped])


def test_no_clipped_light_gets_darker_and_none_white() -> None:
    light = scene()
    own, matched = over(light), over(light) / np.float32(STOP)
    for told in (0 * light, 50 * light):
        table = clipped_colours(own, matched, told, np.ones((H, W), bool))
        assert table is not None
        restored = matched.copy()
        table.restore(own, restored)
        assert (restored >= matched).all() and restored.max() <= np.float32(CLIPPED.most)


def test_too_little_that_is_clipped_tells_nothing() -> None:
    light = scene()
    few = np.zeros((H, W), bool)
    few[:2, :4] = True
    matched = over(light) / np.float32(STOP)
    assert clipped_colours(over(light), matched, light, few) is None
    assert clipped_colours(0.5 * light, light, light, np.ones((H, W), bool)) is None
    assert clipped_colours(over(light), matched, light, np.zeros((H, W), bool)) is None


def test_gray_pictures_have_no_colour_to_tell_by() -> None:
    gray = over(scene())[..., :1]
    assert clipped_colours(gray, gray, gray, np.ones((H, W), bool)) is None
