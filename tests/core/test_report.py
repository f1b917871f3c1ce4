"""The report says what was measured, in JSON's own words, and warns in plain ones."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.pipeline import StitchOptions, StitchResult
from edf_stitch.core.report import make_report, plain


def report_of(result: StitchResult, measure: bool = True, **changed: Any) -> tuple[dict[str, Any], list[str]]:
    parts = {
        "options": StitchOptions(measure=measure), "pictures": (result.reference, result.target),
        "cameras": result.cameras, "matches": result.matches, "two_view": result.two_view, "field": result.field,
        "warp": result.warp,
    }  # fmt: skip
    return make_report(**(parts | changed))


def test_numbers_json_has_no_word_for_become_null() -> None:
    value = {
        "nan": float("nan"), "inf": [np.inf, -np.float32("inf")], "array": np.array([[1.5, np.nan], [np.inf, 2]]),
        "deep": [{"tuple": (np.float64("nan"), 1)}],
    }  # fmt: skip
    assert plain(value) == {
        "nan": None, "inf": [None, None], "array": [[1.5, None], [None, 2.0]], "deep": [{"tuple": [None, 1]}]}


def test_numpys_numbers_become_pythons() -> None:
    value = plain({"i": np.int64(3), "b": np.bool_(True), "f": np.float32(0.5), "a": np.arange(2), "s": "word",
                   "n": None, "t": True, "flags": np.array([True]), "scalar": np.array(4.0)})  # fmt: skip
    assert value == {"i": 3, "b": True, "f": 0.5, "a": [0, 1], "s": "word", "n": None, "t": True, "flags": [True],
                     "scalar": 4.0}  # fmt: skip
    assert type(value["i"]) is int and type(value["b"]) is bool and type(value["f"]) is float
    json.dumps(value, allow_nan=False)


def test_the_report_agrees_with_the_result(result: StitchResult) -> None:
    report, view = result.report, result.two_view
    assert json.loads(json.dumps(report, allow_nan=False)) == report, "plain JSON, no NaN"
    assert report["canvas"] == {
        "width": result.alpha.shape[1], "height": result.alpha.shape[0], "offset": list(result.warp.canvas.offset),
        "cropped": False}
    assert report["matches"]["found"] == len(result.matches)
    assert report["matches"]["inliers"] == view.inliers.sum() <= len(result.matches)
    for name in ("K", "K_prime", "R", "t", "F", "H_inf", "e_prime"):
        assert np.array_equal(report["two_view"][name], getattr(view, name)), name
    assert report["two_view"]["model"] == "general" and "epipolar" in report["two_view"]["why"]
    assert report["two_view"]["focal_source"] == "given in px"
    assert report["field"]["centres"] + report["field"]["pruned"] == view.inliers.sum()
    assert report["field"]["kind"] == "strict" and report["field"]["plane"] == list(result.field.plane)
    for entry, array in zip(report["pictures"], (result.reference, result.target), strict=True):
        assert (entry["height"], entry["width"]) == array.view.shape[:2]
        assert (entry["name"], entry["bits"], entry["alpha"], entry["icc"]) == ("array", 8, False, False)
        assert entry["camera"]["fixed"] and entry["camera"]["focal_px"] == view.K[0, 0]
    assert report["options"] == {"field": "strict", "blend": "feather", "seed": 0}
    assert report["warnings"] == list(result.warnings)


def bilinear(values: np.ndarray, points: np.ndarray) -> np.ndarray:
    x0, y0 = np.floor(points).astype(int).T
    u, v = (points - np.floor(points)).T
    v00, v01, v10, v11 = values[y0, x0], values[y0, x0 + 1], values[y0 + 1, x0], values[y0 + 1, x0 + 1]
    return (v00 * (1 - u) + v01 * u) * (1 - v) + (v10 * (1 - u) + v11 * u) * v


def test_alignment_is_the_distance_from_the_map_to_the_matches(result: StitchResult) -> None:
    view, warp = result.two_view, result.warp
    x, y = result.matches.x[view.inliers], result.matches.y[view.inliers]
    at = x + warp.canvas.offset
    error = np.hypot(*(bilinear(m, at) - y[:, k] for k, m in enumerate((warp.map_x, warp.map_y))))
    measured = result.report["measured"]
    assert measured["alignment_median_px"] == pytest.approx(np.median(error), abs=1e-3)
    assert measured["alignment_p95_px"] == pytest.approx(np.percentile(error, 95), abs=5e-3)


def test_a_strict_field_is_reported_to_lie_on_its_epipolar_lines(result: StitchResult) -> None:
    """It does by construction (DESIGN 1), so anything above interpolation between float32 pixels is made up here."""
    assert result.report["measured"]["off_line_mean_px"] < 1e-3


def test_what_was_not_asked_for_or_has_no_meaning_is_not_measured(result: StitchResult) -> None:
    report, _ = report_of(result, measure=False)
    assert not [key for key in report["measured"] if key.startswith("overlap")]
    bent = replace(result.cameras[0], distortion=np.array([0.1, 0, 0, 0, 0]))
    report, _ = report_of(result, cameras=(bent, result.cameras[1]))
    assert report["measured"]["off_line_mean_px"] is None, "lines are not straight in a raw picture"
    report, _ = report_of(result, two_view=replace(result.two_view, F=np.full((3, 3), np.nan)))
    assert report["two_view"]["F"] == [[None] * 3] * 3 and report["measured"]["off_line_mean_px"] is None


def test_the_overlap_is_measured_on_the_8_bit_views(result: StitchResult) -> None:
    measured = result.report["measured"]
    shown = result.warp.inside((400, 300))
    x, y = result.warp.canvas.offset
    assert measured["overlap_px"] == shown[y : y + 300, x : x + 400].sum()
    assert 20 < measured["overlap_psnr_db"] < 60 and 0.5 < measured["overlap_ssim"] <= 1
    assert measured["folds"] == 0


def test_a_good_stitch_has_no_warnings(result: StitchResult) -> None:
    assert report_of(result)[1] == [] == list(result.warnings)


def test_each_doubt_is_said_in_words(result: StitchResult) -> None:
    _, said = report_of(result, field=replace(result.field, negative_share=0.021))
    assert len(said) == 1 and "2% of the points lie beyond infinity" in said[0] and "focal length (380 px)" in said[0]
    assert report_of(result, field=replace(result.field, negative_share=0.02))[1] == []
    canvas = replace(result.warp.canvas, cropped=True)
    report, said = report_of(result, warp=replace(result.warp, canvas=canvas))
    assert len(said) == 1 and "cropped" in said[0] and report["canvas"]["cropped"] is True
    map_x = result.warp.map_x.copy()
    shown = np.argwhere(result.warp.inside((400, 300)))
    (top, left), (bottom, right) = shown.min(axis=0), shown.max(axis=0)
    middle = slice((left + right) // 2 - 20, (left + right) // 2 + 20)
    map_x[top:bottom, middle] = map_x[top:bottom, middle][:, ::-1]
    report, said = report_of(result, warp=replace(result.warp, map_x=map_x))
    assert any("folds over" in one and "%" in one for one in said)
    assert report["measured"]["folds"] == pytest.approx(40 / 400, abs=0.03)


def test_nothing_in_it_tells_the_time_or_the_place(result: StitchResult) -> None:
    words = json.dumps(result.report).lower()
    assert not [word for word in ("second", "date", "time", "/tmp", "host") if f'"{word}' in words.replace(
        '"second focal', "")]
    assert report_of(result)[0] == report_of(result)[0]
