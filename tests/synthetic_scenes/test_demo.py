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
from edf_stitch.core.colour import encode
from edf_stitch.core.errors import UnwritableOutput
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.synthetic_scenes import demo
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry, pose_errors
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at

FILES = {
    "reference.png", "target.png", "panorama.png", "truth.png", "warp.npz", "report.json", "report.timing.json",
    "report.matches.csv",
}  # fmt: skip


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, small_pair: Pair) -> None:
    """The demo with a small pair: seconds instead of ten."""
    monkeypatch.setattr(demo, "make_pair", lambda: small_pair)


def read(path: Path) -> np.ndarray:
    return np.ascontiguousarray(cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1])


@pytest.mark.usefixtures("quick")
def test_it_writes_its_files_and_says_what_it_measured(tmp_path: Path, small_pair: Pair) -> None:
    folder = tmp_path / "made" / "for it"
    steps: list[float] = []
    lines = demo.run_demo(folder, False, lambda _, total: steps.append(total))
    assert {path.name for path in folder.iterdir()} == FILES
    assert np.array_equal(read(folder / "reference.png"), small_pair.reference)
    assert np.array_equal(read(folder / "target.png"), small_pair.target)
    assert read(folder / "panorama.png").shape == read(folder / "truth.png").shape
    assert json.loads((folder / "report.json").read_text("utf-8"))["two_view"]["focal_px"] == [228, 228]
    assert steps and steps == sorted(steps)

    figures = [re.fullmatch(r"(.*\S) +(-?\d+\.\d{3}) (degrees|px|dB)", line) for line in lines[: len(demo.MEASURES)]]
    assert all(figures) and [one[3] for one in figures] == [unit for _, _, unit in demo.MEASURES]
    assert [Path(line) for line in lines[len(figures) :]] == [folder / name for name in (
        "reference.png", "target.png", "panorama.png", "truth.png", "warp.npz", "report.json", "report.timing.json",
        "report.matches.csv")]

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(UnwritableOutput, match="reference.png exists"):
        demo.run_demo(folder, False)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    demo.run_demo(folder, True)
    again = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert [name for name in FILES if again[name] != before[name]] in ([], ["report.timing.json"])


@pytest.mark.usefixtures("quick")
def test_trouble_half_way_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def trouble(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "write", trouble)
    with pytest.raises(KeyboardInterrupt):
        demo.run_demo(tmp_path / "new", False)
    assert list(tmp_path.iterdir()) == []


def test_the_figures_are_what_their_names_say(pair: Pair, result: StitchResult) -> None:
    truth = demo.true_panorama(pair, result)
    measured = demo.measure(pair, result, truth)
    assert set(measured) >= {key for key, _, _ in demo.MEASURES}
    geometry = TrueGeometry.of(pair.reference_camera, pair.target_camera)
    assert {name: measured[name] for name in pose_errors(result.two_view, geometry, (400, 300))} == pose_errors(
        result.two_view, geometry, (400, 300))

    rows, columns = np.nonzero(result.warp.inside((400, 300)))
    points = np.column_stack([columns, rows]).astype(float) - result.warp.canvas.offset
    mapped = np.column_stack([result.warp.map_x[rows, columns], result.warp.map_y[rows, columns]]).astype(float)
    error = np.linalg.norm(mapped - geometry.target_pixels(points, depth_at(pair.reference_camera, points)), axis=1)
    assert measured["alignment_px"] == pytest.approx(np.median(error), rel=0.02), "a sample of the pixels"
    shown = result.alpha > 0
    squares = (encode(result.pixels, 8)[shown].astype(float) - truth[shown]) ** 2
    assert measured["psnr_db"] == pytest.approx(10 * np.log10(255**2 / squares.mean()), abs=1e-3)


def test_the_true_panorama_is_the_references_view_widened(pair: Pair, result: StitchResult) -> None:
    truth = demo.true_panorama(pair, result)
    assert truth.shape == (*result.alpha.shape, 3) and truth.dtype == np.uint8
    x, y = result.warp.canvas.offset
    assert np.array_equal(truth[y : y + 300, x : x + 400], pair.reference)


@pytest.mark.slow
def test_the_command_as_a_user_calls_it(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "edf_stitch", "demo", "-o", "out"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8", timeout=300)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(demo.MEASURES) + len(FILES) and (tmp_path / lines[-1]).is_file()
    figures = {key: float(line[46:].split()[0]) for (key, _, _), line in zip(demo.MEASURES, lines, strict=False)}
    assert figures["rotation_deg"] < 0.5 and figures["alignment_px"] < 0.5 and figures["psnr_db"] > 20
