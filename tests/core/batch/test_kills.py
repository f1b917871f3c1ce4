"""A worker of a farm is killed without warning: whatever it leaves, the next run makes all of it, and trusts nothing
that is not whole."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from edf_stitch.core.batch.pieces import read_json
from edf_stitch.core.commands.cli import main

from ...pairs import KNOWN_WORDS
from . import batch_work
from .batch_work import files, killed_at, lasting, run

work, quick = batch_work.work, batch_work.quick

needs_kill = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forked processes")
KILLS = 50


@needs_kill
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("remade", [False, True], ids=["first", "remade"])
def test_a_kill_between_any_two_files_is_survived(
    work: Path, quick: list, monkeypatch: pytest.MonkeyPatch, remade: bool
) -> None:
    """Also where other files stood there, made by other options."""
    (work / "good.csv").write_text("in/reference1.png,in/target1.png,p1\n", "utf-8")
    assert run(work, "--quiet", "--layers", out="whole") == 0
    whole, kills = lasting(work / "whole"), 0
    for place in range(1, 30):
        out = f"out{place}"
        if remade:
            assert run(work, "--quiet", "--layers", "--seed", "5", out=out) == 0
            (work / out / "p1.report.json").write_bytes(b"as other options had it")
        child = os.fork()
        if not child:
            killed_at(place)
            os._exit(run(work, "--quiet", "--layers", "--resume", out=out))
        status = os.waitpid(child, 0)[1]
        for name, data in lasting(work / out).items():
            assert name.endswith(".tmp") or data == whole[name] or (remade and name == "p1.report.json"), name
        quick.clear()
        assert run(work, "--quiet", "--layers", "--resume", out=out) == 0
        assert lasting(work / out) == whole, place
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0 and quick == []
            break
        kills += 1
        assert quick == ["reference1"] or set(files(work / out)) == set(files(work / "whole"))
    assert kills > len(whole), "a summary, two stamps, and each of the files"


@needs_kill
@pytest.mark.slow
@pytest.mark.soak
def test_workers_killed_at_any_moment(work: Path) -> None:
    """Fifty kills of whole processes, at seeded moments: half anywhere, half while something is being written."""
    command = [
        sys.executable, "-m", "edf_stitch", "batch", str(work / "good.csv"), "-o", str(work / "out"), *KNOWN_WORDS,
        "--layers", "--resume", "--quiet", "--no-cache",
    ]  # fmt: skip
    assert main([str(work / "whole") if word == str(work / "out") else word for word in command[3:]]) == 0
    whole, chance, kills, finished = lasting(work / "whole"), random.Random(27), 0, 0
    began = time.monotonic()
    subprocess.run(command, check=True)
    seconds = time.monotonic() - began
    while kills < KILLS:
        if lasting(work / "out") == whole:
            finished += 1
            shutil.rmtree(work / "out")
        worker = subprocess.Popen(command)
        if kills % 2:
            _wait(lambda: worker.poll() is not None or any((work / "out").glob("**/.edf-*.tmp")))  # noqa: B023
            time.sleep(chance.uniform(0, 0.05))
        else:
            time.sleep(chance.uniform(0, seconds))
        worker.send_signal(signal.SIGKILL)
        kills += worker.wait() == -signal.SIGKILL
        _check_whole(work / "out", whole)
    subprocess.run(command, check=True)
    assert lasting(work / "out") == whole
    print(f"{kills} kills, {finished} times all was made in spite of them")


def _wait(until: Callable[[], bool]) -> None:
    while not until():
        time.sleep(0.002)


def _check_whole(out: Path, whole: dict[str, bytes]) -> None:
    """What stands under its name is whole, and what a stamp calls finished is complete."""
    there = lasting(out)
    for name, data in there.items():
        assert Path(name).name.startswith(".edf-") or data == whole[name], name
    for number in (1, 2, 3):
        if read_json(out / ".edf" / f"p{number}.json").get("made_from"):
            assert {name for name in whole if name.startswith(f"p{number}")} <= there.keys()
