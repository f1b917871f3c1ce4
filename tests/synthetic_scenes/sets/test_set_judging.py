"""What is asked of sets, and what the page shows of it."""

from __future__ import annotations

import copy
from html.parser import HTMLParser
from typing import Any

import pytest
from edf_stitch.synthetic_scenes.limits import Check
from edf_stitch.synthetic_scenes.sets.recipes import SETS
from edf_stitch.synthetic_scenes.sets.set_thresholds import (
    BARS,
    BESIDE,
    BESIDE_MEASURES,
    LEAD,
    LEAST,
    OURS,
    PROOF,
    ROTATION_ONLY,
    set_checks,
)
from edf_stitch.synthetic_scenes.suites import heading
from edf_stitch.synthetic_scenes.thresholds import judge, medians
from edf_stitch.synthetic_scenes.validation_report import report_files, summary_lines


def measured(scene: str = "small_room") -> dict[str, Any]:
    """A set as it was when its bars were set."""
    ours, left = {bar.measure: bar.measured for bar in BARS[scene]}, heading(scene, (640, 480))["expected_left_out"]
    runs = {
        OURS: {"refused": "", "warnings": ["<odd>"], "used": 5, "left_out": left, "figures": {**ours, LEAD: 25.0},
               "by_picture": [{"picture": 0.0, "overlap_px": 0.25, "rotation_deg": 0.1}]},
        ROTATION_ONLY: {"refused": "", "warnings": [], "used": 5, "left_out": [], "by_picture": [],
                        "figures": {**ours, LEAD: 22.0}},
    }  # fmt: skip
    return {
        "schema": 1, **heading(scene, (640, 480)), "status": "done", "message": "", "blender": "", "made_from": "",
        "proof": {limit.measure: limit.at_least or 0.0 for limit in PROOF}, "runs": runs,
        "pictures": {kind: f"scenes/{scene}/{kind}.jpg" for kind in ("sphere", "panorama_ours", "from_above")},
    }  # fmt: skip


def failed(result: dict[str, Any]) -> list[str]:
    return [check.measure for check in set_checks(result) if not check.passed]


@pytest.mark.parametrize("scene", sorted(BARS))
def test_every_bar_holds_for_what_was_measured_and_none_is_loose(scene: str) -> None:
    assert failed(measured(scene)) == []
    for bar in BARS[scene]:
        if bar.at_most is not None:
            assert bar.at_most <= max(2 * abs(bar.measured), LEAST.get(bar.measure, 0.0)), bar
        if bar.at_least is not None:
            assert bar.at_least >= bar.measured - 1.01, bar


def test_every_set_has_bars() -> None:
    assert set(BARS) == set(SETS)
    beside = {scene for scene, bars in BARS.items() if {bar.measure for bar in bars} >= set(BESIDE_MEASURES)}
    assert beside == set(BESIDE) == set(SETS) - {"small_room"}


def test_what_lies_beside_its_ray_fails_from_one_place_and_from_a_place_that_slides() -> None:
    for name, figure in zip(BESIDE_MEASURES, BESIDE["ring"], strict=True):
        result = measured("ring")
        result["runs"][OURS]["figures"][name] = 1.29 * figure
        assert failed(result) == []
        result["runs"][OURS]["figures"][name] = 1.32 * figure
        assert failed(result) == [name]


@pytest.mark.parametrize("bar", BARS["small_room"], ids=lambda bar: bar.measure)
def test_a_figure_beyond_its_bar_fails_and_a_missing_one_too(bar: Any) -> None:
    result = measured()
    worse = 1.01 * bar.at_most if bar.at_most is not None else 0.99 * bar.at_least
    for value in ([worse, -worse] if bar.absolute else [worse]) + [None, float("nan")]:
        result["runs"][OURS]["figures"][bar.measure] = value
        assert bar.measure in failed(result)


@pytest.mark.parametrize("limit", PROOF, ids=lambda limit: limit.measure)
def test_a_truth_that_does_not_prove_itself_fails(limit: Any) -> None:
    result = measured()
    result["proof"][limit.measure] = 1e9 if limit.at_most is not None else 0.0
    assert failed(result) == [limit.measure]


def test_pictures_left_out_must_be_exactly_those_of_another_place() -> None:
    result = measured()
    result["runs"][OURS]["left_out"] = ["03"]
    assert failed(result) == ["left_out"]
    result["expected_left_out"] = ["03"]
    assert failed(result) == []
    result["runs"][OURS]["refused"] = "nothing connects"
    assert "left_out" in failed(result)


def test_one_place_for_all_must_be_worse_where_there_is_parallax() -> None:
    result = measured()
    result["runs"][ROTATION_ONLY]["figures"][LEAD] = 99.0
    assert failed(result) == ["common_psnr_db over rotation only"]
    result["parallax"] = False
    assert failed(result) == []


def test_sets_are_judged_beside_pairs_and_enter_no_median() -> None:
    result = measured()
    verdict = judge([result], complete=False)
    assert verdict.passed and all(isinstance(check, Check) for check in verdict.checks)
    assert judge([result], complete=True).passed, "of a suite without pairs no median is due"
    assert all(middle.scenes == 0 for middle in medians([result]))
    crashed = copy.deepcopy(result) | {"status": "failed", "message": "gone", "runs": {}, "proof": {}}
    assert [check.measure for check in judge([crashed], complete=False).failed] == ["status"]


def test_the_report_shows_sets_and_what_was_measured_when_bars_were_set() -> None:
    result = measured()
    files = report_files([result], "sets", False, "1.0")
    page = files["report.html"].decode()
    for text in ("Sets of many pictures", "True sphere", "From above", "measured then", 'id="scene-small_room"',
                 "&lt;odd&gt;", "Each picture", "<th class=n>rotation</th>"):  # fmt: skip
        assert text in page, text
    assert "The suite’s bars" not in page and "Outside the overlap" not in page, "there is no pair"
    assert b"small_room" in files["report.csv"] and b"rotation_max_deg" in files["report.csv"]
    lines = summary_lines(judge([result], complete=False), [result])
    assert lines[0].startswith("PASSED: 1 of 1 scenes") and len(lines) == 1


class Sliders(HTMLParser):
    """The pictures and inputs inside each slider of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[list[dict[str, str | None]]] = []
        self.depth = 0
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        held = dict(attrs)
        if tag == "div" and (self.depth or held.get("class") == "slider"):
            self.depth += 1
            self.found += [[]] if self.depth == 1 else []
        if self.depth and tag in ("img", "input"):
            self.found[-1].append({"tag": tag, **held})

    def handle_endtag(self, tag: str) -> None:
        self.depth -= tag == "div" and self.depth > 0


def test_true_and_ours_lie_one_over_the_other_under_a_slider() -> None:
    result = measured()
    page = report_files([result], "sets", False, "1.0")["report.html"].decode()
    ((under, over, moved),) = Sliders(page).found
    assert under["src"] == "scenes/small_room/sphere.jpg" and over["src"] == "scenes/small_room/panorama_ours.jpg"
    assert over["class"] == "over" and moved["type"] == "range"
    # the input sets what the upper picture is cut by
    assert "'--at', this.value + '%'" in str(moved["oninput"]) and "clip-path: inset(0 0 0 var(--at))" in page
    assert 'src="http' not in page and "<script" not in page
    del result["pictures"]["panorama_ours"]
    page = report_files([result], "sets", False, "1.0")["report.html"].decode()
    assert not Sliders(page).found, "of one picture there is nothing to compare"
