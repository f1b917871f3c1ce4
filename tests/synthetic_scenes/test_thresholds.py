"""Every limit of the validation flips where it says, and nothing that is missing passes."""

from __future__ import annotations

import math
from copy import deepcopy
from typing import Any

import pytest
from edf_stitch.core.choices import RIVALS as ALL_RIVALS
from edf_stitch.synthetic_scenes.pair_bars import MEASURED, MEASURES, RUN, Measure, measured, own_limits
from edf_stitch.synthetic_scenes.recipes import FULL, QUICK, RECIPES
from edf_stitch.synthetic_scenes.stitches import WAYS as ALL_WAYS
from edf_stitch.synthetic_scenes.thresholds import (
    CUT_SCENES,
    MODEL_RUNS,
    RIVALS,
    SUITE,
    Check,
    judge,
    medians,
    nearer_than_homography,
)

WAYS = ("known/strict", "known/slack", *RIVALS, "unknown/strict", "unknown/slack")
FIGURES = {
    "rotation_deg": 0.01, "focal_percent": -0.5, "h_inf_px": 0.2, "projectivity_px": 0.05, "alignment_px": 0.1,
    "whole_psnr_db": 30.0, "whole_ssim": 0.9, "over_average_db": 1.0, "over_average_ssim": 0.01,
    "overlap_over_average_db": 9.0, "source_fidelity_mean": 0.99, "source_fidelity_p5": 0.95, "seam_visibility": 0.5,
    "beyond_px": 0.2, "beyond_p90_px": 1.0, "slid_auto_px": 0.1, "slid_auto_p95_px": 0.5, "slid_half_px": 0.1,
    "slid_half_p95_px": 0.5, "slid_auto_reference_px": 0.0,
}  # fmt: skip
PROOF = {
    "position_px": 0.001, "depth_relative": 1e-7, "ray_cast_relative": 1e-6, "f_px": 0.001, "warp_psnr_db": 40.0,
    "half_pixel_psnr_db": 30.0, "wide_psnr_db": 50.0,
}  # fmt: skip


def good(name: str = "street", model: str = "general", determined: bool = True) -> dict[str, Any]:
    """A scene's result as a perfect program leaves it."""
    runs = {
        way: {"model": None if way in RIVALS[1:] else model, "undetermined_said": not determined,
              "refused": "", "warnings": [], "figures": dict(FIGURES)}
        for way in WAYS
    }  # fmt: skip
    for rival in RIVALS:
        runs[rival]["figures"] |= {"whole_psnr_db": 28.0, "beyond_px": 9.0}
    return {
        "schema": 1, "scene": name, "title": "A street", "size": [640, 480], "expected_model": model,
        "parallax": model == "general", "focal_determined": determined, "status": "done", "message": "",
        "proof": dict(PROOF), "runs": runs, "pictures": {},
    }  # fmt: skip


def crashed(name: str = "foliage") -> dict[str, Any]:
    return {**good(name), "status": "failed", "message": "Segmentation fault", "proof": {}, "runs": {}}


def failures(*results: dict[str, Any], complete: bool = False) -> list[tuple[str | None, str, str]]:
    return [(check.scene, check.run, check.measure) for check in judge(results, complete).failed]


def with_figure(run: str, measure: str, value: float | None) -> dict[str, Any]:
    result = good()
    (result["proof"] if run == "proof" else result["runs"][run]["figures"])[measure] = value
    return result


SCENE_LIMITS = [
    ("proof", "position_px", 0.01, 1), ("proof", "depth_relative", 1e-5, 1), ("proof", "ray_cast_relative", 1e-5, 1),
    ("proof", "f_px", 0.01, 1), ("proof", "warp_psnr_db", 35.0, -1), ("proof", "wide_psnr_db", 35.0, -1),
    ("known/strict", "rotation_deg", 0.15, 1), ("known/strict", "h_inf_px", 5.0, 1),
    ("known/strict", "projectivity_px", 1.5, 1), ("known/strict", "alignment_px", 2.0, 1),
    ("known/slack", "over_average_db", 0.0, -1), ("known/slack", "over_average_ssim", 0.0, -1),
    ("known/slack", "source_fidelity_mean", 0.97, -1), ("known/slack", "source_fidelity_p5", 0.85, -1),
    ("known/slack", "seam_visibility", 2.0, 1),
    ("known/slack", "slid_auto_px", 1.75, 1), ("known/slack", "slid_half_px", 1.75, 1),
    ("known/slack", "slid_auto_reference_px", 0.2, 1),
]  # fmt: skip
SUITE_LIMITS = [
    ("known/strict", "rotation_deg", 0.02), ("known/strict", "h_inf_px", 0.2),
    ("known/strict", "projectivity_px", 0.05), ("known/strict", "alignment_px", 0.12),
    ("unknown/strict", "focal_percent", 3.0), ("unknown/strict", "focal_percent", -3.0),
    ("unknown/strict", "projectivity_px", 0.3),
    ("known/slack", "beyond_px", 0.72), ("known/slack", "beyond_p90_px", 2.0),
    ("known/slack", "slid_auto_px", 0.12), ("known/slack", "slid_auto_p95_px", 0.6),
    ("known/slack", "slid_half_px", 0.12), ("known/slack", "slid_half_p95_px", 0.6),
]  # fmt: skip


def test_good_scenes_pass() -> None:
    scenes = [good(), good("toe_in", determined=False), good("turn", "rotation"), good("wall", "plane", False)]
    for complete in (False, True):
        verdict = judge(scenes, complete)
        assert verdict.passed and not verdict.failed and verdict.complete == complete


@pytest.mark.parametrize(("run", "measure", "limit", "worse"), SCENE_LIMITS)
def test_a_scenes_limits_flip_where_they_stand(run: str, measure: str, limit: float, worse: int) -> None:
    assert not failures(with_figure(run, measure, limit))
    beyond = math.nextafter(limit, worse * math.inf)
    assert failures(with_figure(run, measure, beyond)) == [("street", run, measure)]
    (check,) = judge([with_figure(run, measure, beyond)], False).failed
    assert check.value == beyond and f"{limit:g}" in check.limit and check.limit[0] == ("≤" if worse > 0 else "≥")


def of_suite(name: str, side: int) -> dict[str, Any]:
    """A scene of a suite as it was when its own bars were set."""
    result = {**good(name), "size": [side * 3 // 4, side]}
    result["runs"][RUN]["figures"] |= measured(name, (side * 3 // 4, side))
    return result


@pytest.mark.parametrize(("side", "scenes"), [(1280, FULL), (640, QUICK)])
def test_every_scene_of_a_suite_has_bars_and_no_other(side: int, scenes: tuple[str, ...]) -> None:
    assert set(MEASURED[side]) == set(scenes)
    assert measured("street", (640, 480)) == {} == measured("street:noise=3", (1280, 960))


@pytest.mark.parametrize(("side", "scene"), [(side, scene) for side, scenes in MEASURED.items() for scene in scenes])
def test_a_scenes_own_bars_hold_for_what_was_measured_and_none_is_loose(side: int, scene: str) -> None:
    result = of_suite(scene, side)
    own = {limit.measure: limit for limit in own_limits(result)}
    known = measured(scene, (side, side * 3 // 4))
    assert own and set(own) == set(known)
    assert not {failure for failure in failures(result) if failure[2] in own and failure[1] == RUN}
    least = {one.name: one.least for one in MEASURES}
    for name, limit in own.items():
        if limit.at_least is not None:
            assert known[name] - 1.05 <= limit.at_least <= known[name] - 0.95
        else:
            assert known[name] < limit.at_most <= max(1.31 * known[name], least[name])


@pytest.mark.parametrize("measure", MEASURES, ids=lambda one: one.name)
def test_a_figure_beyond_its_scenes_own_bar_fails_and_a_missing_one_too(measure: Measure) -> None:
    result = of_suite("two_planes", 1280)
    (limit,) = (limit for limit in own_limits(result) if limit.measure == measure.name)
    edge, worse = (limit.at_most, 1) if limit.at_most is not None else (limit.at_least, -1)
    for value, failed in ((edge, False), (math.nextafter(edge, worse * math.inf), True), (None, True)):
        result["runs"][RUN]["figures"][measure.name] = value
        assert (("two_planes", RUN, measure.name) in failures(result)) == failed


def test_a_suite_says_where_one_homography_is_nearer_beyond_the_overlap() -> None:
    scenes = [good(name) for name in ("street", "relief", "toe_in", "wide")]
    for result, theirs in zip(scenes, (0.3, 0.3, 0.3, 0.1), strict=True):
        result["runs"]["known/homography"]["figures"]["beyond_px"] = theirs
    assert nearer_than_homography(scenes) == (3, 4) and not failures(*scenes, complete=True)
    scenes[0]["runs"]["known/slack"]["figures"]["beyond_px"] = 0.3
    assert nearer_than_homography(scenes) == (2, 4)
    assert failures(*scenes, complete=True) == [(None, "known/slack", "nearer_scenes")] and not failures(*scenes)
    scenes[0]["runs"]["known/slack"]["figures"]["beyond_px"] = None
    assert nearer_than_homography(scenes) == (2, 4), "what is missing is not nearer"
    scenes[3]["runs"]["known/homography"] = {"figures": {}, "refused": "no"}
    assert nearer_than_homography(scenes) == (2, 3)


@pytest.mark.parametrize(("scenes", "fewest"), [(4, 3), (19, 15), (23, 18)])
def test_ours_is_nearer_in_fifteen_of_nineteen_scenes(scenes: int, fewest: int) -> None:
    results = [good() for _ in range(scenes)]
    for result in results[fewest:]:
        result["runs"]["known/homography"]["figures"]["beyond_px"] = 0.1
    assert not failures(*results, complete=True)
    results[0]["runs"]["known/homography"]["figures"]["beyond_px"] = 0.1
    assert failures(*results, complete=True) == [(None, "known/slack", "nearer_scenes")]


@pytest.mark.parametrize("rival", RIVALS)
def test_what_the_target_alone_shows_is_at_least_as_near_the_truth_as_any_rivals(rival: str) -> None:
    result, worse = good(), ("street", "known/slack", f"target_only_common_psnr_db over {rival}")
    result["runs"][rival]["figures"]["target_only_common_psnr_db"] = 25.0
    for ours, failed in ((25.0, []), (24.999, [worse]), (None, [worse])):
        result["runs"]["known/slack"]["figures"]["target_only_common_psnr_db"] = ours
        assert failures(result) == failed
    result["runs"][rival].update(refused="too few matches", figures={})
    assert not failures(result)


def test_what_a_map_leaves_black_is_held_by_the_scenes_own_bar_and_by_no_rivals_figure() -> None:
    result = good()
    result["runs"]["known/rew"]["figures"]["target_only_psnr_db"] = 60.0
    assert not failures(result)
    result["size"], ours = [1280, 960], result["runs"]["known/slack"]["figures"]
    for black, fails in ((30.0, False), (10.0, True)):
        ours["target_only_psnr_db"] = black
        assert (("street", "known/slack", "target_only_psnr_db") in failures(result)) is fails


@pytest.mark.parametrize("scene", CUT_SCENES)
def test_a_thing_that_a_border_cuts_is_whole_or_gone(scene: str) -> None:
    assert scene in RECIPES
    result = good(scene)
    figures = result["runs"]["known/slack"]["figures"]
    for half, failed in ((0.1, []), (math.nextafter(0.1, 1), ["things_half"]), (None, ["things_half"])):
        figures |= {"things_half": half, "delivered_target_only_psnr_db": 20.0}
        assert [measure for _, _, measure in failures(result)] == failed
    figures["things_half"], figures["delivered_target_only_psnr_db"] = 0.0, None
    assert [measure for _, _, measure in failures(result)] == ["delivered_target_only_psnr_db"]


@pytest.mark.parametrize("model", ["rotation", "plane"])
def test_a_composition_is_judged_without_parallax_too(model: str) -> None:
    result = good(model=model)
    result["runs"]["known/slack"]["figures"] |= {"over_average_db": -0.01, "seam_visibility": 2.1}
    assert {failure[2] for failure in failures(result)} == {"over_average_db", "seam_visibility"}


def test_half_a_pixel_must_cost_a_decibel() -> None:
    assert not failures(with_figure("proof", "half_pixel_psnr_db", 39.0))
    assert failures(with_figure("proof", "half_pixel_psnr_db", 39.001)) == [("street", "proof", "half_pixel_loss_db")]


@pytest.mark.parametrize(("run", "measure", "limit"), SUITE_LIMITS)
def test_the_suites_limits_flip_where_they_stand_and_are_of_medians(run: str, measure: str, limit: float) -> None:
    beyond = limit * (1 + 1e-9)
    for value, expected in ((limit, []), (beyond, [(None, run, measure)])):
        scenes = [with_figure(run, measure, each) for each in (0.0, value, 5 * value)]
        failed = [failure for failure in failures(*scenes, complete=True) if failure[0] is None]
        assert failed == expected
        assert not [failure for failure in failures(*scenes) if failure[0] is None], "no suite, no medians"


@pytest.mark.parametrize("run_and_measure", [limit[:2] for limit in SCENE_LIMITS + SUITE_LIMITS]
                         + [("proof", "half_pixel_psnr_db")], ids="-".join)  # fmt: skip
@pytest.mark.parametrize("gone", [None, math.nan, "absent"])
def test_a_value_that_is_missing_where_one_is_due_fails(run_and_measure: tuple[str, str], gone: Any) -> None:
    result = with_figure(*run_and_measure, gone)
    if gone == "absent":
        del (result["proof"] if run_and_measure[0] == "proof" else result["runs"][run_and_measure[0]]["figures"])[
            run_and_measure[1]
        ]
    assert failures(result)


def test_a_missing_value_counts_as_the_worst_in_a_median() -> None:
    scenes = [good(), with_figure("known/strict", "rotation_deg", None)]
    middle = medians(scenes)[0]
    assert (middle.value, middle.scenes, middle.missing, middle.passed) == (None, 2, 1, False)
    middle = medians([*scenes, with_figure("known/strict", "rotation_deg", 0.02)])[0]
    assert (middle.value, middle.scenes, middle.missing, middle.passed) == (0.02, 3, 1, True)


def test_medians_are_of_scenes_with_parallax_the_focal_lengths_of_those_that_determine_it() -> None:
    bad = {"rotation_deg": 9.0, "focal_percent": 50.0, "projectivity_px": None, "whole_psnr_db": 1.0}
    others = [good("turn", "rotation"), good("wall", "plane"), good("toe_in", determined=False)]
    for result in others:
        for way in ("known/strict", "unknown/strict"):
            result["runs"][way]["figures"].update(bad if not result["parallax"] else {"focal_percent": 50.0})
    assert judge([good(), *others], True).passed
    middles = medians([good(), *others])
    assert all(middle.scenes == (1 if middle.limit.measure == "focal_percent" else 2) for middle in middles)


@pytest.mark.parametrize("model", ["general", "rotation", "plane"])
@pytest.mark.parametrize("way", MODEL_RUNS)
def test_the_model_must_be_right_in_every_run(way: str, model: str) -> None:
    for changed in ({"model": "rotation" if model != "rotation" else "general"}, {"model": None}, {"refused": "no"}):
        result = good(model=model)
        result["runs"][way].update(changed)
        assert ("street", way, "model") in failures(result), changed
    result = good(model=model)
    del result["runs"][way]
    assert ("street", way, "model") in failures(result)


def test_an_undetermined_focal_length_must_be_said_where_it_shows() -> None:
    result = good("toe_in", determined=False)
    result["runs"]["unknown/slack"]["undetermined_said"] = False
    assert not failures(result)
    result["runs"]["unknown/strict"]["undetermined_said"] = False
    assert failures(result) == [("toe_in", "unknown/strict", "undetermined_said")]
    plane = good("wall", "plane", determined=False)
    plane["runs"]["unknown/strict"]["undetermined_said"] = False
    assert not failures(plane)


@pytest.mark.parametrize("rival", RIVALS)
def test_no_rival_is_better_by_more_than_a_fifth_of_a_decibel(rival: str) -> None:
    assert not failures(with_figure(rival, "whole_psnr_db", 30.2))
    worse = ("street", "known/strict", f"whole_psnr_db over {rival}")
    assert failures(with_figure(rival, "whole_psnr_db", 30.201)) == [worse]
    assert failures(with_figure(rival, "whole_psnr_db", None)) == [worse]
    flat = good(model="plane")
    flat["runs"][rival]["figures"]["whole_psnr_db"] = 40.0
    assert not failures(flat), "without parallax nobody competes"
    for gone in ("refused", "absent"):
        result = with_figure(rival, "whole_psnr_db", 40.0)
        if gone == "refused":
            result["runs"][rival].update(refused="too few matches", figures={})
        else:
            del result["runs"][rival]
        assert not failures(result)


def test_the_rivals_are_all_that_the_house_has() -> None:
    assert RIVALS == ("known/paper", *(f"known/{name}" for name in ALL_RIVALS)) and set(RIVALS) < set(ALL_WAYS)


def test_with_no_rival_at_all_nothing_is_shown() -> None:
    result = good()
    for rival in RIVALS:
        del result["runs"][rival]
    assert failures(result) == [("street", "known/strict", "whole_psnr_db over any rival")]


def test_the_median_lead_is_over_the_best_rival_of_each_scene() -> None:
    assert not failures(with_figure("known/paper", "whole_psnr_db", 29.0), complete=True)
    for rival in RIVALS:
        failed = failures(with_figure(rival, "whole_psnr_db", 29.001), complete=True)
        assert failed == [(None, "known/strict", "lead_db")]


def test_a_failed_scene_fails_the_verdict() -> None:
    assert failures(good(), crashed()) == [("foliage", "", "status")]
    verdict = judge([good(), good("relief"), crashed()], True)
    assert not verdict.passed and [check.scene for check in verdict.failed] == ["foliage"]
    assert all(middle.missing == 1 for middle in medians([good(), crashed()]))


def test_an_empty_list_fails() -> None:
    for complete in (False, True):
        assert not judge([], complete).passed
    assert Check(None, "", "scenes", 0.0, "≥ 1", "", False) in judge([], True).checks


def test_a_suite_without_parallax_has_no_medians_to_pass() -> None:
    assert judge([good(model="rotation")], False).passed
    assert len(failures(good(model="rotation"), complete=True)) == len(SUITE)


def test_judging_changes_nothing() -> None:
    result = good()
    before = deepcopy(result)
    judge([result], True)
    assert result == before
