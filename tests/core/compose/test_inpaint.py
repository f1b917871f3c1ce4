"""What neither camera saw, filled."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.inpaint import closed_holes, fillable_holes, inpainted
from edf_stitch.core.panorama.layers import Layer

SHAPE = 80, 120
HOLES = np.zeros(SHAPE, bool)
HOLES[20:50, 60:72] = True


def layer(light: np.ndarray, opaque: bool = True) -> Layer:
    """A picture that shows nothing in the holes."""
    alpha = ~HOLES if opaque else np.where(HOLES, 0, 0.5).astype(np.float32)
    return Layer(np.where(HOLES[..., None], 0, light).astype(np.float32), alpha)


def slope(most: float) -> np.ndarray:
    """Light that rises smoothly from left to right, other in each channel."""
    x = np.linspace(0.2, 1, SHAPE[1])[None, :, None] * [1.0, 0.5, 0.25] * most
    return np.broadcast_to(x, (*SHAPE, 3)).astype(np.float32)


@pytest.mark.parametrize("most", [0.01, 1.0, 1000.0])
@pytest.mark.parametrize("opaque", [True, False])
def test_a_smooth_picture_goes_on_through_its_holes_at_any_brightness(most: float, opaque: bool) -> None:
    light, flat = slope(most), np.zeros(SHAPE, np.float32)
    out = inpainted(layer(light, opaque), HOLES, flat)
    assert np.abs(out.pixels / light - 1)[HOLES].max() < 0.15
    assert (out.alpha[HOLES] == 1).all() and np.array_equal(out.alpha[~HOLES], layer(light, opaque).alpha[~HOLES])
    assert np.array_equal(out.pixels[~HOLES], layer(light).pixels[~HOLES]), "all else is bit for bit what it was"


def test_it_is_filled_from_what_lies_behind_and_not_from_what_hid_it() -> None:
    depth = np.full(SHAPE, 0.1, np.float32)
    depth[:, :60] = 0.8  # the near thing, to the left
    light = np.full((*SHAPE, 3), 0.5, np.float32)
    light[:, :60] = [4.0, 0.01, 0.01]
    out = inpainted(layer(light), HOLES, depth)
    assert np.abs(out.pixels[HOLES] - 0.5).max() < 0.05
    surrounded = depth.copy()
    surrounded[...] = 0.8
    surrounded[HOLES] = 0.1
    only = inpainted(layer(light), HOLES, surrounded).pixels[HOLES]
    assert (only > 0).all() and only[:, 0].max() > 1, "nothing far beside it: from what there is"


def test_it_gives_the_same_wherever_it_is_asked_for() -> None:
    out = inpainted(layer(slope(1.0)), HOLES, np.zeros(SHAPE, np.float32))
    whole = out.pixels
    for rows, columns in ((slice(0, 20), slice(0, 120)), (slice(25, 60), slice(63, 90)), (slice(70, 80), slice(5, 9))):
        assert np.array_equal(out.light[rows, columns], whole[rows, columns])


def test_without_holes_nothing_is_done() -> None:
    before = layer(slope(1.0))
    assert inpainted(before, np.zeros(SHAPE, bool), np.zeros(SHAPE, np.float32)) is before


def test_what_is_transparent_beside_a_hole_has_no_say() -> None:
    """The picture ends at the hole's right edge: beyond it lies black that nobody sees."""
    light = np.full((*SHAPE, 3), 0.5, np.float32)
    light[:, 72:] = 0
    whole = layer(light)
    alpha = whole.alpha & (np.arange(SHAPE[1]) < 72)
    out = inpainted(Layer(whole.light, alpha), HOLES, np.zeros(SHAPE, np.float32))
    assert np.abs(out.pixels[HOLES] - 0.5).max() < 1e-3
    assert np.array_equal(out.alpha, alpha | HOLES)


def test_small_closed_holes_are_told_from_large_and_open_ones() -> None:
    shows = np.ones((100, 200), bool)
    shows[40:44, 50:55] = False  # 20 px of 20 000: a thousandth
    shows[70:73, 100:107] = False  # 21 px
    shows[50, 0:5] = False  # at the left border
    shows[99, 30:33] = shows[0, 30:33] = shows[20:24, 199] = False
    shows[44, 55] = False  # touches the first by a corner only
    small, boxes = closed_holes(shows, small=True)
    assert boxes == [(50, 40, 5, 4), (55, 44, 1, 1)] and small.sum() == 21 and not (small & shows).any()
    large, boxes = closed_holes(shows, small=False)
    assert boxes == [(100, 70, 7, 3)] and large.sum() == 21 and large[70:73, 100:107].all()
    for none in (np.ones((9, 9), bool), np.zeros((9, 9), bool)):
        for of in (True, False):
            found, boxes = closed_holes(none, of)
            assert not found.any() and found.shape == none.shape and not boxes


def with_holes(rough: float) -> Layer:
    """A sky above the middle, ground with a pattern below; a hole of half a hundredth in both, one of a thousandth in
    the ground, one of two hundredths in the sky, and one in the sky that reaches the border."""
    rows, columns = np.mgrid[:200, :300]
    light = np.where(rows < 100, 0.5 + 0.002 * rows + rough * ((rows + columns) % 2), 0.3 + 0.2 * (columns // 4 % 2))
    shows = np.ones(light.shape, bool)
    shows[30:45, 40:60] = shows[140:155, 40:60] = False
    shows[140:146, 200:210] = False
    shows[30:60, 200:240] = False
    shows[:10, 100:110] = False
    return Layer(np.where(shows[..., None], np.repeat(light[..., None], 3, axis=2), 0).astype(np.float32), shows)


def test_holes_in_plain_surroundings_may_be_larger() -> None:
    plain = np.zeros((200, 300), bool)
    small = plain.copy()
    plain[30:45, 40:60] = True
    small[140:146, 200:210] = True
    assert np.array_equal(fillable_holes(with_holes(rough=0.02), goes_round=False), plain | small)
    assert np.array_equal(fillable_holes(with_holes(rough=0.3), goes_round=False), small)


def test_holes_far_from_each_other_are_filled_each_from_its_surroundings() -> None:
    holes = np.zeros((90, 300), bool)
    holes[40:44, 20:26] = holes[40:44, 270:276] = True
    light = np.where(np.arange(300) < 150, 0.2, 3.0)[None, :, None] * np.ones((90, 300, 3))
    before = Layer(np.where(holes[..., None], 0, light).astype(np.float32), ~holes)
    out = inpainted(before, holes, np.zeros((90, 300), np.float32))
    assert np.allclose(out.pixels, light, rtol=1e-3) and (out.alpha == 1).all()
    assert np.array_equal(out.light[38:50, 0:300], out.pixels[38:50])


def test_on_a_sphere_a_hole_across_the_ends_is_one_and_closed() -> None:
    shows = np.ones((100, 200), bool)
    shows[50:54, :3] = shows[50:54, -4:] = False  # 28 px
    shows[20:22, :2] = False  # 4 px
    shows[98:, 60:70] = False  # at the pole
    shows[10:90, 100:110] = False
    small, boxes = closed_holes(shows, True, goes_round=True)
    assert boxes == [(0, 20, 2, 2)] and small.sum() == 4
    large, boxes = closed_holes(shows, False, goes_round=True)
    assert boxes == [(100, 10, 10, 80), (0, 50, 3, 4), (196, 50, 4, 4)] and large.sum() == 28 + 800
    both, boxes = closed_holes(shows, None, goes_round=True)
    assert np.array_equal(both, small | large) and len(boxes) == 4
    shows[54:, -2:] = False  # one of both halves now reaches the pole
    assert closed_holes(shows, None, goes_round=True)[1] == [(100, 10, 10, 80), (0, 20, 2, 2)]
    assert closed_holes(shows, None)[1] == [(100, 10, 10, 80)]
