"""What farms ask of `edf batch`: plans and their units, failures that are known, several workers on one folder."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.batch import run as batch
from edf_stitch.core.batch.list import read_list
from edf_stitch.core.batch.options import CLIP
from edf_stitch.core.batch.outcomes import BatchSummary, Outcome
from edf_stitch.core.batch.pieces import BatchRequest
from edf_stitch.core.batch.plan_file import plan_document
from edf_stitch.core.commands.cli import main
from edf_stitch.core.commands.file_arguments import without_plan
from edf_stitch.core.pipeline import StitchOptions, StitchResult
from edf_stitch.core.system.errors import UnreadableImage

from . import batch_work
from .batch_work import files, lasting, of_pairs, run, save, summary

work, quick, said = batch_work.work, batch_work.quick, batch_work.said


def planned(work: Path, *arguments: str, items: str = "good.csv") -> dict:
    assert run(work, "--quiet", "--plan", str(work / "plan.json"), *arguments, items=items) == 0
    return json.loads((work / "plan.json").read_text("utf-8"))


def test_a_plan_names_units_needs_and_commands(work: Path, quick: list, said: Callable) -> None:
    assert run(work, "--seed", "3", "--plan", str(work / "plan.json")) == 0
    assert said() == ["edf: 3 of 3 units to make, with up to 0.3 GB of memory and 1 core each; 0.0 GB to read"]
    plan = json.loads((work / "plan.json").read_text("utf-8"))
    assert quick == [] and not (work / "out").exists() and (plan["schema"], plan["total"]) == (1, 3)
    for number, one in enumerate(plan["units"], 1):
        command = one.pop("command")
        assert command[:4] == ["edf", "batch", str(work / "good.csv"), "-o"]
        assert command[-5:] == ["--seed", "3", "--resume", "--unit", f"{number}/3"] and "--plan" not in command
        size = sum((work / "in" / f"{side}{number}.png").stat().st_size for side in ("reference", "target"))
        assert one == {
            "unit": number, "name": f"p{number}", "kind": "pair", "frames": None, "pictures": 2, "memory_gb": 0.3,
            "cores": 1, "read_bytes": size,
        }  # fmt: skip
    assert run(work, "--plan", str(work / "plan.json")) == 4 and "plan.json exists" in said()[-1]


def test_a_plan_never_replaces_what_the_batch_reads(work: Path, said: Callable) -> None:
    for name in ("good.csv", "in/target2.png"):
        before = (work / name).read_bytes()
        assert run(work, "--plan", str(work / name), "--resume", items="good.csv") == 2
        assert "is read" in said()[-1] and (work / name).read_bytes() == before


def test_units_make_what_the_whole_would_and_a_plan_holds_what_is_left(work: Path, quick: list) -> None:
    assert run(work, "--quiet", out="whole") == 0
    quick.clear()
    first, second, third = (one["command"] for one in planned(work)["units"])
    assert main([*second[1:], "--quiet"]) == 0 and quick == ["reference2"]
    assert set(files(work / "out")) == of_pairs("p2"), "a unit has no summary"
    assert [one["unit"] for one in planned(work, "--resume")["units"]] == [1, 3]
    assert main([*second[1:], "--quiet"]) == 0 and quick == ["reference2"], "made already"
    assert main([*third[1:], "--quiet"]) == main([*first[1:], "--quiet"]) == 0
    assert lasting(work / "out") == lasting(work / "whole")
    assert planned(work, "--resume")["units"] == []


def test_a_plan_on_stdout(work: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work, "--plan", "-") == 0
    out, err = capsys.readouterr()
    assert len(json.loads(out)["units"]) == 3 and err.startswith("edf: 3 of 3 units")


def test_a_list_that_changed_since_the_plan_is_refused(work: Path, quick: list, said: Callable) -> None:
    command = planned(work)["units"][0]["command"][1:]
    with (work / "good.csv").open("a", encoding="utf-8") as file:
        file.write("\nin/reference1.png,in/target2.png,p4")
    assert main(command) == 2
    assert said()[-1].endswith("3 units were planned, and the list has 4 now: plan again (--plan)")
    assert run(work, "--unit", "5") == 2 and "unit 5 is asked for, and the list has 4" in said()[-1]
    assert run(work, "--unit", "4/3") == 2 and "K from 1 to N" in said()[-1]
    assert run(work, "--unit", "0") == 2 and "K from 1 to N" in said()[-1]
    assert run(work, "--unit", "one") == 2 and "12/200" in said()[-1]
    assert run(work, "--unit", "1", "--shard", "1/2") == 2 and "give one of them" in said()[-1]
    for part in ("--shard=1/2", "--unit=1"):
        assert run(work, part, "--plan", "-") == 2 and "a plan is of the whole list" in said()[-1]
    assert quick == [] and not (work / "out").exists()
    assert run(work, "--unit", "4", "--quiet") == 0 and quick == ["reference1"]


def test_a_clip_is_cut_into_units_that_share_its_frames(tmp_path: Path) -> None:
    for number in range(120):
        for side in "ab":
            (tmp_path / f"{side}_{number:04d}.png").write_bytes(b"x" * 10)
    (tmp_path / "list.csv").write_text("a_%04d.png,b_%04d.png,shot\n", "utf-8")
    items = read_list(tmp_path / "list.csv")
    plan = plan_document(items, StitchOptions(), BatchRequest(tmp_path / "out"), ["edf"])
    spans = [one["frames"] for one in plan["units"]]
    assert [span["count"] for span in spans] == [CLIP.unit_frames - 1, CLIP.unit_frames, 120 - 2 * CLIP.unit_frames + 1]
    assert spans[0]["first"] == 0 and spans[-1]["last"] == 119
    assert [one["last"] + 1 for one in spans[:-1]] == [one["first"] for one in spans[1:]]
    # each reads the five frames that the clip is aligned on as well: one or two of them are among its own
    assert [one["read_bytes"] for one in plan["units"]] == [20 * (49 + 3), 20 * (50 + 3), 20 * (21 + 4)]
    assert {one["kind"] for one in plan["units"]} == {"clip"}


def test_large_pictures_and_sets_are_given_memory_and_cores(tmp_path: Path) -> None:
    """Pictures of one colour, of which only the header is asked for."""
    for name in ("a", "b", "c"):
        save(tmp_path / f"{name}.png", np.zeros((4000, 6000, 3)))
    (tmp_path / "list.csv").write_text("reference,target,picture3,name\na.png,b.png,,p\na.png,b.png,c.png,s\n", "utf-8")
    items = read_list(tmp_path / "list.csv")
    pair, few = plan_document(items, StitchOptions(), BatchRequest(tmp_path / "out"), ["edf"])["units"]
    assert (pair["memory_gb"], pair["cores"]) == (2.6, 1), "2.0 GB were measured"
    assert few["kind"] == "set" and 1.5 < few["memory_gb"] < 7 and few["cores"] == int(few["memory_gb"] // 2)


def test_arguments_without_the_plan() -> None:
    expected = shlex.split("batch list.csv -o out --projection plan")
    for words in ("--plan p.json", "--plan=p.json", "--pla p.json", "--plan -"):
        assert without_plan(shlex.split(f"batch list.csv {words} -o out --projection plan")) == expected


# --- failures -------------------------------------------------------------------------------------------------------


@pytest.fixture
def bad(monkeypatch: pytest.MonkeyPatch, small_result: StitchResult) -> tuple[set[str], list[str]]:
    """References that cannot be stitched, to be changed; and those that were tried."""
    troubles, tried = {"reference2"}, []

    def stitched(pictures: Sequence[Path], *_: object) -> StitchResult:
        tried.append(pictures[0].stem)
        if pictures[0].stem in troubles:
            raise UnreadableImage("as broken as can be")
        return small_result

    monkeypatch.setattr(batch, "stitch", stitched)
    return troubles, tried


def test_only_what_failed_is_tried_again(work: Path, bad: tuple[set, list], said: Callable) -> None:
    troubles, tried = bad
    assert run(work, "--keep-going", "--quiet") == 1
    record = summary(work / "out", ".edf/.failed/p2.json")
    assert record == {"message": "as broken as can be", "exit_code": 4}
    tried.clear()
    assert run(work, "--retry-failed", "--keep-going", "--quiet") == 1 and tried == ["reference2"]
    troubles.clear()
    tried.clear()
    (work / "out" / "p3.png").unlink()  # due, but it did not fail
    assert run(work, "--retry-failed", "--quiet") == 0 and tried == ["reference2"]
    assert set(files(work / "out")) == {"batch.json", *of_pairs("p1", "p2", "p3")} - {"p3.png"}
    assert run(work, "--retry-failed", "--quiet") == 0 and tried == ["reference2"]
    assert summary(work / "out")["total"] == 0


def test_a_unit_that_failed_is_known_to_later_runs(work: Path, bad: tuple[set, list]) -> None:
    assert run(work, "--unit", "2", "--resume", "--quiet") == 4
    assert [one["unit"] for one in planned(work, "--retry-failed")["units"]] == [2]


def test_the_table_of_failures() -> None:
    outcomes = Outcome("one", "done"), Outcome("a longer name", "failed", "why", 4), Outcome("b", "failed", "how", 3)
    found = BatchSummary(outcomes, 3, keep_going=True)
    assert found.failures() == [
        "2 of 3 failed:", "name           code  why", "a longer name  4     why", "b              3     how",
    ]  # fmt: skip
    assert found.exit_code == 1 and BatchSummary(outcomes[:1], 1, keep_going=True).failures() == []
    assert BatchSummary(outcomes[:2], 3).exit_code == 4


# --- several workers ------------------------------------------------------------------------------------------------


def test_what_another_worker_makes_meanwhile_is_not_made_again(
    work: Path, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult
) -> None:
    """Another makes p1 while this one is at it, and p2 before this one comes to it."""
    tried = []

    def stitched(pictures: Sequence[Path], *_: object) -> StitchResult:
        tried.append(pictures[0].stem)
        if len(tried) == 1:
            for unit in ("1", "2"):
                assert run(work, "--resume", "--quiet", "--unit", unit) == 0
            before.update(times())
        return small_result

    before: dict[Path, int] = {}

    def times() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in (work / "out").rglob("p[12]*")}

    monkeypatch.setattr(batch, "stitch", stitched)
    assert run(work, "--resume", "--quiet") == 0
    assert tried == ["reference1", "reference1", "reference2", "reference3"]
    assert [one["status"] for one in summary(work / "out")["items"]] == ["done", "skipped", "done"]
    assert times() == before and len(before) == 10


@pytest.mark.parametrize("name", ["../p", "/elsewhere/p", "a/b", r"a\b", ".p", "C:p", "p\n"])
def test_names_do_not_lead_out_of_the_folder(work: Path, said: Callable, name: str) -> None:
    (work / "bad.csv").write_text(f'in/reference1.png,in/target1.png,"{name}"\n', "utf-8")
    assert run(work, items="bad.csv") == 2
    assert not (work / "out").exists() and "bad.csv, line 1: " in said()[-1]


def test_a_list_from_stdin(work: Path, quick: list, said: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(work)
    keep = os.dup(0)
    with (work / "good.csv").open("rb") as file:
        os.dup2(file.fileno(), 0)
    try:
        assert main(["batch", "-", "-o", "out", "--quiet"]) == 0
    finally:
        os.dup2(keep, 0)
        os.close(keep)
    assert quick == ["reference1", "reference2", "reference3"]
    assert main(["batch", "-", "-o", "new", "--plan", "-"]) == 2 and "put it into a file" in said()[-1]
