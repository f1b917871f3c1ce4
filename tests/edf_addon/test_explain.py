"""A report in an artist's words."""

from __future__ import annotations

import pytest

explain = pytest.importorskip("edf_stitch.edf_addon.explain")


def test_a_report_becomes_facts_in_the_order_of_interest(small_result):
    report = small_result.report
    facts = dict(explain.facts(report))
    assert list(facts)[:5] == ["Verdict", "Model", "Size", "Matches", "Inliers"]
    assert facts["Verdict"] == "Good"
    assert facts["Model"] == "General scene"
    assert facts["Size"] == f"{report['canvas']['width']} × {report['canvas']['height']} px"
    assert facts["Inliers"].startswith(f"{report['matches']['inliers']} (") and facts["Inliers"].endswith("%)")
    assert facts["Focal"] == f"{report['two_view']['focal_px'][0]:.0f} px"
    assert facts["Source"] == report["two_view"]["focal_source"]
    assert facts["Alignment"].startswith(f"{report['measured']['alignment_median_px']:.2f} px")
    assert facts["Projectivity"] == f"{report['measured']['projectivity_independent_px']:.2f} px"


def test_a_verdict_is_told_with_its_places(small_result):
    places = [{"box": [3, 4, 50, 60], "what": "something moved"}]
    verdict = {"is": "look", "because": "x", "what_to_do": "fill holes (--holes inpaint)", "places": places}
    look = {**small_result.report, "verdict": verdict}
    assert explain.facts(look)[:3] == [
        ("Verdict", "Look at these places"), ("", "3, 4 (50 × 60 px from the upper left): something moved"),
        ("", "Fill holes (Holes ▸ Inpaint under Output)."),
    ]  # fmt: skip
    everywhere = {**look, "verdict": {**verdict, "places": []}}
    assert explain.facts(everywhere)[:2] == [("Verdict", "Look at it"), ("", "X.")]
    assert explain.verdict_in_short(everywhere) == "look at it: x"
    assert explain.verdict_in_short(look) == "look at 1 place (see Result)"
    worse = {**look, "verdict": {**verdict, "is": "not usable", "because": "it is mirrored"}}
    assert explain.facts(worse)[:2] == [("Verdict", "Not usable"), ("", "It is mirrored.")]
    assert explain.verdict_in_short(worse) == "not usable: it is mirrored"
    assert explain.verdict_in_short(small_result.report) == "" == explain.verdict_in_short({})
    assert "Verdict" not in dict(explain.facts({**look, "verdict": None})), "of an earlier release"


def test_a_preview_measures_less_and_says_what_it_knows(small_result):
    measured = {
        key: value for key, value in small_result.report["measured"].items()
        if key in {"alignment_median_px", "alignment_p95_px", "off_line_mean_px"}
    }  # fmt: skip
    facts = dict(explain.facts({**small_result.report, "measured": measured}))
    assert facts["Projectivity"] == f"{measured['off_line_mean_px']:.2f} px"


def test_dense_refinement_says_what_it_did_or_why_it_did_nothing(small_result):
    asked = small_result.report
    report = {**asked, "options": {**asked["options"], "dense": False}}
    assert "Dense" not in dict(explain.facts(report))
    for told, words in (
        ({"used": True, "moved_px": 0.4321}, "moved by 0.43 px"),
        ({"used": False, "why": "the overlap is bare"}, "not used: the overlap is bare"),
    ):
        facts = dict(explain.facts({**asked, "field": {**report["field"], "dense": told}}))
        assert facts["Dense"] == words


def test_what_a_plane_lacks_is_left_out(small_result):
    report = small_result.report
    view = {**report["two_view"], "model": "plane", "focal_px": [None, None]}
    measured = {key: None for key in report["measured"]}
    facts = dict(explain.facts({**report, "two_view": view, "measured": measured}))
    assert "Focal" not in facts and "Projectivity" not in facts and "Alignment" not in facts
    assert facts["Model"].startswith("Plane")


def test_the_viewpoint_is_told_and_how_it_was_chosen():
    assert explain.viewpoint_facts({"s1": 0.5}) == [("Viewpoint", "slides by 0.50")]
    within = {"s1": 1.0, "part": [0.25, 0.75]}
    assert explain.viewpoint_facts(within) == [("Viewpoint", "slides by 1.00, from 25% to 75% of the overlap")]
    assert explain.viewpoint_facts({"s1": 0.5, "part": [0.0, 1.0]}) == explain.viewpoint_facts({"s1": 0.5})
    assert explain.viewpoint_facts({"s1": 0.0}) == [("Viewpoint", "the reference's place")]
    assert explain.viewpoint_facts({}) == []
    assert explain.viewpoint({"slide": {"s1": 0.5, "why": "least bends"}}) == "Viewpoint chosen: 0.50 (least bends)"
    assert "next stitch" in explain.viewpoint(None)


def test_two_focal_lengths_are_both_said_and_an_estimate_says_how_sure():
    view = {"focal_px": [500.0, 900.0], "focal_source": "the matches, from EXIF", "focal_deviation": 0.02}
    assert dict(explain.focal_facts(view))["Focal"] == "500 px and 900 px ± 2.0%"
    given = {**view, "focal_source": "given in px"}
    assert dict(explain.focal_facts(given))["Focal"] == "500 px and 900 px"


def test_every_stage_of_the_engine_has_words():
    from edf_stitch.core.system.progress import STAGES, STAGES_OF_MANY

    for name in {**STAGES, **STAGES_OF_MANY}:
        assert explain.stage(name) == explain.STAGES[name]
    assert explain.stage("unheard") == "Unheard"


def test_how_far_it_is_is_told_with_what_is_left_of_it():
    assert explain.how_far("unheard", 0.05, None) == "Unheard  5%"
    assert explain.how_far("unheard", 0.42, 17.4) == "Unheard  42%, 17 s left"
    assert explain.how_far("unheard", 0.42, 130.0) == "Unheard  42%, 2 min left"


def test_what_is_left_takes_as_long_as_what_was_done(monkeypatch):
    status = pytest.importorskip("edf_stitch.edf_addon.status")
    monkeypatch.setattr(status, "now", status.Status())
    clock = [100.0]
    monkeypatch.setattr(status.time, "monotonic", lambda: clock[0])
    status.begin()
    clock[0] += 12
    for share, left in ((0.05, None), (0.25, 36.0), (0.75, 4.0), (1.0, 0.0)):
        status.now.share = share
        assert status.seconds_left() == left


def test_of_more_than_two_pictures_those_left_out_are_named_with_the_reason():
    report = {
        "verdict": {"is": "good"}, "canvas": {"width": 900, "height": 400}, "matches": {"found": 500, "inliers": 400},
        "pictures": [{"name": f"{n}.jpg", "camera": {"focal_px": 812.3, "source": "EXIF"}} for n in range(1, 4)],
        "left_out": [{"name": "x.jpg", "why": "it connects with no other"}], "slide": {"s1": 0.0},
        "measured": {"alignment_median_px": 0.5, "alignment_p95_px": 1.25},
    }  # fmt: skip
    assert explain.facts(report) == [
        ("Verdict", "Good"), ("Used", "3 of 4 pictures"), ("", "x.jpg is left out: it connects with no other"),
        ("Size", "900 × 400 px"), ("Matches", "500"), ("Inliers", "400 (80%)"), ("Viewpoint", "the place of 1.jpg"),
        ("Focal", "812 px"), ("Source", "EXIF"), ("Alignment", "0.50 px (95 %: 1.25)"),
    ]


def test_long_texts_are_broken_and_nothing_is_lost():
    text = "the focal length is doubtful, and with it depth; see /a/very/long/path/that/cannot/be/broken.png"
    lines = explain.lines(text, 200)
    assert " ".join(lines) == text and len(lines) > 2
    assert explain.lines("", 200) == [""]


@pytest.mark.parametrize(("said", "shown"), [("it ended", "It ended."), ("Why?", "Why?"), ("so.", "So."), ("", "")])
def test_a_message_becomes_a_sentence(said, shown):
    assert explain.sentence(said) == shown
