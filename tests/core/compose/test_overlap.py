"""Where two layers show something at once, by how many tones they differ there, and where that is light alone."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.options import OVERLAP
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.log_encoding import log_decode, log_encode

H, W = 40, 60
ROWS, COLUMNS = slice(5, 35), slice(20, 50)  # where both show something
NOTHING = np.zeros((H, W), bool)


def layer(tones: np.ndarray, rows: slice, columns: slice, seen: float = 1.0) -> Layer:
    """Of tones (H, W, C)."""
    alpha = np.zeros((H, W), np.float32)
    alpha[rows, columns] = seen
    return Layer(log_decode(np.where(alpha[..., None] > 0, tones, 0).astype(np.float32)), alpha)


def pair(more: np.ndarray | float = 0.0, noise: float = 0.0) -> tuple[Layer, Layer]:
    """Two layers of colours; the second is `more` tones brighter."""
    random = np.random.default_rng(0)
    tones = random.uniform(0.3, 0.6, (H, W, 3))
    brighter = tones + more + random.normal(0, noise, tones.shape)
    return layer(tones, ROWS, slice(0, 50)), layer(brighter, slice(0, 40), slice(20, 60), 0.5)


def test_the_difference_is_in_tones_target_less_reference_where_both_show_something() -> None:
    reference, target = pair(np.array([0.1, -0.05, 0.02]))
    overlap = overlap_of(reference, target, NOTHING)
    assert overlap is not None and overlap.box == (ROWS, COLUMNS) and overlap.both.all()
    assert np.allclose(overlap.difference, [0.1, -0.05, 0.02], atol=1e-5)
    hole = reference.alpha.copy()
    hole[10:15, 30:33] = 0
    holed = overlap_of(Layer(reference.light, hole), target, NOTHING)
    assert holed is not None
    assert np.array_equal(holed.both, hole[ROWS, COLUMNS] > 0) and not holed.same[~holed.both].any()
    assert not holed.difference[~holed.both].any() and holed.difference[holed.both].all()


def test_layers_that_do_not_meet_have_none() -> None:
    tones = np.full((H, W, 3), 0.5)
    assert overlap_of(layer(tones, ROWS, slice(0, 20)), layer(tones, ROWS, slice(20, 60)), NOTHING) is None
    one = overlap_of(layer(tones, slice(3, 4), slice(0, 21)), layer(tones, slice(0, 9), slice(20, 60)), NOTHING)
    assert one is not None and one.box == (slice(3, 4), slice(20, 21)) and one.same.all()


def test_beside_what_the_target_cannot_see_nothing_is_the_same() -> None:
    """Three px all round it, its edge may lie there; what is hidden where only one of them shows anything is none."""
    hidden = NOTHING.copy()
    hidden[20, 35] = hidden[2, 30] = hidden[36, 30] = True
    overlap = overlap_of(*pair(), hidden)
    assert overlap is not None and OVERLAP.hidden_margin_px == 3
    other = np.zeros((H, W), bool)
    other[17:24, 32:39] = True
    assert np.array_equal(overlap.same, ~other[ROWS, COLUMNS])


@pytest.mark.parametrize("light", [0.0, 0.3])
def test_what_differs_from_the_general_difference_is_content(light: float) -> None:
    """In any channel, by more than a few hundredths of a tone; a general difference is another exposure."""
    for channel in range(3):
        more = np.full((H, W, 3), light)
        more[10:20, 30:36, channel] -= 2 * OVERLAP.same_tone
        overlap = overlap_of(*pair(more), NOTHING)
        assert overlap is not None
        other = np.zeros((H, W), bool)
        other[10:20, 30:36] = True
        # looked at a little blurred: a pixel's width to either side
        assert not overlap.same[(other & np.roll(other, 1, 1) & np.roll(other, -1, 1))[ROWS, COLUMNS]].any()
        other[9:21, 29:37] = True
        assert overlap.same[~other[ROWS, COLUMNS]].all()
    near = np.full((H, W, 3), light)
    near[10:20, 30:36] += 0.8 * OVERLAP.same_tone
    calm = overlap_of(*pair(near), NOTHING)
    assert calm is not None and calm.same.all()


def test_what_noise_makes_of_them_is_still_the_same() -> None:
    noisy = overlap_of(*pair(0.0, 0.1), NOTHING)
    assert noisy is not None and noisy.same.mean() > 0.99
    more = np.zeros((H, W, 3))
    more[10:20, 30:36] = 0.8
    seen = overlap_of(*pair(more, 0.1), NOTHING)
    assert seen is not None and not seen.same[6:14, 11:15].any()


def test_gray_layers_have_an_overlap_too() -> None:
    (one, other) = (Layer(each.pixels[..., :1], each.alpha) for each in pair(0.1))
    overlap = overlap_of(one, other, NOTHING)
    assert overlap is not None and overlap.difference.shape == (30, 30, 1) and overlap.same.all()
    assert np.allclose(log_encode(other.pixels[ROWS, COLUMNS]) - log_encode(one.pixels[ROWS, COLUMNS]), 0.1, atol=1e-5)
