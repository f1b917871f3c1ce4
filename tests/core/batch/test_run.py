"""`edf batch`: many pairs, a bad one among them, interrupted and resumed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from edf_stitch.core.batch import run as batch
from edf_stitch.core.batch.list import BatchItem, read_list
from edf_stitch.core.batch.pieces import BatchRequest
from edf_stitch.core.batch.run import BatchSummary, Outcome, run_batch
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.system.errors import BadRequest, Cancelled, UnreadableImage, UnwritableOutput

from ...pairs import KNOWN_WORDS, ON_REFERENCE
from . import batch_work
from .batch_work import files, lasting, of_pairs, run, summary

work, quick, said = batch_work.work, batch_work.quick, batch_work.said


def test_a_bad_pair_is_reported_and_the_rest_goes_on(
    work: Path, said: Callable, small_result: StitchResult
) -> None:
    assert run(work, "--keep-going", items="bad.csv") == 1
    height, width = small_result.alpha.shape
    lines = said()
    assert lines[0] == f"edf: [1/3] p1: {width}×{height}" and lines[2] == f"edf: [3/3] p3: {width}×{height}"
    assert lines[1].startswith("edf: [2/3] p2: failed: ") and "at least" in lines[1]
    assert lines[3:6] == [
        f"edf: {work / 'out' / 'batch.json'}: 2 done, 0 skipped, 1 failed", "edf: 1 of 3 failed:",
        "edf: name  code  why"]  # fmt: skip
    assert lines[6].startswith("edf: p2    3     ") and "at least" in lines[6] and len(lines) == 7
    assert set(files(work / "out")) == {"batch.json", ".edf/.failed/p2.json", *of_pairs("p1", "p3")}
    # the same picture as stitch() from Python gives
    assert (work / "out" / "p3.png").read_bytes() == encode_picture(
        small_result.pixels, small_result.alpha, 8, ".png")[0]
    found = summary(work / "out")
    assert {key: found[key] for key in ("total", "done", "skipped", "failed", "interrupted", "exit_code")} == {
        "total": 3, "done": 2, "skipped": 0, "failed": 1, "interrupted": False, "exit_code": 1}  # fmt: skip
    first, bad, third = found["items"]
    assert (first["name"], first["status"], first["panorama"]) == ("p1", "done", "p1.png")
    assert first["size"] == [width, height]
    report = json.loads((work / "out" / "p1.report.json").read_text("utf-8"))
    assert first["measured"] == report["measured"] and report["measured"]["overlap_psnr_db"] > 20
    assert report["pictures"][0]["name"] == "reference1.png"
    assert (bad["status"], bad["exit_code"], bad["panorama"]) == ("failed", 3, "") and "at least" in bad["message"]
    assert third["status"] == "done"
    assert first["verdict"] == report["verdict"] and not bad["verdict"]
    assert Outcome("p", "done", size=(3, 2), verdict={"is": "good", "places": []}).in_words() == "3×2"
    looked_at = Outcome("p", "done", size=(3, 2), verdict={"is": "look", "places": [1, 2]})
    assert looked_at.in_words() == "3×2, look at 2 places"


def test_json_prints_the_summary_on_stdout(work: Path, quick: list, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work, "--json", "--quiet") == 0
    out, err = capsys.readouterr()
    assert err == "" and json.loads(out) == summary(work / "out") and json.loads(out)["done"] == 3


@pytest.mark.parametrize(("troubles", "expected"), [
    ({}, 0), ({"reference1": UnreadableImage("x")}, 4), ({"reference3": BadRequest("x")}, 2),
    ({"reference2": BadRequest("x"), "reference3": UnreadableImage("x")}, 2), ({"reference1": MemoryError()}, 3),
    ({"reference2": ZeroDivisionError("x")}, 3),
])  # fmt: skip
def test_the_first_failure_stops_unless_told_to_keep_going(
    work: Path, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult, troubles: dict, expected: int
) -> None:
    def stitched(pictures: Sequence[Path], *_: object) -> StitchResult:
        if pictures[0].stem in troubles:
            raise troubles[pictures[0].stem]
        return small_result

    monkeypatch.setattr(batch, "stitch", stitched)
    assert run(work, "--quiet") == expected
    well = [f"reference{n}" not in troubles for n in (1, 2, 3)]
    assert [item["status"] == "done" for item in summary(work / "out")["items"]] == [
        *well[:well.index(False)], False] if expected else well
    assert run(work, "--quiet", "--resume", "--keep-going") == bool(expected)
    assert [item["exit_code"] == 0 for item in summary(work / "out")["items"]] == well


def test_a_folder_without_pictures_is_told_in_its_turn(work: Path, said: Callable, quick: list) -> None:
    (work / "empty").mkdir()
    (work / "sets.csv").write_text("in/[rt]*1.png,,one\nempty\nnowhere/*.png\nin/[rt]*2.png,,two\n", "utf-8")
    assert run(work, "--layers", "--keep-going", items="sets.csv") == 1 and quick == ["reference1", "reference2"]
    lines = said()
    assert lines[1].startswith("edf: [2/4] empty: failed: ") and "no pictures in this folder" in lines[1]
    assert lines[2].startswith("edf: [3/4] nowhere__.png: failed: ") and "no pictures of that name" in lines[2]
    assert [item["status"] for item in summary(work / "out")["items"]] == ["done", "failed", "failed", "done"]


def test_a_missing_file_is_told_in_its_turn(
    work: Path, said: Callable, quick: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    (work / "in" / "target2.png").unlink()
    found = batch.stitch
    monkeypatch.setattr(
        batch, "stitch", lambda pictures, *more: (found if pictures[1].exists() else stitch)(pictures, *more))
    assert run(work, "--quiet", "--keep-going") == 1
    line = said()[0]
    assert line.startswith("edf: [2/3] p2: failed: ") and "target2.png: no such file" in line
    assert quick == ["reference1", "reference3"]


def test_a_list_that_is_wrong_stops_before_the_work(work: Path, said: Callable, quick: list) -> None:
    (work / "good.csv").write_text("in/reference1.png\n", "utf-8")
    assert run(work) == 2 and "good.csv, line 1: the target is missing" in said()[-1]
    assert run(work, items="missing.csv") == 4 and "the list cannot be read" in said()[-1]
    assert quick == [] and not (work / "out").exists()


@pytest.mark.parametrize(("arguments", "code", "words"), [
    (["--format", "gif"], 2, ".png"), (["--shard", "3/2"], 2, "I/N"), (["--shard", "0/2"], 2, "I/N"),
    (["--shard", "half"], 2, "2/3"), (["--seam", "x"], 2, "not known"),
    (["--matches", "none.csv"], 4, "none.csv: no such"),
    (["--scale", "2"], 2, "scale"), (["--quiet", "--verbose"], 2, "not allowed"),
])  # fmt: skip
def test_a_wrong_call_stops_before_the_work(
    work: Path, said: Callable, quick: list, arguments: list[str], code: int, words: str
) -> None:
    assert run(work, *arguments) == code and words in said()[-1]
    assert quick == [] and not (work / "out").exists()


def test_options_reach_every_pair_and_a_line_may_have_its_own_camera(
    work: Path, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult
) -> None:
    (work / "good.csv").write_text(
        "reference,target,focal35\nin/reference1.png,in/target1.png,28\nin/reference2.png,in/target2.png,\n", "utf-8")
    asked: list[StitchOptions] = []
    monkeypatch.setattr(batch, "stitch", lambda _, options, *__: asked.append(options) or small_result)
    assert run(work, "--quiet", "--seed", "5", "--principal", "100,90") == 0
    own, common = (options.camera for options in asked)
    assert (own.focal35, own.focal_px, own.principal) == ((28.0,), (), (100.0, 90.0))
    assert (common.focal35, common.focal_px, common.principal) == ((), (228.0,), (100.0, 90.0))
    assert all(options.seed == 5 and options.measure for options in asked)


def test_layers_warp_and_the_kind_of_file(work: Path, quick: list) -> None:
    assert run(work, "--quiet", "--layers", "--warp", "--depth", "--mesh", "--format", "jpg") == 0
    expected = {f"p1{suffix}" for suffix in (
        ".jpg", ".report.json", ".matches.csv", ".timing.json", ".warp.npz", ".depth.exr", ".mesh.glb",
        ".layers/00_reference1.png", ".layers/01_target1.png", ".layers/occluded_01.png", ".layers/confidence.png",
        ".layers/labels.png", ".layers/seam.png",
        ".layers/canvas.json")}  # fmt: skip
    assert {name for name in files(work / "out") if name.startswith("p1")} == expected


def test_warnings_are_told_even_when_quiet(
    work: Path, said: Callable, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult
) -> None:
    doubtful = replace(small_result, warnings=("the sky is falling",))
    monkeypatch.setattr(batch, "stitch", lambda *_: doubtful)
    assert run(work, "--quiet") == 0
    assert said() == [f"edf: warning: p{n}: the sky is falling" for n in (1, 2, 3)]
    assert summary(work / "out")["items"][0]["warnings"] == ["the sky is falling"]
    monkeypatch.setattr(batch, "stitch", lambda *_: replace(small_result, warnings=tuple("abcdefg")))
    assert run(work, "--quiet", "--shard", "3/3", out="many") == 0
    report = work / "many" / "batch.shard-3-of-3.json"
    assert [line.split(": ", 3)[-1] for line in said()] == [*"abcde", f"2 more in {report}"]


def test_verbose_tells_the_figures(work: Path, said: Callable, quick: list) -> None:
    assert run(work, "--verbose") == 0
    line = said()[0]
    assert all(word in line for word in ("alignment ", "PSNR ", "SSIM "))


# --- from Python ----------------------------------------------------------------------------------------------------


def test_progress_of_everything_and_outcomes_as_they_come(work: Path, quick: list) -> None:
    told: list[tuple[str, float]] = []
    ended: list[tuple[str, int, int]] = []
    found = run_batch(
        read_list(work / "good.csv"), ON_REFERENCE, BatchRequest(work / "out"),
        lambda stage, share: told.append((stage, share)),
        finished=lambda outcome, number, count: ended.append((outcome.name, number, count)),
    )  # fmt: skip
    assert [stage for stage, _ in told] == [f"[{n}/3] features" for n in (1, 2, 3)]
    assert [share for _, share in told] == pytest.approx([0.5 / 3, 1.5 / 3, 2.5 / 3])
    assert ended == [("p1", 1, 3), ("p2", 2, 3), ("p3", 3, 3)]
    assert isinstance(found, BatchSummary) and found.exit_code == 0 and found.count("done") == 3


def test_two_items_of_one_name_are_refused(tmp_path: Path) -> None:
    items = [BatchItem(name, Path("a.png"), Path("b.png")) for name in ("x", "X")]
    with pytest.raises(BadRequest, match="two items are named 'X'"):
        run_batch(items, ON_REFERENCE, BatchRequest(tmp_path / "out"))
    with pytest.raises(BadRequest, match="no name for outputs"):
        BatchItem("a/b", Path("a.png"), Path("b.png"))


def test_in_words() -> None:
    assert Outcome("x", "done", size=(3, 2)).in_words() == "3×2"
    assert Outcome("x", "done", size=(3, 2), measured={"overlap_ssim": 0.5}).in_words(True) == "3×2, SSIM 0.500"
    assert Outcome("x", "done", measured={"overlap_ssim": None}).in_words(True) == "done"
    assert Outcome("x", "failed", "why", 3, size=(3, 2)).in_words() == "failed: why"


# --- interrupted ----------------------------------------------------------------------------------------------------


def stop_at(number: int, original: Callable, trouble: type[BaseException]) -> Callable:
    """The original, which ends like this when it is called for the number-th time (from 1)."""
    calls = 0

    def call(*args: object, **kwargs: object) -> object:
        nonlocal calls
        calls += 1
        if calls == number:
            raise trouble
        return original(*args, **kwargs)

    return call


@pytest.mark.parametrize("trouble", [KeyboardInterrupt, Cancelled])
@pytest.mark.parametrize("where", ["stitch", "edf_stitch.core.output.outputs.match_file"])
def test_an_interrupted_batch_is_resumed(
    work: Path, said: Callable, quick: list, monkeypatch: pytest.MonkeyPatch, trouble: type[BaseException], where: str
) -> None:
    assert run(work, "--quiet", out="whole") == 0
    target = (batch, "stitch") if where == "stitch" else (sys.modules[where.rpartition(".")[0]], "match_file")
    with monkeypatch.context() as patch:
        patch.setattr(*target, stop_at(2, getattr(*target), trouble))
        assert run(work) == 130
    assert ("what is finished is kept" if trouble is KeyboardInterrupt else "cancelled") in said()[-1]
    assert set(files(work / "out")) == {"batch.json", *of_pairs("p1")}, "nothing half done"
    found = summary(work / "out")
    assert found["interrupted"] is True and found["total"] == 3 and [i["name"] for i in found["items"]] == ["p1"]
    times = {path: path.stat().st_mtime_ns for path in (work / "out").rglob("p1*")}
    assert run(work, "--resume", "--quiet") == 0
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert lasting(work / "out") == lasting(work / "whole") and summary(work / "out")["interrupted"] is False


def test_cancelled_from_outside(work: Path) -> None:
    asked = 0

    def cancelled() -> bool:
        nonlocal asked
        asked += 1
        return (work / "out" / "p1.png").exists()

    with pytest.raises(Cancelled):
        run_batch(read_list(work / "good.csv"), ON_REFERENCE, BatchRequest(work / "out"), cancelled=cancelled)
    assert asked > 5 and set(files(work / "out")) == {"batch.json", *of_pairs("p1")}


# `edf` that stops to think before the second pair: so it is there when the signal comes.
THINKING = """
import sys, time
from edf_stitch.core.batch import run as batch
from edf_stitch.core.commands import cli
stitch = batch.stitch
batch.stitch = lambda pictures, *more: stitch(pictures, *more) if "1" in pictures[0].name else time.sleep(600)
sys.exit(cli.main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals as POSIX has them")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_signal_in_the_middle_keeps_what_is_finished(work: Path, number: signal.Signals) -> None:
    line = [sys.executable, "-c", THINKING, "batch", str(work / "good.csv"), "-o", str(work / "out"), *KNOWN_WORDS]
    with subprocess.Popen(line, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as job:
        assert job.stderr is not None
        assert job.stderr.readline().startswith("edf: [1/3] p1: ")
        job.send_signal(number)
        out, err = job.communicate(timeout=300)
    assert job.returncode == 130 and out == "" and "Traceback" not in err
    assert err.splitlines() == ["edf: interrupted; what is finished is kept, and --resume goes on with the rest"]
    assert set(files(work / "out")) == {"batch.json", *of_pairs("p1")}
    assert summary(work / "out")["interrupted"] is True


def test_a_full_disk_stops_at_the_summary(work: Path, quick: list, monkeypatch: pytest.MonkeyPatch) -> None:
    """An output that cannot be written is that item's failure; without a summary nothing more can be told."""
    monkeypatch.setattr(batch, "json_bytes", stop_at(3, batch.json_bytes, UnwritableOutput))
    assert run(work, "--quiet") == 4
    assert quick == ["reference1", "reference2"] and summary(work / "out")["total"] == 3
