"""Vignetting, gains and a curve that are known are found; what is not there is not made up."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.options import EXPOSURE
from edf_stitch.core.compose.tone.tone_blocks import Blocks
from edf_stitch.core.compose.tone.tone_fit import ToneFit, fit_tone
from edf_stitch.core.compose.tone.tone_options import TONE
from edf_stitch.core.compose.tone.toned import NO_VIGNETTING, ToneCurve, Vignetting

GAIN = np.array([1.6, 1.2, 0.9])
LENS = Vignetting(-0.15, -0.45)
ROWS, COLUMNS = 60, 80


def fitted(
    lens: Vignetting = NO_VIGNETTING, curve: ToneCurve | None = None, noise: float = 0.02, moved: float = 0.0,
    with_curve: bool = True, count: int | None = None, falls: float = 0.0, shadows: float = 0.0, bright: float = -0.3,
    part: float = 1.0,
) -> ToneFit:  # fmt: skip
    """The fit on an overlap of two pictures side by side, whose light differs by what is given.

    moved: share of the blocks that show something else; falls: by how much the added one gets darker from left to right
    for no reason of lens or tone; shadows: by how much the darkest 70 % of it are darker for each unit of log light;
    count, part: blocks, from the top and from the left, all by default; bright: the logarithm of the brightest light.
    """
    random = np.random.default_rng(0)
    at = np.argwhere(np.ones((ROWS, COLUMNS), bool))
    x, y = at[:, 1] / COLUMNS, at[:, 0] / ROWS - 0.5
    # the overlap is the right half of one picture and the left half of the other
    near, far = (np.minimum(1, ((middle - x) ** 2 + y**2) / 1.25) for middle in (0.0, 1.0))
    true = np.exp(random.uniform(-3.5, bright, (len(at), 1)) + random.normal(0, 0.2, (len(at), 3)))
    shown = true * np.exp(-0.0 if curve is None else -_of_target(true, curve))
    added = shown / GAIN * np.exp(lens.at(far) - falls * x)[:, None]
    before = true * np.exp(lens.at(near))[:, None]
    added *= np.exp(random.normal(0, noise, added.shape))
    before *= np.exp(random.normal(0, noise, added.shape))
    other = random.random(len(at)) < moved
    added[other] = random.uniform(0.05, 0.8, (other.sum(), 3))
    added *= np.exp(shadows * np.minimum(0, np.log(true) - np.quantile(np.log(true), 0.7)))
    some = np.flatnonzero(at[:, 1] < part * COLUMNS)[:count]
    blocks = Blocks((before[some], added[some]), at[some], (0.0, 0.0))
    return fit_tone(blocks, (near[some], far[some]), with_curve)


def _of_target(true: np.ndarray, curve: ToneCurve) -> np.ndarray:
    """The logarithm of the curve's gain by what it leads to: t = x + s (x − m) solved for x, s (x − m) is wanted."""
    middle = (curve.dark + curve.bright) / 2
    return curve.slope * (np.log(true) - middle) / (1 + curve.slope)


def test_gains_alone_where_nothing_else_differs() -> None:
    found = fitted()
    assert found.gain == pytest.approx(GAIN, rel=0.005) and (found.spread < 0.04).all()
    assert found.vignetting == NO_VIGNETTING and found.curve is None


@pytest.mark.parametrize("moved", [0.0, 0.2])
def test_vignetting_is_found_from_both_sides(moved: float) -> None:
    found = fitted(LENS, moved=moved)
    assert found.curve is None and found.gain == pytest.approx(GAIN, rel=0.03)
    for radius in (0.25, 0.5, 1.0):
        assert found.vignetting.at(radius) == pytest.approx(LENS.at(radius), abs=0.03)


@pytest.mark.parametrize("slope", [-0.25, 0.3])
def test_a_curve_is_found_with_and_without_vignetting(slope: float) -> None:
    curve = ToneCurve(slope, -4.0, -0.5)
    for lens in (NO_VIGNETTING, LENS):
        found = fitted(lens, curve)
        assert found.curve is not None and bool(found.vignetting) == bool(lens)
        assert found.curve.slope == pytest.approx(slope, abs=0.03)
        tones = np.log([[0.05], [0.1], [0.3]])
        # the curve is fitted on the added picture's own light
        own = np.exp(tones - _of_target(np.exp(tones), curve)) / GAIN
        back = own * found.gain * np.exp(found.curve.at(np.float32(np.log(own))))
        assert back == pytest.approx(np.exp(np.repeat(tones, 3, axis=1)), rel=0.06)


def test_gains_are_those_beside_the_vignetting() -> None:
    """On a part of the overlap that is nearer to the middle of one picture than to the other's."""
    found = fitted(LENS, part=0.4)
    assert found.vignetting and found.gain == pytest.approx(GAIN, rel=0.03)


def test_a_curve_has_to_help_in_the_dark_and_in_the_bright() -> None:
    """Where only shadows differ it would be wrong in the bright third, though it lowers the whole."""
    assert fitted(shadows=0.2).curve is None


def test_a_curve_ends_below_what_is_clipped() -> None:
    found = fitted(Vignetting(-0.3, -0.9), ToneCurve(-0.3, -4.0, 0.5), bright=1.0)
    assert found.curve is not None and found.curve.bright == pytest.approx(np.log(EXPOSURE.clipped_light))


def test_light_that_is_linear_has_no_curve() -> None:
    assert fitted(curve=ToneCurve(-0.25, -4.0, -0.5), with_curve=False).curve is None


def test_what_falls_from_side_to_side_is_no_lens() -> None:
    """It would be one that takes light off in the middle; and one that hardly takes any is not worth it."""
    assert not fitted(falls=0.5).vignetting
    assert not fitted(Vignetting(-0.005, -0.02)).vignetting
    assert not fitted(Vignetting(-0.05, -0.1), noise=0.12).vignetting, "noise hides it"


def test_noise_earns_neither() -> None:
    found = fitted(noise=0.3)
    assert found.vignetting == NO_VIGNETTING and found.curve is None


def test_too_few_blocks_tell_gains_alone() -> None:
    assert fitted(LENS, count=TONE.min_blocks - 1).vignetting == NO_VIGNETTING
    assert fitted(LENS, count=TONE.min_blocks - 1).gain.shape == (3,)


def test_what_cannot_be_tried_is_not_kept() -> None:
    """All blocks lie in one tile."""
    few = fitted(LENS, ToneCurve(-0.3, -4.0, -0.5), count=TONE.min_blocks)
    assert few.gain.shape == (3,)
