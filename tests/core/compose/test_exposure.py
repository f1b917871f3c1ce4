"""The gain is found whatever is clipped, moved or hidden; the reference is never touched."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.tone.clipped import ClippedLight
from edf_stitch.core.compose.tone.exposure import (
    Exposure,
    exposures_for,
    match_exposure,
    match_tones,
    pooled,
    unchanged,
)
from edf_stitch.core.compose.tone.tone_options import TONE
from edf_stitch.core.compose.tone.toned import ToneCurve, Vignetting
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap

H, W = 240, 320
GAIN = np.float32([1.35, 0.8, 1.1])
LDR, HDR = (False, False), (True, True)
NOTHING = np.zeros((H, W), bool)
PLACES = PictureMap(*np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32)), (W, H))


def scene(seed: int = 0, top: float = 0.9) -> np.ndarray:
    random = np.random.default_rng(seed)
    rough = cv2.resize(random.random((H // 8, W // 8, 3)), (W, H), interpolation=cv2.INTER_CUBIC)
    return np.clip(top * rough + 0.05 * random.random((H, W, 3)), 0.01, None).astype(np.float32)


def layer(pixels: np.ndarray, alpha: np.ndarray | None = None) -> Layer:
    return Layer(pixels.astype(np.float32), np.ones((H, W), np.float32) if alpha is None else alpha)


def test_gain_of_each_channel() -> None:
    light = scene(top=0.6)
    found = match_exposure(layer(light), layer(light / GAIN), NOTHING, LDR)
    assert found.gain.dtype == np.float32 and np.allclose(found.gain, GAIN, rtol=1e-4)
    assert (found.spread < 1e-3).all() and found.blocks > 500
    assert np.allclose(found.applied(layer(light / GAIN), PLACES).pixels, light, rtol=1e-4)


def test_clipped_pixels_are_left_out() -> None:
    light = scene(top=2.0)
    first, second = np.clip(light, 0, 1), np.clip(light / GAIN, 0, 1)
    assert (first == 1).mean() > 0.3
    found = match_exposure(layer(first), layer(second), NOTHING, LDR)
    assert np.allclose(found.gain, GAIN, rtol=0.01)


def test_float_pictures_do_not_clip() -> None:
    light = 100 * scene(top=2.0)
    found = match_exposure(layer(light), layer(light / GAIN), NOTHING, HDR)
    assert np.allclose(found.gain, GAIN, rtol=1e-4) and found.blocks > 0.98 * (H // 8) * (W // 8)


def test_noise_and_a_pixel_of_misalignment_cost_a_percent_at_most() -> None:
    light = scene(top=0.6)
    noisy = np.roll(light / GAIN, (1, 1), (0, 1)) + np.random.default_rng(1).normal(0, 0.01, light.shape)
    assert np.allclose(match_exposure(layer(light), layer(noisy), NOTHING, LDR).gain, GAIN, rtol=0.01)


def test_what_moved_has_no_say_and_what_is_hidden_even_less() -> None:
    light = scene(top=0.6)
    moved = light / GAIN
    moved[:80] = 0.9
    assert np.allclose(match_exposure(layer(light), layer(moved), NOTHING, LDR).gain, GAIN, rtol=0.02)
    hidden = NOTHING.copy()
    moved[:200], hidden[:200] = 0.9, True
    assert np.allclose(match_exposure(layer(light), layer(moved), hidden, LDR).gain, GAIN, rtol=1e-4)


def test_only_what_both_show_whole_counts() -> None:
    light = scene(top=0.6)
    alpha = np.zeros((H, W), np.float32)
    alpha[:, 200:] = 1
    alpha[:, 180:200] = 0.5
    spoilt = np.where(alpha[..., None] == 1, light / GAIN, 7)
    assert np.allclose(match_exposure(layer(light), layer(spoilt, alpha), NOTHING, LDR).gain, GAIN, rtol=1e-4)


@pytest.mark.parametrize("other", [0.0, 1e-9, 1e6])
def test_where_nothing_can_be_known_nothing_is_changed(other: float) -> None:
    light = scene(top=0.6)
    found = match_exposure(layer(light), layer(np.full_like(light, other)), NOTHING, HDR)
    assert found.blocks == 0 and (found.gain == 1).all()
    apart = layer(light, np.zeros((H, W), np.float32))
    assert match_exposure(layer(light), apart, NOTHING, HDR).blocks == 0
    tiny = Layer(light[:4, :4], np.ones((4, 4), np.float32))
    assert match_exposure(tiny, tiny, NOTHING[:4, :4], LDR).blocks == 0


def test_gray_pictures_have_one_gain() -> None:
    light = scene(top=0.6)[..., :1]
    found = match_exposure(layer(light), layer(light / 1.5), NOTHING, LDR)
    assert found.gain.tolist() == pytest.approx([1.5], rel=1e-3)


def test_no_compensation_gives_the_very_same_layer() -> None:
    target = layer(scene())
    assert unchanged(3).applied(target, PLACES) is target


def test_frames_of_a_clip_share_the_middle_of_their_gains() -> None:
    each = [Exposure(np.float32([g, 1, 1]), np.zeros(3, np.float32), 10) for g in (1.1, 1.2, 9.0)]
    assert pooled([*each, unchanged(3)]).gain.tolist() == pytest.approx([1.2, 1, 1])
    assert pooled([unchanged(3)]).blocks == 0


@pytest.mark.parametrize("blocks, known", [(19, 0), (20, 20), (21, 21)])
def test_fewer_than_twenty_blocks_tell_nothing(blocks: int, known: int) -> None:
    light = scene(top=0.6)
    alpha = np.zeros((H, W), np.float32)
    alpha[16:24, 40 : 40 + 8 * blocks] = 1
    found = match_exposure(layer(light), layer(light / GAIN, alpha), NOTHING, LDR)
    assert found.blocks == known and np.allclose(found.gain, GAIN if known else 1, rtol=1e-3)


def test_a_block_counts_where_half_of_it_or_more_is_seen() -> None:
    """Blocks are those of the canvas, wherever the overlap begins: its first columns have a half of one, or less."""
    light = scene(top=0.6)
    for first, columns in ((12, 29), (13, 28), (8, 29)):
        alpha = np.zeros((H, W), np.float32)
        alpha[16:32, first : 8 * 30] = 1
        found = match_exposure(layer(light), layer(light / GAIN, alpha), NOTHING, LDR)
        assert found.blocks == 2 * columns and np.allclose(found.gain, GAIN, rtol=1e-3)


def test_dark_blocks_tell_nothing_of_the_exposure() -> None:
    """Flare lies on them: in one picture they are twenty times too bright."""
    light = scene(top=0.6) + 0.2
    flared = light / GAIN
    light[:, :104] = 0.002
    flared[:, :104] = 0.04
    found = match_exposure(layer(light), layer(flared), NOTHING, HDR)
    assert np.allclose(found.gain, GAIN, rtol=1e-3) and found.blocks == (H // 8) * (W // 8 - 13)


def test_a_level_less_than_whole_is_not_whole() -> None:
    light = scene(top=0.6)
    alpha = np.where(np.arange(W) < 100, np.float32(254 / 255), np.float32(1)) * np.ones((H, 1), np.float32)
    spoilt = np.where(alpha[..., None] == 1, light / GAIN, light / 3)
    for one, other in ((layer(light, alpha), layer(spoilt)), (layer(light), layer(spoilt, alpha))):
        found = match_exposure(one, other, NOTHING, HDR)
        assert found.blocks <= (H // 8) * (W - 96) // 8 and np.allclose(found.gain, GAIN, rtol=1e-3)
        assert (found.spread < 1e-3).all()


# --- one exposure for both ------------------------------------------------------------------------------------------

STOP = np.float32(2)


def meet(first: np.ndarray, second: np.ndarray, floats: tuple[bool, bool] = LDR, stops: float = 0.0) -> tuple:
    return match_tones((layer(first), layer(second)), (PLACES, PLACES), NOTHING, floats, stops)


def shown(exposures: tuple, *lights: np.ndarray) -> list[np.ndarray]:
    return [one.applied(layer(light), PLACES).pixels for one, light in zip(exposures, lights, strict=True)]


def test_two_exposures_meet_between_their_own() -> None:
    light = scene(top=0.4)
    first, second = meet(light, light / STOP)
    assert first.gain == pytest.approx(STOP**-0.35, rel=1e-3) and second.gain == pytest.approx(STOP**0.65, rel=1e-3)
    both = shown((first, second), light, light / STOP)
    assert np.allclose(*both, atol=1e-4) and first.blocks == second.blocks > 500
    further = meet(light, light / 16)[0].gain
    assert further == pytest.approx(2**-TONE.most_reference_stops, rel=1e-3), "beyond two stops no further"


@pytest.mark.parametrize("stops", [-1.0, 1.5])
def test_stops_are_added_to_both(stops: float) -> None:
    light = scene(top=0.4)
    plain, more = meet(light, light / STOP), meet(light, light / STOP, stops=stops)
    for one, other in zip(plain, more, strict=True):
        assert other.gain == pytest.approx(one.gain * 2**stops, rel=1e-5)
    nowhere = layer(light, np.zeros((H, W), np.float32))
    alone = match_tones((layer(light), nowhere), (PLACES, PLACES), NOTHING, LDR, stops)
    assert all(one.gain == pytest.approx(2**stops) and not one.blocks and not one.why_not for one in alone)


@pytest.mark.parametrize("floats", [(True, True), (True, False), (False, True)])
def test_beside_float_pictures_radiance_is_kept(floats: tuple[bool, bool]) -> None:
    """At the reference's exposure, unbounded, without a curve."""
    light = 3 * scene(top=0.6)
    first, second = meet(light, light**1.3 / STOP, floats)
    assert (first.gain == 1).all() and first.curve is second.curve is None
    assert not first.keeps_white and not second.keeps_white and first.clipped is None
    assert shown((first, second), light, light)[0].max() == light.max() > 1.5


def test_vignetting_is_given_back_to_both() -> None:
    true = scene(top=0.45)
    lens = Vignetting(-0.15, -0.4)
    right = PictureMap(PLACES.x - W // 2, PLACES.y, (W, H))
    lights = [true * np.exp(lens.at(one.from_middle(np.s_[:, :])))[..., None] for one in (PLACES, right)]
    alpha = (PLACES.x >= W // 2).astype(np.float32)
    layers = layer(lights[0]), layer(lights[1] / STOP, alpha)
    for floats in (LDR, HDR):
        exposures = match_tones(layers, (PLACES, right), NOTHING, floats)
        assert exposures[0].vignetting == exposures[1].vignetting
        assert exposures[0].vignetting.corner == pytest.approx(-0.4, abs=0.04)
        both = [
            one.applied(part, at).pixels for one, part, at in zip(exposures, layers, (PLACES, right), strict=True)
        ]
        assert np.abs(both[0] / both[1] - 1)[:, W // 2 :][both[0][:, W // 2 :] < 0.5].max() < 0.03


def test_an_over_exposed_picture_learns_its_clipped_light_from_the_other() -> None:
    light = scene(top=0.45)
    light[:120] = [0.15, 0.3, 0.75]
    over = np.minimum(STOP * light, 1)
    for swapped in (False, True):
        pair = (over, light) if swapped else (light, over)
        exposures = meet(*pair)
        shares = [one.overexposed for one in exposures][:: -1 if swapped else 1]
        assert shares[0] == 0 and shares[1] == pytest.approx(0.5, abs=0.03)
        assert [one.clipped is None for one in exposures] == [not swapped, swapped]
        both = shown(exposures, *pair)
        assert np.abs(both[0] - both[1])[:116].max() < 0.05, "the sky is the same in both"


def with_gray_sky(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Two pictures of different white balance; in the first, the second's gray sky is white."""
    light = scene(top=0.3)
    light[:rows] = 0.8
    return np.clip(light * np.float32([2.4, 2.2, 1.6]), 0, 1), light


def test_white_balance_is_that_of_the_better_exposed() -> None:
    over, well = with_gray_sky(80)
    exposures = meet(over, well)
    assert np.ptp(exposures[1].gain) == pytest.approx(0, abs=1e-5)
    first, second = shown(exposures, over, well)
    assert np.ptp(second[:80], axis=2).max() < 0.01
    assert np.allclose(first[80:], second[80:], atol=0.02)
    assert np.ptp(meet(well, over)[0].gain) == pytest.approx(0, abs=1e-5)
    # as good as equally exposed: the reference's
    little = meet(*with_gray_sky(8))
    assert np.ptp(np.log(little[0].gain)) < 0.5 * np.ptp(np.log(little[1].gain))


def test_what_cannot_be_matched_is_said() -> None:
    light = scene(top=0.6)
    assert all(one.why_not == "" for one in meet(light, light / 16))
    first, second = meet(light, light / 100)
    assert (first.gain == second.gain).all() and first.why_not == "" and "6.6 stops" in second.why_not
    assert "clipped" in meet(light, np.ones_like(light))[1].why_not
    assert "clipped" in match_exposure(layer(light), layer(np.ones_like(light)), NOTHING, LDR).why_not
    assert "4.1 stops" in match_exposure(layer(light), layer(light / 17), NOTHING, LDR).why_not


def test_what_is_wanted_is_done() -> None:
    light = scene(top=0.4)
    layers = layer(light), layer(light / STOP)

    def of(wanted: object) -> list[float]:
        exposures = exposures_for(layers, (PLACES, PLACES), NOTHING, LDR, wanted)
        return [float(np.median(one.gain)) for one in exposures]

    assert of("none") == [1, 1]
    assert of("reference") == pytest.approx([1, 2], rel=1e-3)
    assert of("auto") == pytest.approx([2**-0.35, 2**0.65], rel=1e-3)
    assert of(1.0) == pytest.approx([2**0.65, 2**1.65], rel=1e-3)


def test_frames_of_a_clip_share_all_of_it() -> None:
    curve, table = ToneCurve(-0.2, -4.0, -1.0), ClippedLight((None, None, np.ones((4, 4), np.float32)))
    lens, gain = Vignetting(-0.1, -0.2), np.float32([2, 1, 1])
    plain = Exposure(gain, np.zeros(3, np.float32), 10, lens, curve, True, 0.1, table)
    frames = [plain, replace(plain, curve=replace(curve, slope=-0.4)), replace(plain, curve=replace(curve, slope=-0.1)),
              replace(plain, curve=None, gain=np.float32([9, 9, 9])), unchanged(3)]  # fmt: skip
    frames[1] = replace(frames[1], vignetting=Vignetting(-0.3, -0.6), overexposed=0.5, clipped=None)
    shared = pooled(frames)
    assert shared.curve == curve and shared.vignetting == plain.vignetting and shared.clipped is table
    assert (shared.gain.tolist(), shared.keeps_white, shared.overexposed, shared.blocks) == ([2, 1, 1], True, 0.1, 30)
    assert pooled([frames[3], frames[3], plain]).curve is None
