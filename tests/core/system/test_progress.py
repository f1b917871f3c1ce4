"""Progress climbs from 0 to 1 through the stages in their order, and asking to stop stops."""

from __future__ import annotations

import itertools

import pytest
from edf_stitch.core.system.errors import Cancelled
from edf_stitch.core.system.progress import STAGES, STAGES_OF_MANY, Progress


def test_the_shares_of_the_stages_make_a_whole() -> None:
    assert sum(STAGES.values()) == pytest.approx(1) and min(STAGES.values()) > 0
    in_order = ["read", "features", "geometry", "field", "dense", "warp"]
    assert list(STAGES) == [*in_order, "occlusion", "exposure", "seam", "blend", "write"], "the data's order"


def test_shares_of_stages_become_shares_of_everything() -> None:
    said: list[tuple[str, float]] = []
    progress = Progress(lambda stage, total: said.append((stage, total)))
    for stage in STAGES:
        for fraction in (0.0, 0.5, 1.0):
            progress(stage, fraction)
    assert [stage for stage, _ in said[::3]] == list(STAGES)
    totals = [total for _, total in said]
    assert totals[0] == 0 and totals[-1] == pytest.approx(1) and max(totals) <= 1
    assert all(b >= a - 1e-12 for a, b in itertools.pairwise(totals))
    starts = [0, *itertools.accumulate(STAGES.values())]
    assert totals[::3] == pytest.approx(starts[:-1]) and totals[2::3] == pytest.approx(starts[1:])
    progress("geometry")
    assert said[-1] == ("geometry", pytest.approx(STAGES["read"] + STAGES["features"])), "a stage begins at 0"


def test_of_many_pictures_seams_and_blends_are_one_stage() -> None:
    assert sum(STAGES_OF_MANY.values()) == pytest.approx(1) and min(STAGES_OF_MANY.values()) > 0
    said: list[tuple[str, float]] = []
    progress = Progress(lambda stage, total: said.append((stage, total)), stages=STAGES_OF_MANY)
    for stage, share in (("exposure", 1.0), ("seam", 0.0), ("blend", 0.25), ("seam", 0.5), ("blend", 1.0)):
        progress(stage, share)
    assert [stage for stage, _ in said] == ["exposure"] + ["seam"] * 4
    totals = [total for _, total in said]
    assert totals == sorted(totals) and totals[-1] == pytest.approx(1 - STAGES_OF_MANY["write"])
    with pytest.raises(ValueError):
        Progress(lambda *_: None, stages=STAGES_OF_MANY)("nonsense")


def test_nobody_has_to_listen() -> None:
    Progress()("read")
    Progress(None, lambda: False)("write", 1.0)


def test_asked_to_stop_it_stops_before_it_reports() -> None:
    said: list[str] = []
    asked = iter([False, True])
    progress = Progress(lambda stage, _: said.append(stage), lambda: next(asked))
    progress("read")
    with pytest.raises(Cancelled) as stopped:
        progress("features")
    assert said == ["read"] and stopped.value.exit_code == 130


def test_a_stage_nobody_knows_is_a_mistake() -> None:
    with pytest.raises(ValueError):
        Progress(lambda *_: None)("nonsense")
