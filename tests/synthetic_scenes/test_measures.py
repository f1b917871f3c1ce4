"""What a stitch is worth: a perfect map scores nothing off, and every figure sees the fault it is named after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import infinite_homography, rotation_from_vector
from edf_stitch.core.choices import RIVALS
from edf_stitch.core.compose.blend import averaged
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.synthetic_scenes.measures import (
    Truth,
    composition,
    figures,
    meeting,
    on_the_wide_canvas,
    truth_of,
    whole_picture,
)
from edf_stitch.synthetic_scenes.rendered import RenderedPair
from edf_stitch.synthetic_scenes.scene_pictures import scene_pictures
from edf_stitch.synthetic_scenes.stitches import WAYS, Shared, slid, stitched

from ..pairs import warp_of, with_map, with_two_view


@pytest.fixture(scope="module")
def shared() -> Shared:
    """Features and geometry of the rendered pair, found once."""
    return {}


@pytest.fixture(scope="module")
def truth(rendered: RenderedPair) -> Truth:
    return truth_of(rendered)


@pytest.fixture(scope="module")
def result(rendered: RenderedPair) -> StitchResult:
    return stitched(rendered, "known/strict")


@pytest.fixture(scope="module")
def perfect(result: StitchResult, truth: Truth) -> StitchResult:
    """The same with the true cameras, and the true map on the canvas of the true panorama."""
    g = truth.geometry
    height, width = truth.in_target.shape
    x, y = (np.where(truth.in_target, truth.target[..., k], -9).astype(np.float32) for k in range(2))
    canvas = replace(result.warp.canvas, width=width, height=height, offset=(-truth.corner[0], -truth.corner[1]))
    view = replace(
        result.edges[0].two_view, K=g.K, K_prime=g.K_prime, R=g.R, t=g.t, F=g.F, H_inf=g.H_inf, e_prime=g.e_prime
    )
    warp = warp_of(canvas, x, y, size=result.cameras[1].size, reference=result.cameras[0].size)
    alpha = (truth.in_target | truth.in_reference).astype(np.float32)
    pixels = np.zeros((height, width, 3), np.float32)
    return with_two_view(replace(result, warp=warp, panorama=Layer(pixels, alpha)), view)


def test_the_truth_scores_nothing_off(perfect: StitchResult, truth: Truth) -> None:
    found = figures(perfect, truth)
    for name in ("rotation_deg", "focal_percent", "h_inf_px", "h_inf_p95_px", "f_px"):
        assert abs(found[name]) < 1e-3, name
    assert found["epipole_deg"] < 1e-3
    for name in ("projectivity_p95_px", "alignment_p95_px", "beyond_px", "beyond_p90_px"):
        assert found[name] < 1e-3, name
    assert found["covered"] == 1 and found["overlap_psnr_db"] > 30


def moved(result: StitchResult, dx: float, dy: float) -> StitchResult:
    target = result.warp.maps[1].arrays()
    return replace(result, warp=with_map(result.warp, target.x + np.float32(dx), target.y + np.float32(dy)))


def test_a_map_that_is_off_is_off_by_as_much(perfect: StitchResult, truth: Truth) -> None:
    found, better = figures(moved(perfect, 3, 4), truth), figures(perfect, truth)
    assert found["alignment_px"] == pytest.approx(5, abs=0.01)
    assert found["alignment_p95_px"] == pytest.approx(5, abs=0.01)
    assert found["beyond_px"] == pytest.approx(5, abs=0.01)
    assert found["beyond_p90_px"] == pytest.approx(5, abs=0.01)
    assert found["projectivity_px"] > 1 and found["overlap_psnr_db"] < better["overlap_psnr_db"] - 5
    assert found["rotation_deg"] < 1e-3, "the cameras are as good as before"


def test_a_tenth_that_is_off_beyond_the_overlap_is_the_90th_percentiles_business(
    perfect: StitchResult, truth: Truth
) -> None:
    x = perfect.warp.maps[1].arrays().x.copy()
    rows, columns = np.nonzero(truth.in_target & ~truth.in_reference)
    x[rows[::8], columns[::8]] += 7
    found = figures(replace(perfect, warp=with_map(perfect.warp, x)), truth)
    assert found["beyond_px"] < 1e-3 and found["beyond_p90_px"] == pytest.approx(7, abs=0.01)


@pytest.fixture(scope="module")
def on_cylinder(rendered: RenderedPair, shared: Shared) -> StitchResult:
    return slid(rendered, "known/strict", 0.0, shared)


def test_pictures_meet_on_any_canvas(
    rendered: RenderedPair, truth: Truth, result: StitchResult, on_cylinder: StitchResult
) -> None:
    flat, found = (meeting(one, rendered, truth) for one in (result, on_cylinder))
    assert on_cylinder.warp.canvas.projection is not None and not result.warp.canvas.projection
    assert flat["meeting_px"] == pytest.approx(figures(result, truth)["alignment_px"], abs=0.02)
    assert found["meeting_px"] == pytest.approx(flat["meeting_px"], abs=0.02) and found["meeting_p95_px"] < 2


def test_pictures_that_do_not_meet_are_as_far_apart_as_they_are(
    rendered: RenderedPair, truth: Truth, on_cylinder: StitchResult
) -> None:
    off = meeting(moved(on_cylinder, 3, 4), rendered, truth)
    assert off["meeting_px"] == pytest.approx(5, abs=0.2)
    own, other = (picture_map.arrays() for picture_map in on_cylinder.warp.maps)
    warp = replace(on_cylinder.warp, maps=(replace(own, y=own.y + np.float32(2)), other))
    assert meeting(replace(on_cylinder, warp=warp), rendered, truth)["meeting_px"] == pytest.approx(2, abs=0.3)
    nothing = np.ones_like(on_cylinder.occluded[0])
    for occluded in ((nothing, on_cylinder.occluded[1]), (on_cylinder.occluded[0], nothing)):
        hidden = replace(on_cylinder, occluded=occluded)
        assert np.isnan(meeting(hidden, rendered, truth)["meeting_px"]), "what is hidden is not asked for"


def test_cameras_that_are_off_are_told(perfect: StitchResult, truth: Truth) -> None:
    view = perfect.edges[0].two_view
    R = rotation_from_vector(np.radians([0, 0.5, 0])) @ view.R
    turned = replace(view, R=R, H_inf=infinite_homography(view.K, view.K_prime, R))
    found = figures(with_two_view(perfect, turned), truth)
    assert found["rotation_deg"] == pytest.approx(0.5, abs=1e-6)
    focal = view.K_prime[0, 0]
    # half a degree moves the picture's middle by f tan 0.5°, and more towards its sides
    assert 1 < found["h_inf_px"] / (focal * np.tan(np.radians(0.5))) < 1.3 and found["alignment_px"] < 1e-3
    zoomed = replace(view, K=view.K * np.array([[1.03, 1, 1], [1, 1.03, 1], [1, 1, 1]]))
    assert figures(with_two_view(perfect, zoomed), truth)["focal_percent"] == pytest.approx(3)
    t = rotation_from_vector(np.radians([0, 0, 2.0])) @ view.t
    assert 0.1 < figures(with_two_view(perfect, replace(view, t=t)), truth)["epipole_deg"] <= 2.0 + 1e-9
    F = view.F.copy()
    F[2, 2] += 2 * np.hypot(*(F @ [150, 100, 1])[:2])
    assert figures(with_two_view(perfect, replace(view, F=F)), truth)["f_px"] == pytest.approx(2, rel=0.3)


def test_what_is_not_covered_is_missed(perfect: StitchResult, truth: Truth) -> None:
    alpha = perfect.alpha.copy()
    only = truth.in_target & ~truth.in_reference
    rows, columns = np.nonzero(only)
    alpha[rows[::2], columns[::2]] = 0
    less = replace(perfect, panorama=Layer(perfect.pixels, alpha))
    assert figures(less, truth)["covered"] == pytest.approx(0.5, abs=0.01)


def test_a_real_stitch_is_close(result: StitchResult, truth: Truth) -> None:
    found = figures(result, truth)
    assert found["rotation_deg"] < 0.1 and found["h_inf_px"] < 1 and found["projectivity_px"] < 0.3
    assert found["alignment_px"] < 0.6 and found["covered"] > 0.9
    picture, shown = on_the_wide_canvas(result, truth)
    assert shown.mean() > 0.5 and whole_picture(picture, shown, truth)["whole_psnr_db"] > 22
    shifted = np.roll(picture, 3, axis=1)
    assert whole_picture(shifted, shown, truth)["whole_psnr_db"] < 0.9 * whole_picture(picture, shown, truth)[
        "whole_psnr_db"]


def test_a_composition_is_held_against_the_plain_average(result: StitchResult, truth: Truth) -> None:
    found = composition(result, truth)
    average = averaged(*result.layers, result.layers[0].alpha > 0)
    plain, shown = on_the_wide_canvas(replace(result, panorama=average), truth)
    assert found["over_average_db"] > 0 and found["overlap_over_average_db"] > found["over_average_db"]
    there = found["composed_psnr_db"] - found["over_average_db"]
    assert there == pytest.approx(whole_picture(plain, shown, truth)["whole_psnr_db"], abs=0.1)
    assert found["source_fidelity_mean"] > 0.97 and found["seam_visibility"] < 2


@pytest.mark.parametrize("way", WAYS)
def test_every_way_stitches(way: str, rendered: RenderedPair, truth: Truth, shared: Shared) -> None:
    result = stitched(rendered, way, shared)
    found = figures(result, truth)
    assert found["alignment_px"] < 3 and found["covered"] > 0.7
    knows_nothing = way.endswith(RIVALS)
    if knows_nothing:
        assert np.isnan(found["rotation_deg"]) and np.isnan(found["f_px"]) and np.isnan(result.warp.inverse_depth).all()
    if way.startswith("unknown"):
        assert found["focal_percent"] != 0
    elif not knows_nothing:
        assert found["focal_percent"] == pytest.approx(0, abs=1e-4)


def test_the_report_has_every_picture(rendered: RenderedPair, truth: Truth, result: StitchResult) -> None:
    picture, _ = on_the_wide_canvas(result, truth)
    made = scene_pictures(rendered, truth, result, picture)
    assert set(made) == {"reference", "target", "stitch", "truth", "difference", "lines", "error_map"}
    assert all(data[:3] == b"\xff\xd8\xff" for data in made.values())


def test_what_ways_share_changes_nothing(rendered: RenderedPair) -> None:
    shared: Shared = {}
    stitched(rendered, "known/slack", shared)
    together, alone = stitched(rendered, "known/strict", shared), stitched(rendered, "known/strict")
    assert set(shared) == {"known"} and np.array_equal(together.warp.maps[1].x, alone.warp.maps[1].x, equal_nan=True)
    assert np.array_equal(together.pixels, alone.pixels)
