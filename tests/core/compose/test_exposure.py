"""The gain is found whatever is clipped, moved or hidden; the reference is never touched."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.exposure import Exposure, match_exposure, pooled, unchanged
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
