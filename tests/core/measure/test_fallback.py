"""Where dense depth makes a panorama that is not usable, something simpler is shown, and both are reported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core import mapping, pipeline
from edf_stitch.core.measure.fallback import least_torn
from edf_stitch.core.measure.verdict import GOOD, NOT_USABLE, TORN, Place, Verdict
from edf_stitch.core.panorama.choosing_slide import SlideChoice, SlideCost
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.system.errors import Cancelled
from edf_stitch.synthetic_scenes.two_planes import Pair


def judged(monkeypatch: pytest.MonkeyPatch, *ratings: str) -> None:
    """As if stitches were rated so, one after the other."""
    left: Iterator[str] = iter(ratings)
    monkeypatch.setattr(pipeline, "judge", lambda *_: Verdict(next(left), "it is torn", "mend it"))


@pytest.mark.parametrize(("ratings", "field", "dense"), [
    ((NOT_USABLE, GOOD), "slack", False), ((NOT_USABLE, NOT_USABLE, GOOD), "homography", False),
    ((NOT_USABLE,) * 3, "slack", True), ((GOOD,), "slack", True),
])  # fmt: skip
def test_the_first_simpler_stitch_that_is_usable_is_shown(
    ratings: tuple[str, ...], field: str, dense: bool, monkeypatch: pytest.MonkeyPatch, small_pair: Pair,
    known: StitchOptions, small_result: StitchResult,
) -> None:  # fmt: skip
    judged(monkeypatch, *ratings)
    result = stitch((small_pair.reference, small_pair.target), known)
    asked = result.report["options"]
    assert (asked["field"], asked["dense"], result.report["verdict"]["is"]) == (field, dense, ratings[-1])
    assert np.array_equal(result.pixels, small_result.pixels) == dense
    fallback = result.report.get("fallback")
    assert (fallback is not None) == (not dense)
    if fallback:
        told = [line for line in result.warnings if line.startswith("fell back to ")]
        assert len(told) == 1 and fallback["to"] in told[0] and "it is torn" in told[0]
        assert result.report["warnings"] == list(result.warnings)
        assert fallback["instead_of"]["options"]["dense"] and fallback["instead_of"]["verdict"]["is"] == NOT_USABLE


def costs(s1: float, cost: float, part: tuple[float, float] = (0.0, 1.0)) -> SlideCost:
    return SlideCost(s1, cost, 0.0, 0.0, 0.0, 0.0, 0.0, cost, part)


PART = (0.25, 0.75)
EVERY = (costs(0.0, 1.3), costs(0.5, 1.2), costs(1.0, 4.0), costs(1.0, 1.0, PART))


@pytest.mark.parametrize(("torn", "chosen", "made"), [
    (((4, 4), (2, 4), (4, 4)), 1, 3), (((2, 4), (4, 4), (3, 3)), 0, 3), (((4, 4), (3, 3), (2, 3)), 2, 3),
    (((4, 4), ()), 1, 2), (((), (4, 4)), 0, 1), (((4, 4), (4, 4), (3, 4)), 0, 3),
])  # fmt: skip
def test_of_slides_that_cost_about_as_much_another_is_shown_where_much_less_is_torn(
    torn: tuple[tuple[int, ...], ...], chosen: int, made: int, monkeypatch: pytest.MonkeyPatch, small_pair: Pair,
    known: StitchOptions,
) -> None:  # fmt: skip
    places = [[Place((0, 0, *size), TORN, 1.0)] if size else [] for size in torn]
    left = iter(places)
    monkeypatch.setattr(pipeline, "judge", lambda *_: Verdict("look", "it is torn", "mend it", tuple(next(left))))
    monkeypatch.setattr(mapping, "choose_slide", lambda *given: SlideChoice(1.0, EVERY, "the least", PART))
    told: list[float] = []
    options = replace(known, projection="auto", slide="auto", dense=True)
    pictures = small_pair.reference, small_pair.target
    result = stitch(pictures, options, lambda _, share: told.append(share))
    slide = result.report["slide"]
    expected = [(1.0, PART), (0.0, (0.0, 1.0)), (0.5, (0.0, 1.0))][chosen]
    assert (slide["s1"], tuple(slide["part"])) == expected
    assert len(list(left)) == len(torn) - made
    assert len(slide["costs"]) == 4 and ("it would be torn" in slide["why"]) == (chosen > 0)
    assert (0.0 if result.warp.viewpoint is None else result.warp.viewpoint.s1) == slide["s1"]
    assert result.report["options"]["slide"] == "auto" and told == sorted(told)
    assert {"read", "features", "dense", "warp"} <= result.seconds.keys(), "of all that was done"


@dataclass(frozen=True)
class Shown:
    """As much of a result as is looked at: with a place that is torn, of so many px, and a panorama of so many."""

    torn: int
    side: int
    seconds: dict[str, float] = dataclass_field(default_factory=dict)

    @property
    def report(self) -> dict:
        return {"verdict": {"is": "look", "places": [{"what": TORN, "box": (0, 0, self.torn, 1)}]}}

    @property
    def canvas(self) -> SimpleNamespace:
        return SimpleNamespace(width=self.side, height=100)


@pytest.mark.parametrize(("side", "taken"), [(100, True), (86, True), (84, False)])
def test_a_slide_that_is_less_torn_because_the_crop_leaves_that_out_is_not_taken(side: int, taken: bool) -> None:
    first, other = Shown(50, 100), Shown(5, side)
    assert least_torn(first, [lambda: other]).side == (side if taken else 100)


def test_what_was_asked_to_be_simple_is_left_alone(
    monkeypatch: pytest.MonkeyPatch, small_pair: Pair, known: StitchOptions
) -> None:
    judged(monkeypatch, NOT_USABLE)
    result = stitch((small_pair.reference, small_pair.target), replace(known, dense=False))
    assert result.report["verdict"]["is"] == NOT_USABLE and "fallback" not in result.report


def test_it_stops_when_asked_to_in_the_second_stitch_too(
    monkeypatch: pytest.MonkeyPatch, small_pair: Pair, known: StitchOptions
) -> None:
    judged(monkeypatch, NOT_USABLE)
    written: list[str] = []

    def asked() -> bool:
        return written.count("write") >= 2 and written[-1] != "write"

    with pytest.raises(Cancelled):
        stitch((small_pair.reference, small_pair.target), known, lambda stage, _: written.append(stage), asked)
