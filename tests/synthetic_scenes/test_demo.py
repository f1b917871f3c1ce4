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
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.raster.sampling import fetch
from edf_stitch.core.system.errors import StitchError, UnwritableOutput
from edf_stitch.synthetic_scenes import demo
from edf_stitch.synthetic_scenes.rendered import RenderedPair
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet

WRITTEN = {*demo.FILES, *(f"{demo.SET_FOLDER}/{name}" for name in demo.SET_FILES)}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, rendered: RenderedPair, small_set: RenderedSet) -> None:
    """The demo with a pair and a set that have been rendered."""
    monkeypatch.setattr(demo, "rendered_pair", lambda *_: rendered)
    monkeypatch.setattr(demo, "rendered_set", lambda *_: small_set)


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a folder, by their path in it."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def figures_in(lines: list[str]) -> list[tuple[str, str]]:
    """The figures, as the text and the unit around each, that stand in lines."""
    found = [re.fullmatch(r"(.*\S) +(-?\d+\.\d{3}) (\S+)", line) for line in lines]
    return [(one[1], one[3]) for one in found if one]


@pytest.mark.usefixtures("quick")
def test_it_writes_its_files_and_says_what_it_measured(tmp_path: Path, rendered: RenderedPair) -> None:
    folder = tmp_path / "made" / "for it"
    stages: list[tuple[str, float]] = []
    lines = demo.run_demo(folder, False, lambda stage, share: stages.append((stage, share)))
    assert set(contents(folder)) == WRITTEN
    truth = cv2.imread(str(folder / "truth.png"))
    assert truth.shape == rendered.wide.shape
    focal = rendered.cameras["reference"].K[0, 0]
    assert json.loads((folder / "report.json").read_text("utf-8"))["two_view"]["focal_px"] == [focal, focal]
    assert stages[0][0] == "render" and stages[-1][0] == "write"
    assert [share for _, share in stages] == sorted(share for _, share in stages) and stages[-1][1] <= 1

    said, files = lines[: -len(WRITTEN)], lines[-len(WRITTEN) :]
    assert figures_in(said) == [(label, unit) for _, label, unit in (*demo.MEASURES, *demo.SET_MEASURES)]
    assert [line for line in said if line.endswith(":")] == ["Two pictures:", "3 pictures:"]
    assert {Path(line) for line in files} == {folder / name for name in WRITTEN}

    before = contents(folder)
    with pytest.raises(UnwritableOutput, match="exists"):
        demo.run_demo(folder, False)
    assert contents(folder) == before
    demo.run_demo(folder, True)
    again = contents(folder)
    assert {name for name in again if again[name] != before[name] and not name.endswith(".timing.json")} == set()
    assert set(again) == WRITTEN


@pytest.mark.usefixtures("quick")
def test_the_true_panorama_lies_as_the_sets_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    true = demo.true_panorama
    monkeypatch.setattr(demo, "true_panorama", lambda found: made.append(found) or true(found))
    demo.run_demo(tmp_path, False)
    ours, beside = (cv2.imread(str(tmp_path / demo.SET_FOLDER / name)) for name in ("panorama.png", "truth.png"))
    assert ours.shape == beside.shape
    mild, true_mild = (cv2.GaussianBlur(picture, (0, 0), 3).astype(float) for picture in (ours, beside))
    aside = [np.roll(mild, by, axis=axis) for axis in (0, 1) for by in (-6, 6)]
    assert min(np.abs(one - true_mild).mean() for one in aside) > 1.5 * np.abs(mild - true_mild).mean()
    # what the first picture shows it shows from the same place
    (found,) = made
    camera = found.cameras[found.numbers.index(0)]
    points = np.array([[60.0, 60.0], [120.0, 90.0], [190.0, 120.0]])
    rays = homogeneous(points) @ np.linalg.inv(camera.K).T @ camera.R
    canvas = found.result.canvas
    x, y = (canvas.projection.points(rays @ found.gauge.T) + np.array(canvas.offset)).astype(np.float32).T[:, None]
    x_true, y_true = (part.astype(np.float32)[None] for part in found.truth.rendered.sphere.pixels(rays))
    there = fetch(found.truth.rendered.shown, x_true, y_true)
    assert fetch(true(found), x, y) == pytest.approx(there, abs=0.05)


@pytest.mark.usefixtures("quick")
def test_a_set_that_does_not_connect_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = demo.told_pictures
    monkeypatch.setattr(demo, "told_pictures", lambda rendered: told(rendered)[:2])
    with pytest.raises(StitchError, match="did not connect"):
        demo.run_demo(tmp_path / "new", False)
    assert list(tmp_path.iterdir()) == []


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
    first = next(number for number, line in enumerate(lines) if line.endswith(".png"))
    assert all((tmp_path / line).is_file() for line in lines[first:])
    assert {"reference.png", "target.png", "00.png", "04.png"} <= {Path(line).name for line in lines[first:]}
    pair, of_set = (
        {key: float(line[demo.LABEL :].split()[0]) for (key, *_), line in zip(measures, lines[at:], strict=False)}
        for measures, at in ((demo.MEASURES, 1), (demo.SET_MEASURES, len(demo.MEASURES) + 2))
    )
    assert pair["rotation_deg"] < 0.1 and pair["alignment_px"] < 0.5 and pair["whole_psnr_db"] > 25
    assert of_set["rotation_max_deg"] < 0.1 and of_set["overlap_px"] < 0.5 and of_set["psnr_db"] > 28
    assert np.isfinite(np.load(tmp_path / "out" / "warp.npz")["map_x_01"]).any()
