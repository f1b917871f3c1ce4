"""Two layers become one without an edge, without touching what only one of them shows."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.choices import BLENDS
from edf_stitch.core.compose.blend import averaged, distance_labels, feathered, in_bands
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.panorama.layers import Layer

H, W = 60, 140
LEFT, RIGHT = slice(0, 90), slice(50, 140)  # columns: 40 of them are shared
BOTH = np.zeros((H, W), bool)
BOTH[:, 50:90] = True


def layer(columns: slice, pixels: np.ndarray | float, alpha: np.ndarray | float = 1.0, channels: int = 3) -> Layer:
    out, shown = np.zeros((H, W, channels), np.float32), np.zeros((H, W), np.float32)
    out[:, columns] = pixels if np.ndim(pixels) == 0 else pixels[:, columns]
    shown[:, columns] = alpha if np.ndim(alpha) == 0 else alpha[:, columns]
    out[shown == 0] = 0
    return Layer(out, shown)


def blend(reference: Layer, target: Layer, mode: str) -> Layer:
    """Without a seam of its own."""
    hidden = np.zeros(reference.alpha.shape, bool)
    if mode == "multiband":
        side = distance_labels(reference, target)
        return in_bands(reference, target, side, overlap_of(reference, target, hidden))
    if mode == "linear":
        return averaged(reference, target, reference.alpha > 0)
    return feathered(reference, target, hidden)


def light(seed: int, channels: int = 3) -> np.ndarray:
    """HDR: from 0.01 to 1000."""
    return (10 ** np.random.default_rng(seed).uniform(-2, 3, (H, W, channels))).astype(np.float32)


@pytest.mark.parametrize("channels", [1, 3])
def test_linear_is_the_plain_average(channels: int) -> None:
    a, b = light(1, channels), light(2, channels)
    out = blend(layer(LEFT, a, channels=channels), layer(RIGHT, b, channels=channels), "linear")
    assert np.allclose(out.pixels[BOTH], (a[BOTH].astype(float) + b[BOTH]) / 2, rtol=1e-6)
    assert out.pixels.dtype == out.alpha.dtype == np.float32


@pytest.mark.parametrize("mode", ["feather", "linear"])
def test_outside_the_overlap_every_value_stays_as_it_is(mode: str) -> None:
    a, b = light(1), light(2)
    first, second = layer(LEFT, a), layer(slice(50, 120), b)
    out = blend(first, second, mode)
    assert np.array_equal(out.pixels[:, :50], a[:, :50]) and np.array_equal(out.pixels[:, 90:120], b[:, 90:120])
    assert not out.pixels[:, 120:].any() and not out.alpha[:, 120:].any()
    assert (out.alpha[:, :120] == 1).all() and np.isfinite(out.pixels).all()
    assert np.array_equal(first.pixels[:, LEFT], a[:, LEFT]), "the layers are not written to"
    assert np.array_equal(second.pixels[:, 50:120], b[:, 50:120])


@pytest.mark.parametrize("mode", BLENDS)
def test_a_constant_stays_a_constant(mode: str) -> None:
    alpha = np.random.default_rng(4).uniform(0.001, 1, (H, W)).astype(np.float32)
    for value in (0.0, 0.01, 1.0, 1000.0):
        out = blend(layer(LEFT, value, alpha), layer(RIGHT, value, alpha.T.copy().reshape(H, W)), mode)
        assert np.allclose(out.pixels, value, rtol=1e-5, atol=0)


@pytest.mark.parametrize("mode", BLENDS)
def test_values_stay_between_those_of_the_layers(mode: str) -> None:
    a, b = light(1), light(2)
    out = blend(layer(LEFT, a), layer(RIGHT, b), mode).pixels[BOTH]
    low, high = np.minimum(a, b)[BOTH], np.maximum(a, b)[BOTH]
    assert (out >= low * (1 - 1e-6)).all() and (out <= high * (1 + 1e-6)).all()


def test_feather_has_no_step_where_a_picture_ends() -> None:
    """A black and a white picture: from one's border to the other's it climbs evenly, 1/41 a pixel."""
    out = blend(layer(LEFT, 0.0), layer(RIGHT, 1.0), "feather").pixels[H // 2, :, 0]
    steps = np.diff(out)
    assert (out[:50] == 0).all() and (out[90:] == 1).all() and (steps >= 0).all()
    assert steps.max() < 1.5 / 41, "the distance has to be right to a few percent"
    linear = blend(layer(LEFT, 0.0), layer(RIGHT, 1.0), "linear").pixels[H // 2, :, 0]
    assert np.diff(linear).max() == 0.5, "what it would be without"


def test_feather_is_the_same_from_both_sides_and_half_in_the_middle() -> None:
    one = blend(layer(LEFT, 0.0), layer(RIGHT, 1.0), "feather").pixels
    other = blend(layer(RIGHT, 1.0), layer(LEFT, 0.0), "feather").pixels
    assert np.abs(one - other).max() < 1e-6
    assert abs(one[H // 2, 69:71, 0].mean() - 0.5) < 1e-3


def test_feather_counts_from_a_pictures_own_border_wherever_it_lies() -> None:
    """A small picture on a large one: at its rim the large one, in its middle mostly itself; the canvas's rim is a
    rim."""
    small = np.zeros((H, W), np.float32)
    small[20:41, 30:61] = 1
    out = blend(layer(slice(0, W), 0.0), layer(slice(0, W), 1.0, small), "feather").pixels[..., 0]
    assert not out[small == 0].any()
    rim = np.r_[out[20, 30:61], out[40, 30:61], out[20:41, 30], out[20:41, 60]]
    assert rim.max() < 0.06
    assert out[30, 45] == pytest.approx(11 / (11 + 30), rel=0.03), "11 px from its own rim, 30 from the other's"


def test_alpha_weighs_colours() -> None:
    a, b = np.full((H, W), 0.5, np.float32), np.full((H, W), 1.0, np.float32)
    out = blend(layer(LEFT, 0.2, a), layer(RIGHT, 0.8, b), "linear")
    assert np.allclose(out.alpha[:, :50], 0.5) and np.allclose(out.alpha[:, 90:], 1.0)
    assert np.allclose(out.pixels[BOTH], (0.5 * 0.2 + 1.0 * 0.8) / 1.5), "straight: half there counts half"


@pytest.mark.parametrize("mode", BLENDS)
@pytest.mark.parametrize("other", [0.01, 0.5])
def test_what_one_picture_shows_whole_is_never_seen_through(mode: str, other: float) -> None:
    """A soft edge of one picture inside the other must not cut a veil into the panorama."""
    for alpha, alpha_too in ((1.0, other), (other, 1.0)):
        out = blend(layer(LEFT, 0.2, alpha), layer(RIGHT, 0.8, alpha_too), mode)
        assert (out.alpha[BOTH] == 1).all()
    both = blend(layer(LEFT, 0.2, other), layer(RIGHT, 0.8, other), mode).alpha[BOTH]
    assert (both >= np.float32(other)).all() and (both <= 1).all()


@pytest.mark.parametrize("mode", ["feather", "linear"])
def test_holes_are_filled_by_the_other_picture_alone(mode: str) -> None:
    hole = np.ones((H, W), np.float32)
    hole[10:50, 60:80] = 0
    out = blend(layer(LEFT, 0.2, hole), layer(RIGHT, 0.8), mode)
    assert (out.pixels[10:50, 60:80] == np.float32(0.8)).all() and (out.alpha == 1).all()
    out = blend(layer(LEFT, 0.2), layer(RIGHT, 0.8, hole), mode)
    assert (out.pixels[10:50, 60:80] == np.float32(0.2)).all() and (out.alpha == 1).all()


@pytest.mark.parametrize("mode", BLENDS)
def test_pictures_that_do_not_meet(mode: str) -> None:
    out = blend(layer(slice(0, 40), 0.2), layer(slice(60, 140), 0.8), mode)
    assert (out.pixels[:, :40] == np.float32(0.2)).all() and (out.pixels[:, 60:] == np.float32(0.8)).all()
    assert not out.alpha[:, 40:60].any() and not out.pixels[:, 40:60].any()
    nothing = blend(layer(slice(0, 0), 0.2), layer(slice(0, 0), 0.8), mode)
    assert not nothing.alpha.any() and np.isfinite(nothing.pixels).all()


@pytest.mark.parametrize("mode", BLENDS)
@pytest.mark.parametrize("columns", [slice(0, W), slice(69, 70)])
def test_overlaps_of_every_width_give_numbers(mode: str, columns: slice) -> None:
    a, b = light(1), light(2)
    out = blend(layer(columns, a, 1e-4), layer(columns, b, 1e-4), mode)
    assert np.isfinite(out.pixels).all() and np.isfinite(out.alpha).all()
    shown = out.alpha > 0
    assert (out.pixels[shown] > 0.009).all() and (out.pixels[shown] < 1001).all()


@pytest.mark.parametrize("alpha", [1.0, 0.3])
def test_by_distances_each_pixel_comes_from_the_picture_whose_border_is_further_away(alpha: float) -> None:
    """Shared are columns 50 to 89: what lies left of their middle is the first one's, be it ever so transparent."""
    middle, inner = H // 2, np.s_[25:35]
    first, second = layer(LEFT, 0.5, alpha), layer(RIGHT, 0.5, alpha)
    found = distance_labels(first, second)
    assert not found[inner, :70].any() and found[inner, 70:].all()
    assert not distance_labels(second, first)[middle, 71:].any() and distance_labels(second, first)[middle, :69].all()
    assert not distance_labels(first, first).any(), "of equals the one before"
