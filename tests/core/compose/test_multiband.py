"""Across a seam light is evened out and content is cut; beyond the band nothing is touched."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.blend import cut_hard, feathered_across, in_bands, seam_region
from edf_stitch.core.compose.multiband import bands_for, correction
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.pull_push import filled

H, W, SEAM = 300, 800, 400
NOTHING = np.zeros((H, W), bool)
SIDE = np.zeros((H, W), bool)
SIDE[:, SEAM:] = True
REACH = 4 << bands_for(NOTHING)


def layer(columns: slice, pixels: np.ndarray) -> Layer:
    out, alpha = np.zeros((H, W, 3), np.float32), np.zeros((H, W), np.float32)
    out[:, columns], alpha[:, columns] = pixels[:, columns], 1
    return Layer(out, alpha)


def blended(a: np.ndarray, b: np.ndarray, left: slice = slice(0, 620), right: slice = slice(180, 800),
            hidden: np.ndarray = NOTHING, side: np.ndarray = SIDE) -> Layer:
    first, second = layer(left, a), layer(right, b)
    return in_bands(first, second, side, overlap_of(first, second, hidden))


def texture(low: float, high: float, seed: int = 0) -> np.ndarray:
    return np.exp(np.random.default_rng(seed).uniform(np.log(low), np.log(high), (H, W, 3))).astype(np.float32)


def test_a_step_of_light_becomes_a_slope() -> None:
    detail = texture(0.3, 0.4)
    out = blended(detail, 1.3 * detail).pixels.mean(axis=(0, 2)) / detail.mean(axis=(0, 2))
    steps = np.diff(out)
    assert out[SEAM - REACH] == pytest.approx(1, abs=1e-4) and out[SEAM + REACH] == pytest.approx(1.3, abs=1e-4)
    assert (steps > -0.003).all() and steps.max() < 0.03, "cut hard it would be 0.3"


def test_the_finest_detail_changes_over_within_a_few_pixels_and_without_a_step() -> None:
    a = np.full((H, W, 3), 0.5, np.float32)
    b = a.copy()
    b[::2, ::2] += 0.02
    b[1::2, 1::2] += 0.02
    out = blended(a, b).pixels[100:200, :, 0]
    detail = np.abs(np.diff(out, axis=0)).mean(axis=0) / 0.02
    assert np.abs(np.diff(detail)).max() < 0.3, "cut with scissors it would be more than a half"
    assert (detail[: SEAM - 24] < 0.05).all() and (detail[SEAM + 24 :] > 0.95).all()


def test_beyond_the_band_every_bit_stays() -> None:
    a, b = texture(0.01, 1000, 1), texture(0.01, 1000, 2)
    out = blended(a, b).pixels
    assert np.array_equal(out[:, : SEAM - REACH], a[:, : SEAM - REACH])
    assert np.array_equal(out[:, SEAM + REACH :], b[:, SEAM + REACH :])
    assert np.isfinite(out).all() and (out > 0).all()


def test_light_of_every_height_goes_through() -> None:
    """From 0.01 to 1000 in one picture, the other a tenth darker: no ringing beside lamps, nothing out of bounds."""
    light = np.full((H, W, 3), 0.01, np.float32)
    light[100:140, 380:430], light[150:152, :], light[200:220, 300:500] = 1000, 30, 1
    out = blended(light, 0.9 * light).pixels
    assert (out <= light * (1 + 1e-4)).all() and (out >= 0.9 * light * (1 - 1e-4)).all()
    far = np.abs(np.arange(W) - SEAM) > REACH
    source = np.where(SIDE[..., None], 0.9 * light, light)
    assert np.allclose(out[:, far], source[:, far], rtol=1e-3)


@pytest.mark.parametrize("seen", ["hidden", "plain"])
def test_content_is_cut_hard_and_leaves_no_ghost(seen: str) -> None:
    """A dark thing that only the reference shows, right at the seam: all of it stays, none of it crosses."""
    a, b = np.full((H, W, 3), 0.5, np.float32), np.full((H, W, 3), 0.5, np.float32)
    a[80:220, 330:SEAM] = 0.02
    hidden = NOTHING.copy()
    hidden[80:220, 330:SEAM] = seen == "hidden"
    out = blended(a, b, hidden=hidden).pixels
    assert np.abs(out[80:220, 335 : SEAM - 1] - 0.02).max() < 0.002
    assert np.abs(out[:, SEAM:] - 0.5).max() < 0.01


def test_no_dark_fringe_where_a_picture_ends_at_the_seam() -> None:
    a = np.full((H, W, 3), 0.5, np.float32)
    out = blended(a, a, left=slice(0, SEAM + 1), right=slice(SEAM - 3, 800)).pixels
    assert np.allclose(out, 0.5, atol=1e-5)
    brighter = blended(a, 1.2 * a, left=slice(0, SEAM + 1), right=slice(SEAM - 30, 800)).pixels
    assert brighter.min() > 0.499 and brighter.max() < 0.601


def test_the_canvas_beyond_the_pictures_has_no_say() -> None:
    """Where nothing is shown there is neither side of a seam: a rim must not darken or brighten."""
    a = np.full((H, W, 3), 0.5, np.float32)
    first, second = layer(slice(0, 620), a), layer(slice(180, 800), 1.2 * a)
    for part in (first, second):
        part.alpha[:60] = part.pixels[:60] = 0
    out = in_bands(first, second, SIDE, overlap_of(first, second, NOTHING)).pixels
    assert np.allclose(out[61, SEAM + REACH :], 0.6, rtol=1e-4) and not out[:60].any()
    assert np.abs(out[61:75] - out[150]).max() < 0.02


def test_constant_pictures_stay_constant() -> None:
    for value in (0.0, 0.01, 1.0, 1000.0):
        a = np.full((H, W, 3), value, np.float32)
        assert np.allclose(blended(a, a).pixels, value, rtol=1e-5, atol=0)


def test_negative_light_is_no_accident() -> None:
    """Float pictures may hold a little of it; it is not made where there was none."""
    a, b = np.full((H, W, 3), 1e-4, np.float32), np.full((H, W, 3), 1e-4, np.float32)
    a[:, 390:400] = -1e-3
    b[::2] = 0.05
    out = blended(a, b).pixels
    assert out[a > 0].min() >= 0 or out[:, SEAM:].min() >= 0
    assert np.isfinite(out).all()


def test_filled_values_are_smooth_and_keep_what_is_known() -> None:
    y, x = np.mgrid[:90, :130].astype(np.float32)
    plane = (0.01 * x + 0.02 * y)[..., None]
    known = (x > 30) & (x < 60)
    out = filled(plane, known)
    assert np.allclose(out[known], plane[known], atol=1e-6) and np.isfinite(out).all()
    assert out.min() >= plane[known].min() - 1e-5 and out.max() <= plane[known].max() + 1e-5
    assert np.abs(np.diff(out[..., 0], axis=1)).max() < 0.5
    assert not filled(plane, np.zeros_like(known)).any()


def test_no_correction_where_there_is_no_difference() -> None:
    nothing = np.zeros((H, W, 3), np.float32)
    assert not correction(nothing, ~NOTHING, SIDE, ~NOTHING, 5).any()


def test_feather_across_a_seam_is_hard_where_the_pictures_differ() -> None:
    a, b = np.full((H, W, 3), 0.5, np.float32), np.full((H, W, 3), 0.52, np.float32)
    a[80:220, 330:SEAM] = 0.02
    first, second = layer(slice(0, 620), a), layer(slice(180, 800), b)
    out = feathered_across(first, second, SIDE, overlap_of(first, second, NOTHING)).pixels[..., 0]
    assert np.allclose(out[100:200, 340 : SEAM - 1], 0.02) and np.allclose(out[:, 600:], 0.52)
    slope = np.diff(out[20])
    assert slope.min() >= 0 and 0 < slope.max() < 0.005 and out[20, 0] == 0.5


def test_a_cut_takes_every_pixel_as_it_is_and_alpha_as_it_is_needed() -> None:
    a, b = texture(0.01, 10, 1), texture(0.01, 10, 2)
    first, second = layer(slice(0, 620), a), layer(slice(180, 800), b)
    first.alpha[:, 350:390] = 0.3
    out = cut_hard(first, second, SIDE)
    assert np.array_equal(out.pixels, np.where(SIDE[..., None], b, a)) and (out.alpha == 1).all()


def test_without_a_seam_there_is_nothing_to_blend() -> None:
    assert seam_region(NOTHING, ~NOTHING, 10) is None
    assert seam_region(SIDE, NOTHING, 10) is None
    assert seam_region(SIDE, ~NOTHING, 10) == (slice(0, H), slice(SEAM - 11, SEAM + 11))
