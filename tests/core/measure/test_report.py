"""The report says what was measured, in JSON's own words, and warns in plain ones."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.alignment import Alignment
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import homogeneous, project, rotation_from_vector
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.choices import FIELDS, RIVALS
from edf_stitch.core.field.folding import folds, turning
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.measure.report import make_report
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.warp import build_warp
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import ON_REFERENCE, warp_of, with_map


def report_of(
    result: StitchResult, measure: bool = True, holes: str = "transparent", inpainted: int = 0, open_px: int = 0,
    shows: np.ndarray | None = None, projection: str = "reference", **changed: Any
) -> tuple[dict[str, Any], list[str]]:
    """The report of a result in whose alignment something is changed."""
    cameras = changed.get("cameras", result.cameras)
    edge = replace(result.edges[0], two_view=changed.pop("two_view", result.edges[0].two_view))
    if "matches" in changed:
        found = changed.pop("matches")
        ideal = replace(found, x=undistort(found.x, cameras[0]), y=undistort(found.y, cameras[1]))
        edge = replace(edge, matches=found, ideal=ideal)
    views = views_of(edge.two_view, cameras)
    alignment = replace(Alignment(cameras, (edge,), views, result.field, result.warp, ()), **changed)
    decided = result.decided
    if "warp" in changed:  # what is hidden lies on the warp's own canvas
        hidden = np.zeros(alignment.warp.maps[1].x.shape, bool)
        further = replace(decided[1], hidden=hidden, folds=folds(turning(alignment.warp.maps[1].arrays())))
        decided = decided[0], further
    options = replace(ON_REFERENCE, measure=measure, holes=holes, projection=projection)
    return make_report(
        options, result.pictures, alignment, alignment.warp.canvas, decided, {},
        result.alpha > 0 if shows is None else shows, inpainted, open_px,
    )


@pytest.fixture(scope="module")
def strict(small_pair: Pair, known: StitchOptions) -> StitchResult:
    """The small pair by the strict field."""
    return stitch((small_pair.reference, small_pair.target), replace(known, field="strict"))


def with_holes(result: StitchResult, holes: int) -> StitchResult:
    return replace(result, decided=(result.decided[0], replace(result.decided[1], holes=holes)))


def test_holes_are_counted_and_said_where_they_matter(small_result: StitchResult) -> None:
    pixels = small_result.warp.maps[1].x.size
    for holes, said in ((0, False), (int(5e-5 * pixels), False), (int(2e-4 * pixels) + 1, True)):
        report, spoken = report_of(with_holes(small_result, holes))
        assert report["composition"]["hole_px"] == holes
        assert any(f"{holes} pixels were seen by neither camera" in line for line in spoken) == said
        assert any("; --crop reference shows none of them" in line for line in spoken) == said
        assert report["composition"]["inpainted_px"] == 0


def test_on_another_surface_the_references_crop_is_not_said_to_show_no_holes(small_result: StitchResult) -> None:
    """The reference's box holds more than the reference there, and holes of a viewpoint that slides."""
    views = small_result.views
    warp = build_warp(small_result.field, views, round_projection("cylindrical", views[0].K, np.eye(3)))
    spoken = report_of(with_holes(small_result, 10**6), measure=False, warp=warp, projection="cylindrical")[1]
    assert not any("; --crop reference" in line for line in spoken)
    assert any("; --projection reference --crop reference shows none of them" in line for line in spoken)


def test_what_small_holes_are_filled_is_not_said_to_be_open(small_result: StitchResult) -> None:
    most = int(2e-4 * small_result.warp.maps[1].x.size)
    for left, said in ((0, False), (1, False), (most + 1, True)):
        holed, filled = with_holes(small_result, most + 1), 3 * most  # not only what something near hid
        report, spoken = report_of(holed, holes="auto", inpainted=filled, open_px=left)
        assert report["composition"]["inpainted_px"] == filled
        assert any("pixels were seen by neither camera" in line for line in spoken) == said


def test_closed_holes_are_listed_where_they_are_large(small_result: StitchResult) -> None:
    shows = np.ones((100, 200), bool)
    shows[40:50, 60:80] = shows[10:13, 5:15] = shows[70:72, 30:32] = shows[:5] = False
    assert report_of(small_result, shows=shows)[0]["composition"]["holes"] == [[60, 40, 20, 10], [5, 10, 10, 3]]


def test_a_field_that_is_drawn_on_the_references_plane_says_so(small_result: StitchResult) -> None:
    for projection, said in (("auto", True), ("reference", False)):
        spoken = report_of(small_result, projection=projection)[1]
        assert any("knows the reference's plane only" in line for line in spoken) == said


def test_filled_holes_are_counted_and_said(small_result: StitchResult) -> None:
    holes = int(2e-4 * small_result.warp.maps[1].x.size) + 1
    report, spoken = report_of(with_holes(small_result, holes), holes="inpaint", inpainted=holes)
    assert report["composition"]["inpainted_px"] == report["composition"]["hole_px"] == holes
    assert any("filled smoothly" in line for line in spoken)


def test_the_report_agrees_with_the_result(result: StitchResult) -> None:
    report, view = result.report, result.edges[0].two_view
    assert json.loads(json.dumps(report, allow_nan=False)) == report, "plain JSON, no NaN"
    assert report["canvas"] == {
        "width": result.alpha.shape[1], "height": result.alpha.shape[0], "offset": list(result.warp.canvas.offset),
        "cropped": False, "projection": {
            "kind": "perspective", "focal_px": view.K[0, 0], "rotation": np.eye(3).tolist(), "level": [0.0, 0.0, 0.0],
            "centre": list(view.K[:2, 2] + result.warp.canvas.offset)},
        "box": [0, 0, *result.alpha.shape[::-1]], "whole": list(result.alpha.shape[::-1])}
    assert report["matches"]["found"] == len(result.edges[0].matches)
    assert report["matches"]["inliers"] == view.inliers.sum() <= len(result.edges[0].matches)
    for name in ("K", "K_prime", "R", "t", "F", "H_inf", "e_prime"):
        assert np.array_equal(report["two_view"][name], getattr(view, name)), name
    assert report["two_view"]["model"] == "general" and "epipolar" in report["two_view"]["why"]
    assert report["two_view"]["focal_source"] == "given in px"
    assert report["field"]["centres"] + report["field"]["pruned"] == view.inliers.sum()
    dense = report["field"]["dense"]
    assert dense["used"] and 0.5 < dense["found"] <= 1 and dense["across_px"] < 0.5 < dense["reach_px"]
    assert report["field"]["kind"] == "slack" and report["field"]["plane"] == list(result.field.plane)
    for entry, array in zip(report["pictures"], (result.pictures[0], result.pictures[1]), strict=True):
        assert (entry["height"], entry["width"]) == array.view.shape[:2]
        assert (entry["name"], entry["bits"], entry["alpha"], entry["icc"]) == ("array", 8, False, False)
        assert entry["camera"]["fixed"] and entry["camera"]["focal_px"] == view.K[0, 0]
    assert report["options"] == {
        "field": "slack", "fade": "plane", "dense": True, "projection": "reference", "level": "auto", "scale": 1.0,
        "crop": "full", "blend": "multiband", "seam": "graphcut", "exposure": "reference",
        "holes": "transparent", "seed": 0, "slide": 0, "centre": None, "fov": None,
        "scale_metres": None, "preview": False, "brackets": "auto"}
    assert report["composition"]["exposure_blocks"] > 100
    assert report["composition"]["exposure_gain"] == pytest.approx([1, 1, 1], abs=0.01)
    # nothing hides anything here: what dense refinement takes for an edge is next to nothing
    assert report["composition"]["occluded_px"] < result.canvas.width * result.canvas.height / 1000
    assert report["warnings"] == list(result.warnings)


def bilinear(values: np.ndarray, points: np.ndarray) -> np.ndarray:
    x0, y0 = np.floor(points).astype(int).T
    u, v = (points - np.floor(points)).T
    v00, v01, v10, v11 = values[y0, x0], values[y0, x0 + 1], values[y0 + 1, x0], values[y0 + 1, x0 + 1]
    return (v00 * (1 - u) + v01 * u) * (1 - v) + (v10 * (1 - u) + v11 * u) * v


def test_alignment_is_the_distance_from_the_map_to_the_matches(result: StitchResult) -> None:
    view, warp = result.edges[0].two_view, result.warp
    x, y = result.edges[0].matches.x[view.inliers], result.edges[0].matches.y[view.inliers]
    at = x + warp.canvas.offset
    error = np.hypot(*(bilinear(m, at) - y[:, k] for k, m in enumerate((warp.maps[1].x, warp.maps[1].y))))
    measured = result.report["measured"]
    assert measured["alignment_median_px"] == pytest.approx(np.median(error), abs=1e-3)
    assert measured["alignment_p95_px"] == pytest.approx(np.percentile(error, 95), abs=5e-3)


def test_a_strict_field_is_reported_to_lie_on_its_epipolar_lines(strict: StitchResult) -> None:
    """It does by construction (docs/method.md, 2), so anything above float32 pixels is made up here."""
    measured = strict.report["measured"]
    assert measured["off_line_mean_px"] < 1e-3 and measured["projectivity_own_px"] < 1e-3
    # another F from the same matches differs, but not by much
    assert 1e-3 < measured["projectivity_independent_px"] < 3 and measured["projectivity_points"] > 1000


def test_slack_is_reported_to_leave_them(small_result: StitchResult, strict: StitchResult) -> None:
    slack = small_result.report["measured"]
    assert 0.01 < slack["off_line_mean_px"] < 1
    assert strict.report["measured"]["projectivity_own_px"] < slack["projectivity_own_px"] < slack["off_line_mean_px"]


def test_held_out_matches_are_missed_by_more_than_fitted_ones(strict: StitchResult) -> None:
    measured, field = strict.report["measured"], strict.report["field"]
    assert field["residual_px"] < measured["held_out_rms_px"] < 3
    assert measured["held_out_median_px"] < measured["held_out_rms_px"] < measured["held_out_towards_rms_px"]
    assert measured["negative_share"] == field["negative_share"] == strict.field.fit.negative_share


MEASURED_ALWAYS = {"alignment_median_px", "alignment_p95_px", "off_line_mean_px", "negative_share", "folds"}
MEASURED_IF_ASKED = {
    "overlap_px", "overlap_psnr_db", "overlap_ssim", "projectivity_own_px", "projectivity_independent_px",
    "projectivity_points", "held_out_rms_px", "held_out_median_px", "held_out_towards_rms_px",
    "source_fidelity_mean", "source_fidelity_p5", "seam_visibility",
}  # fmt: skip


def test_what_was_not_asked_for_is_not_measured(small_result: StitchResult) -> None:
    quick, full = report_of(small_result, measure=False)[0]["measured"], small_result.report["measured"]
    assert set(quick) == MEASURED_ALWAYS and set(full) == MEASURED_ALWAYS | MEASURED_IF_ASKED
    assert None not in full.values() and quick == {key: full[key] for key in MEASURED_ALWAYS}


@pytest.mark.parametrize("name", FIELDS)
def test_without_parallax_what_has_no_meaning_is_null_without_a_word(small_result: StitchResult, name: str) -> None:
    """A rotation or a plane: H_inf is the homography between the pictures, and there is no epipolar geometry."""
    cameras, old = small_result.cameras, small_result.edges[0].two_view
    size = cameras[0].size
    nan = np.full((3, 3), np.nan)
    H = cameras[1].K @ rotation_from_vector(np.radians([1.0, -9, 2])) @ np.linalg.inv(cameras[0].K)
    random = np.random.default_rng(4)
    x = random.uniform((40, 10), (size[0] - 10, size[1] - 10), (200, 2))
    y = project(homogeneous(x) @ H.T) + random.normal(0, 0.2, x.shape)
    view = replace(
        old, model="rotation", R=nan, t=nan[0], F=nan, H_inf=H, e_prime=np.zeros(3), inliers=np.full(200, True)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field = fit_field(name, "plane", view, Matches(x, y), size, size)
        warp = build_warp(field, views_of(field.two_view, cameras))
        report, said = report_of(small_result, matches=Matches(x, y), two_view=field.two_view, field=field, warp=warp)
    measured = report["measured"]
    without_depth = {"negative_share"} if name in RIVALS else set()
    assert {key for key, value in measured.items() if value is None} == {
        "off_line_mean_px", "projectivity_own_px", "projectivity_independent_px", *without_depth}
    assert report["two_view"]["F"] == [[None] * 3] * 3 and report["two_view"]["t"] == [None] * 3
    assert measured["held_out_rms_px"] < 0.5 and measured["alignment_median_px"] < 0.5 and said == []


def test_through_a_lens_all_is_measured_in_ideal_pixels(by_hand: SimpleNamespace, small_result: StitchResult) -> None:
    """A slanted wall through barrels: in raw pixels its lines are bent, and by them everything would be px off."""
    height, width = small_result.pictures[0].view.shape[:2]
    camera = by_hand.camera((width, height), 220.0, (-0.2, 0.04))
    view = replace(by_hand.view(camera, camera, (2.0, -10, 3), (1, 0.1, 0.15)), inliers=np.full(300, True))
    x = np.random.default_rng(1).uniform(0, (width - 1, height - 1), (3000, 2))
    y = target_points(view, x, x @ np.array([6e-5, -1e-4]) + 0.12)
    raw = distort(x, camera), distort(y, camera)
    seen = np.all([(p >= 0).all(axis=1) & (p <= (width - 1, height - 1)).all(axis=1) for p in raw], axis=0)
    x, y = x[seen][:300], y[seen][:300]
    field = fit_field("strict", "plane", view, Matches(x, y), camera.size, camera.size)
    warp, matches = build_warp(field, views_of(view, (camera, camera))), Matches(raw[0][seen][:300], raw[1][seen][:300])
    report, _ = report_of(
        small_result, cameras=(camera, camera), matches=matches, two_view=view, field=field, warp=warp
    )
    for name, value in report["measured"].items():
        assert not name.endswith("_px") or name == "overlap_px" or value < 0.05, name


def test_a_target_within_the_reference_has_nothing_beyond(by_hand: SimpleNamespace, small_result: StitchResult) -> None:
    x, y = np.meshgrid(np.arange(240), np.arange(180))
    warp = warp_of(Canvas(240, 180, (0, 0)), x, y)
    measured = report_of(small_result, warp=warp)[0]["measured"]
    assert measured["projectivity_points"] == 0
    assert [key for key, value in measured.items() if value is None] == [
        "projectivity_own_px", "projectivity_independent_px", "held_out_towards_rms_px"]


def test_the_overlap_is_measured_on_the_8_bit_views(result: StitchResult) -> None:
    measured = result.report["measured"]
    shown = result.warp.maps[1].inside()
    x, y = result.warp.canvas.offset
    assert measured["overlap_px"] == shown[y : y + 300, x : x + 400].sum()
    assert 20 < measured["overlap_psnr_db"] < 60 and 0.5 < measured["overlap_ssim"] <= 1
    assert measured["folds"] < 1e-3


def test_a_good_stitch_has_no_warnings(result: StitchResult) -> None:
    assert report_of(result)[1] == [] == list(result.warnings)


def test_each_doubt_is_said_in_words(result: StitchResult) -> None:
    def beyond_infinity(share: float) -> list[str]:
        strict = result.field.strict
        field = replace(result.field, strict=replace(strict, fit=replace(strict.fit, negative_share=share)))
        return report_of(result, measure=False, field=field)[1]

    said = beyond_infinity(0.021)
    assert len(said) == 1 and "2% of the points lie beyond infinity" in said[0] and "focal length (380 px)" in said[0]
    assert beyond_infinity(0.02) == []
    canvas = replace(result.warp.canvas, cropped=True)
    report, said = report_of(result, measure=False, warp=replace(result.warp, canvas=canvas))
    assert len(said) == 1 and "cropped" in said[0] and report["canvas"]["cropped"] is True
    map_x = result.warp.maps[1].x.copy()
    shown = np.argwhere(result.warp.maps[1].inside())
    (top, left), (bottom, right) = shown.min(axis=0), shown.max(axis=0)
    middle = slice((left + right) // 2 - 20, (left + right) // 2 + 20)
    map_x[top:bottom, middle] = map_x[top:bottom, middle][:, ::-1]
    report, said = report_of(result, measure=False, warp=with_map(result.warp, map_x))
    assert any("folds over" in one and "%" in one for one in said)
    assert report["measured"]["folds"] == pytest.approx(40 / 400, abs=0.03)


def test_nothing_in_it_tells_the_time_or_the_place(result: StitchResult) -> None:
    words = json.dumps(result.report).lower()
    assert not [word for word in ("second", "date", "time", "/tmp", "host") if f'"{word}' in words.replace(
        '"second focal', "")]
    assert report_of(result)[0] == report_of(result)[0]
