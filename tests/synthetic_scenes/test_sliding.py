"""From wherever a panorama is seen, what its pictures show lies on its rays; what does not is as far off as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.synthetic_scenes.measures import Truth, truth_of
from edf_stitch.synthetic_scenes.rendered import RenderedPair
from edf_stitch.synthetic_scenes.sliding import pair_beside_rays
from edf_stitch.synthetic_scenes.stitches import Shared, slid

from ..pairs import with_map


@pytest.fixture(scope="module")
def truth(rendered: RenderedPair) -> Truth:
    return truth_of(rendered)


@pytest.fixture(scope="module")
def shared() -> Shared:
    return {}


@pytest.fixture(scope="module")
def half(rendered: RenderedPair, shared: Shared) -> StitchResult:
    return slid(rendered, "known/slack", 0.5, shared)


def with_viewpoint(result: StitchResult, **parts: object) -> StitchResult:
    return replace(result, warp=replace(result.warp, viewpoint=replace(result.warp.viewpoint, **parts)))


def test_from_the_references_place_the_reference_has_no_error(
    rendered: RenderedPair, truth: Truth, shared: Shared
) -> None:
    off = pair_beside_rays(slid(rendered, "known/slack", 0.0, shared), rendered, truth)
    assert off["reference_p95_px"] < 0.01 and 0.01 < off["target_px"] < 0.3


def test_half_way_both_are_near_their_rays(rendered: RenderedPair, truth: Truth, half: StitchResult) -> None:
    off = pair_beside_rays(half, rendered, truth)
    assert 0 < off["reference_px"] < 0.2 and off["target_px"] < 0.3


def test_a_picture_that_is_off_its_rays_is_as_far_off_as_it_is(
    rendered: RenderedPair, truth: Truth, half: StitchResult
) -> None:
    found = half.warp.maps[1].arrays()
    warp = with_map(half.warp, found.x + np.float32(3), found.y + np.float32(4))
    moved = replace(half, warp=warp)
    before, after = (pair_beside_rays(one, rendered, truth) for one in (half, moved))
    assert after["target_px"] == pytest.approx(5, abs=0.3) and after["reference_px"] == before["reference_px"]


@pytest.mark.parametrize("s1", [-0.5, 0.0, 1.0])
def test_a_viewpoint_that_is_elsewhere_than_is_said_shows(
    s1: float, rendered: RenderedPair, truth: Truth, half: StitchResult
) -> None:
    off = pair_beside_rays(with_viewpoint(half, s1=s1), rendered, truth)
    assert max(off["reference_p95_px"], off["target_p95_px"]) > 2


def test_what_is_said_to_be_hidden_is_not_asked_for(rendered: RenderedPair, truth: Truth, half: StitchResult) -> None:
    nothing = np.ones_like(half.occluded[1])
    off = pair_beside_rays(replace(half, occluded=(half.occluded[0], nothing)), rendered, truth)
    assert np.isnan(off["target_px"]) and np.isfinite(off["reference_px"])
