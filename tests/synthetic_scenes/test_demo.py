"""`edf demo` makes its files and prints what it measured."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.system.errors import UnwritableOutput
from edf_stitch.synthetic_scenes import demo
from edf_stitch.synthetic_scenes.rendered import RenderedPair


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, rendered: RenderedPair) -> None:
    """The demo with a pair that has been rendered."""
    monkeypatch.setattr(demo, "rendered_pair", lambda *_: rendered)


@pytest.mark.usefixtures("quick")
def test_it_writes_its_files_and_says_what_it_measured(tmp_path: Path, rendered: RenderedPair) -> None:
    folder = tmp_path / "made" / "for it"
    stages: list[str] = []
    lines = demo.run_demo(folder, False, lambda stage, _: stages.append(stage))
    assert {path.name for path in folder.iterdir()} == set(demo.FILES)
    truth = cv2.imread(str(folder / "truth.png"))
    assert truth.shape == rendered.wide.shape
    focal = rendered.cameras["reference"].K[0, 0]
    assert json.loads((folder / "report.json").read_text("utf-8"))["two_view"]["focal_px"] == [focal, focal]
    assert stages[0] == "render" and stages[-1] == "write"

    figures = [re.fullmatch(r"(.*\S) +(-?\d+\.\d{3}) (degrees|px|dB)", line) for line in lines[: len(demo.MEASURES)]]
    assert all(figures) and [one[3] for one in figures] == [unit for _, _, unit in demo.MEASURES]
    assert [Path(line) for line in lines[len(figures) :]] == [folder / name for name in demo.FILES]

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(UnwritableOutput, match="exists"):
        demo.run_demo(folder, False)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    demo.run_demo(folder, True)
    again = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert [name for name in demo.FILES if again[name] != before[name]] in ([], ["report.timing.json"])


@pytest.mark.usefixtures("quick")
def test_trouble_half_way_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def trouble(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "write", trouble)
    with pytest.raises(KeyboardInterrupt):
        demo.run_demo(tmp_path / "new", False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_command_as_a_user_calls_it(tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    line = [sys.executable, "-m", "edf_stitch", "demo", "-o", "out"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8", timeout=300)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    lines = done.stdout.splitlines()
    assert all((tmp_path / line).is_file() for line in lines[len(demo.MEASURES) :])
    assert {"reference.png", "target.png"} <= {Path(line).name for line in lines}
    said = {key: float(line[demo.LABEL :].split()[0]) for (key, *_), line in zip(demo.MEASURES, lines, strict=False)}
    assert said["rotation_deg"] < 0.1 and said["alignment_px"] < 0.5 and said["whole_psnr_db"] > 25
    assert np.isfinite(np.load(tmp_path / "out" / "warp.npz")["map_x_01"]).any()
