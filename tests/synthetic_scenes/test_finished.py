"""Panoramas as they are delivered: light that is off beyond the overlap costs, a gain does not; half a thing shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.raster.colour import decode
from edf_stitch.synthetic_scenes.finished import finished, target_only, target_only_together, things_half
from edf_stitch.synthetic_scenes.measures import Truth, common_part, on_the_wide_canvas, truth_of
from edf_stitch.synthetic_scenes.rendered import RenderedPair
from edf_stitch.synthetic_scenes.report_page import MEASURES
from edf_stitch.synthetic_scenes.stitches import delivered

# Rows and columns of the reference (320 × 240) that a thing takes, far from the overlap's rim.
THING = np.s_[80:120, 100:140]


@pytest.fixture(scope="module")
def result(rendered: RenderedPair) -> StitchResult:
    return delivered(rendered, "known/slack")


@pytest.fixture(scope="module")
def truth(rendered: RenderedPair) -> Truth:
    return truth_of(rendered)


def with_light(result: StitchResult, truth: Truth, gain: float, beyond: float) -> StitchResult:
    """The true panorama instead of the stitch: times a gain, and times another where the reference shows nothing."""
    here, there = common_part(result, truth)
    pixels = np.zeros_like(result.pixels)
    factor = np.where(truth.in_reference, gain, gain * beyond)[..., None]
    pixels[here] = (decode(truth.picture) * factor)[there]
    return replace(result, panorama=Layer(pixels, result.panorama.alpha))


def test_light_that_is_off_beyond_the_overlap_costs_and_one_gain_does_not(
    result: StitchResult, rendered: RenderedPair, truth: Truth
) -> None:
    same, brighter, wrong = (
        finished(with_light(result, truth, *light), rendered, truth)["delivered_target_only_psnr_db"]
        for light in ((1.0, 1.0), (0.7, 1.0), (1.0, 0.8))
    )
    assert min(same, brighter) > 45 and wrong < 30


def test_what_is_left_black_costs_beyond_the_overlap_but_not_over_what_all_show(
    result: StitchResult, truth: Truth
) -> None:
    right = with_light(result, truth, 1.0, 1.0)
    here, there = common_part(result, truth)
    alone = (truth.in_target & ~truth.in_reference)[there]
    last = int(np.flatnonzero(alone.any(axis=0))[-1])
    alpha = right.panorama.alpha.copy()
    alpha[here][:, last - 19 : last + 1] = 0
    less = replace(right, panorama=Layer(right.panorama.light * (alpha > 0)[..., None], alpha))
    whole, cut = target_only(right, truth), target_only(less, truth)
    assert cut["target_only_psnr_db"] < whole["target_only_psnr_db"] - 10
    assert cut["target_only_ssim"] < whole["target_only_ssim"] - 0.01
    picture, shown = on_the_wide_canvas(less, truth)
    together = target_only_together(picture, shown, truth)
    assert together["target_only_common_psnr_db"] > 45 and together["target_only_common_ssim"] > 0.99
    nothing = target_only_together(picture, np.zeros_like(shown), truth)
    assert np.isnan(list(nothing.values())).all()
    assert set(whole) | set(together) <= set(MEASURES), "each has its name on the page"


def test_a_thing_is_whole_or_gone_or_half_there(result: StitchResult, rendered: RenderedPair, truth: Truth) -> None:
    reference = np.zeros(rendered.reference.shape[:2], np.uint8)
    wide, target = np.zeros(truth.in_target.shape, np.uint8), np.zeros(rendered.target.shape[:2], np.uint8)
    reference[THING] = wide[rendered.frame][THING] = 1
    pair = replace(rendered, things={"reference": reference, "target": target, "wide": wide})
    x, y = result.warp.canvas.offset
    place = np.s_[y + THING[0].start : y + THING[0].stop, x + THING[1].start : x + THING[1].stop]

    def half(rows: slice) -> float:
        assert result.labels is not None
        labels = np.zeros_like(result.labels)
        labels[place][rows] = 1
        return things_half(replace(result, labels=labels), pair, truth)

    assert half(np.s_[:0]) == 0 and half(np.s_[:]) == 0, "whole in the reference, not in the target at all"
    assert half(np.s_[:20]) == pytest.approx(0.5) and half(np.s_[:10]) == pytest.approx(0.25)
    moved = replace(pair, things={**pair.things, "reference": np.roll(reference, 120, axis=1)})
    assert things_half(replace(result, labels=np.zeros_like(result.labels)), moved, truth) == pytest.approx(1.0)
