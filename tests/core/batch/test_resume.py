"""`edf batch` where something is there already: refused, skipped, made again; shards, which make the same together."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from . import batch_work
from .batch_work import files, lasting, of_pairs, raw, run, save, summary

work, quick, said = batch_work.work, batch_work.quick, batch_work.said


def test_what_exists_is_refused_up_front_and_both_ways_out_are_named(work: Path, said: Callable, quick: list) -> None:
    (work / "out").mkdir()
    for name in ("p2.png", "p3.report.json", "batch.json"):
        (work / "out" / name).write_bytes(b"mine")
        assert run(work) == 4
        line = said()[-1]
        assert f"{name} exists" in line and "--resume" in line and "--overwrite" in line
        assert files(work / "out") == {name: b"mine"} and quick == []
        if name != "batch.json":  # which is the batch's own to replace
            assert run(work, "--resume") == 4 and "not as this command left it" in said()[-1]
            assert files(work / "out") == {name: b"mine"} and quick == []
        (work / "out" / name).unlink()
    (work / "out" / "p2.png").write_bytes(b"mine")
    assert run(work, "--overwrite", "--quiet") == 0
    assert quick == ["reference1", "reference2", "reference3"]
    assert (work / "out" / "p2.png").read_bytes() == (work / "out" / "p1.png").read_bytes()


def test_outputs_never_replace_what_is_read(work: Path, said: Callable, quick: list) -> None:
    (work / "good.csv").write_text("in/reference1.png,in/target1.png\nin/reference2.png,in/target2.png\n", "utf-8")
    before = files(work / "in")
    for how in ([], ["--overwrite"], ["--resume"]):
        assert run(work, *how, out="in") == 2
        assert "reference1.png is read by this batch" in said()[-1] and files(work / "in") == before and quick == []


def test_what_stands_in_the_way_is_told_before_the_work(work: Path, said: Callable, quick: list) -> None:
    (work / "out" / "p2.png").mkdir(parents=True)
    assert run(work, "--overwrite") == 4 and "a folder of this name" in said()[-1]
    assert run(work, out="good.csv") == 4 and "a file, not a folder" in said()[-1]
    assert quick == []


def test_a_resumed_batch_makes_only_what_is_missing(work: Path, said: Callable, quick: list) -> None:
    assert run(work, "--quiet") == 0
    before = files(work / "out")
    times = {path: path.stat().st_mtime_ns for path in (work / "out").rglob("p*")}
    (work / "out" / "p2.png").unlink()
    quick.clear()
    assert run(work, "--resume") == 0
    assert quick == ["reference2"]
    words = [line.split(": ")[2] for line in said()[:3]]
    assert words[0] == words[2] == "skipped" and "×" in words[1]
    after = files(work / "out")
    assert {name: data for name, data in after.items() if name != "batch.json"} == {
        name: data for name, data in before.items() if name != "batch.json"}
    changed = {path.name for path, time in times.items() if path.stat().st_mtime_ns != time}
    assert {name.split(".")[0] for name in changed} == {"p2"}
    # the summary tells the figures of those that were there, too
    items = summary(work / "out")["items"]
    assert [item["status"] for item in items] == ["skipped", "done", "skipped"]
    assert items[0]["measured"] == items[1]["measured"] and items[0]["size"] == items[1]["size"]


def rewritten(path: Path) -> None:
    """Other content of the same name, as if it had been rendered again."""
    save(path, 255 - cv2.cvtColor(raw(path), cv2.COLOR_BGR2RGB))


@pytest.mark.parametrize(("arguments", "change", "again"), [
    ([], lambda work: None, []),
    (["--blend", "linear"], lambda work: None, [1, 2, 3]),
    (["--layers"], lambda work: None, [1, 2, 3]),
    ([], lambda work: rewritten(work / "in" / "target3.png"), [3]),
    ([], lambda work: os.utime(work / "in" / "reference1.png", ns=(1, 1)), [1]),
    ([], lambda work: (work / "out" / "p2.matches.csv").unlink(), [2]),
])  # fmt: skip
def test_what_is_out_of_date_is_made_again(
    work: Path, quick: list, arguments: list[str], change: Callable, again: list[int]
) -> None:
    assert run(work, "--quiet") == 0
    quick.clear()
    change(work)
    assert run(work, "--resume", "--quiet", *arguments) == 0
    assert quick == [f"reference{n}" for n in again]
    quick.clear()
    assert run(work, "--resume", "--quiet", *arguments) == 0 and quick == []


def test_a_folder_that_was_moved_is_still_up_to_date(work: Path, quick: list) -> None:
    assert run(work, "--quiet") == 0
    (work / "moved").mkdir()
    for name in ("in", "out", "good.csv"):
        (work / name).rename(work / "moved" / name)
    quick.clear()
    assert run(work / "moved", "--quiet", "--resume") == 0 and quick == []


def test_files_that_options_name_count_too(work: Path, quick: list) -> None:
    mask = work / "mask.png"
    save(mask, np.zeros((180, 240), np.uint8))
    assert run(work, "--quiet", "--ignore-ref", str(mask)) == 0
    save(mask, np.tri(180, 240, dtype=np.uint8) * 255)
    quick.clear()
    assert run(work, "--quiet", "--resume", "--ignore-ref", str(mask)) == 0 and len(quick) == 3


def test_a_panorama_that_somebody_changed_is_not_replaced(work: Path, said: Callable, quick: list) -> None:
    assert run(work, "--quiet") == 0
    (work / "out" / "p2.png").write_bytes(b"retouched")
    before = files(work / "out")
    quick.clear()
    assert run(work, "--resume") == 4 and "p2.png exists and is not as this command left it" in said()[-1]
    assert files(work / "out") == before and quick == []
    assert run(work, "--resume", "--overwrite", "--quiet") == 0 and quick == ["reference2"]


def test_other_pairs_may_join_a_folder_that_is_resumed(work: Path, quick: list) -> None:
    assert run(work, "--quiet") == 0
    lines = "in/reference1.png,in/target1.png,p1", "in/reference1.png,in/target2.png,p4"
    (work / "good.csv").write_text("\n".join(lines), "utf-8")
    quick.clear()
    assert run(work, "--quiet", "--resume") == 0 and quick == ["reference1"]
    assert of_pairs("p1", "p2", "p3", "p4") < set(files(work / "out"))


# --- shards ---------------------------------------------------------------------------------------------------------


def test_shards_share_the_work_and_make_the_same(work: Path, quick: list) -> None:
    assert run(work, "--quiet") == 0
    for shard in ("2/2", "1/2"):
        quick.clear()
        assert run(work, "--quiet", "--shard", shard, out="shards") == 0
        assert quick == {"1/2": ["reference1", "reference3"], "2/2": ["reference2"]}[shard]
    assert lasting(work / "shards") == lasting(work / "out") and len(lasting(work / "out")) == 9
    counts = {n: summary(work / "shards", f"batch.shard-{n}-of-2.json")["total"] for n in (1, 2)}
    assert counts == {1: 2, 2: 1} and not (work / "shards" / "batch.json").exists()
    quick.clear()  # and a run over all finds them all
    assert run(work, "--quiet", "--resume", out="shards") == 0 and quick == []


def test_a_shard_without_work_is_done(work: Path, said: Callable, quick: list) -> None:
    assert run(work, "--shard", "4/4") == 0 and said()[-1].endswith("0 done, 0 skipped, 0 failed")
