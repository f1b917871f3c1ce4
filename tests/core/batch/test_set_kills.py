"""A batch is killed while the files of a set are put in place: the next run makes all of it, and nothing else."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.batch import run as batch
from edf_stitch.core.commands.cli import main
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pipeline import StitchResult, stitch

from ...sets import make_set
from .batch_work import killed_at, lasting, save

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forked processes")


@pytest.fixture(scope="module")
def of_three() -> StitchResult:
    return stitch(make_set(3, size=(240, 180)).pictures, StitchOptions(dense=False, measure=False))


@pytest.fixture
def made(of_three: StitchResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], int]:
    """Runs a batch of one set, whose stitch takes no time, into a folder of this name."""
    (tmp_path / "in").mkdir()
    for number in (1, 2, 3):
        save(tmp_path / "in" / f"{number}.png", np.full((9, 9, 3), number))
    (tmp_path / "sets.csv").write_text("in,,one\n", "utf-8")
    monkeypatch.setattr(batch, "stitch", lambda *_: of_three)

    def run(out: str) -> int:
        words = ["--layers", "--warp", "--resume", "--quiet"]
        return main(["batch", str(tmp_path / "sets.csv"), "-o", str(tmp_path / out), *words])

    return run


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("place", [
    pytest.param(place, marks=() if place in (4, 12) else (pytest.mark.slow, pytest.mark.soak))
    for place in range(1, 21)
])  # fmt: skip
def test_a_set_whose_files_are_half_in_place_is_made_again(
    tmp_path: Path, made: Callable[[str], int], place: int
) -> None:
    """The first files are the summary's and the stamp's."""
    assert made("whole") == 0
    whole = lasting(tmp_path / "whole")
    child = os.fork()
    if not child:
        killed_at(place)
        os._exit(made("out"))
    assert os.WIFSIGNALED(os.waitpid(child, 0)[1]), "it had not come to its end"
    for name, data in lasting(tmp_path / "out").items():
        assert Path(name).name.startswith(".edf-") or data == whole[name], name
    assert made("out") == 0
    assert lasting(tmp_path / "out") == whole
