"""`edf validate`: scenes apart from each other, resumed, in shards, one report whoever measured what."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from edf_stitch.core.system.errors import BadRequest, UnwritableOutput
from edf_stitch.synthetic_scenes import pair_bars, validation
from edf_stitch.synthetic_scenes.recipes import FULL, RECIPES
from edf_stitch.synthetic_scenes.scene_process import WAYS, file_name
from edf_stitch.synthetic_scenes.sets import set_thresholds
from edf_stitch.synthetic_scenes.suites import SUITES, heading, is_set
from edf_stitch.synthetic_scenes.validation import Validation, ValidationRequest, made_from, run_validation

QUICK = SUITES["quick"]
FIGURES = {
    "rotation_deg": 0.01, "focal_percent": 0.5, "epipole_deg": 0.1, "h_inf_px": 0.2, "h_inf_p95_px": 0.3, "f_px": 0.1,
    "projectivity_px": 0.05, "projectivity_p95_px": 0.1, "alignment_px": 0.1, "alignment_p95_px": 0.5, "beyond_px": 0.3,
    "beyond_p90_px": 1.5, "slid_auto_px": 0.1, "slid_auto_p95_px": 0.5, "slid_half_px": 0.1, "slid_half_p95_px": 0.5,
    "slid_auto_reference_px": 0.0,
    "overlap_psnr_db": 30.0, "overlap_ssim": 0.9, "covered": 1.0, "whole_psnr_db": 30.0, "whole_ssim": 0.9,
    "over_average_db": 1.0, "over_average_ssim": 0.01, "overlap_over_average_db": 9.0, "source_fidelity_mean": 0.99,
    "source_fidelity_p5": 0.95, "seam_visibility": 0.5,
}  # fmt: skip
RIVALS = {
    "known/paper": 28.0, "known/rew": 28.5, "known/apap": 27.5, "known/spw": 27.8, "known/lpc": 27.9,
    "known/homography": 27.0,
}  # fmt: skip
PROOF = {
    "position_px": 0.001, "depth_relative": 1e-7, "ray_cast_relative": 1e-6, "f_px": 0.001, "warp_psnr_db": 40.0,
    "half_pixel_psnr_db": 30.0, "wide_psnr_db": 50.0,
}  # fmt: skip


def good_entry(scene: str, mark: str, size: tuple[int, int]) -> dict[str, Any]:
    """A scene's figures as a perfect program would leave them."""
    if is_set(scene):
        return good_set(scene, mark, size)
    recipe = RECIPES[scene.partition(":")[0]]
    own = pair_bars.measured(scene, recipe.size(*size))
    runs = {
        way: {
            "model": None if way in RIVALS and way != "known/paper" else recipe.model, "undetermined_said": True,
            "refused": "", "warnings": [],
            "figures": {**FIGURES, **(own if way == pair_bars.RUN else {}), "whole_psnr_db": RIVALS.get(way, 30.0)},
        }
        for way in WAYS
    }  # fmt: skip
    return {
        "schema": 1, "scene": scene, "title": recipe.title, "size": list(recipe.size(*size)),
        "expected_model": recipe.model, "parallax": recipe.parallax, "focal_determined": recipe.focal_determined,
        "status": "done", "message": "", "blender": "4.5", "made_from": mark, "proof": PROOF, "runs": runs,
        "pictures": {},
    }  # fmt: skip


def good_set(scene: str, mark: str, size: tuple[int, int]) -> dict[str, Any]:
    """The same of a set."""
    proof = {limit.measure: limit.at_least or 0.0 for limit in set_thresholds.PROOF}
    ours = {bar.measure: bar.measured for bar in set_thresholds.BARS[scene]}
    runs = {
        way: {"refused": "", "warnings": [], "used": 5, "left_out": [], "by_picture": [],
              "figures": {**ours, set_thresholds.LEAD: 25.0 - behind}}
        for way, behind in ((set_thresholds.OURS, 0.0), (set_thresholds.ROTATION_ONLY, 5.0))
    }  # fmt: skip
    return {
        "schema": 1, **heading(scene, size), "status": "done", "message": "", "blender": "4.5", "made_from": mark,
        "proof": proof, "runs": runs, "pictures": {"sphere": f"scenes/{scene}/sphere.jpg"},
    }  # fmt: skip


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The scenes that processes would have measured; each leaves a good entry at once."""
    scenes: list[str] = []

    def measure(_: object, scene: str, request: ValidationRequest, mark: str) -> str:
        scenes.append(scene)
        if "foliage" in scene:
            return "Fatal Python error: Segmentation fault"
        folder = request.folder / "scenes"
        folder.mkdir(exist_ok=True)
        (folder / f"{file_name(scene)}.json").write_text(json.dumps(good_entry(scene, mark, request.size)), "utf-8")
        (folder / f"{file_name(scene)}.timing.json").write_text('{"known/strict field": 1.0}', "utf-8")
        return ""

    monkeypatch.setattr(validation._Running, "scene", measure)
    monkeypatch.setattr(validation, "find_blender", lambda: "blender")
    return scenes


def run(folder: Path, **settings: Any) -> Validation:
    return run_validation(ValidationRequest(folder, **settings), lambda _: None)


def report(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in ("report.json", "report.csv", "report.html")}


def test_all_scenes_of_a_suite_are_measured_once_and_reported(tmp_path: Path, measured: list[str]) -> None:
    done = run(tmp_path / "new")
    assert sorted(measured) == sorted(QUICK) and done.exit_code == 0 and not done.missing
    assert [entry["scene"] for entry in json.loads(report(tmp_path / "new")["report.json"])["scenes"]] == list(QUICK)
    assert set(json.loads((tmp_path / "new" / "timing.json").read_bytes())) == set(QUICK)
    assert {path.name for path in done.files} == {"report.json", "report.csv", "report.html", "timing.json"}


@pytest.mark.parametrize("count", [2, 3, 7])
def test_shards_make_the_same_report_byte_for_byte(tmp_path: Path, measured: list[str], count: int) -> None:
    run(tmp_path / "one", suite="full")
    assert sorted(measured) == sorted(FULL)
    for index in range(count, 0, -1):  # in any order
        done = run(tmp_path / "many", suite="full", shard=(index, count), resume=True)
        assert (done.verdict is None) == bool(done.missing) == (index > 1)
    assert report(tmp_path / "one") == report(tmp_path / "many")


def test_each_scene_belongs_to_one_shard() -> None:
    parts = [ValidationRequest(Path("x"), "full", shard=(k, 4)).own_scenes for k in range(1, 5)]
    assert sorted(scene for part in parts for scene in part) == sorted(FULL)


def test_resuming_measures_what_is_missing_failed_or_of_another_program(
    tmp_path: Path, measured: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes = ("street", "foliage", "relief")
    assert run(tmp_path, scenes=scenes).exit_code == 1
    before = report(tmp_path)
    for gone, expected in ((None, {"foliage"}), ("relief", {"foliage", "relief"})):
        if gone:
            (tmp_path / "scenes" / f"{gone}.json").unlink()
        measured.clear()
        run(tmp_path, scenes=scenes, resume=True)
        assert set(measured) == expected and report(tmp_path) == before
    (tmp_path / "scenes" / "street.json").write_text('{"scene": "street", "made_fr', "utf-8")  # killed half way
    measured.clear()
    run(tmp_path, scenes=scenes, resume=True)
    assert set(measured) == {"street", "foliage"} and report(tmp_path) == before
    monkeypatch.setattr(validation, "made_from", lambda: "another program")
    measured.clear()
    run(tmp_path, scenes=scenes, resume=True)
    assert set(measured) == set(scenes)


def test_a_crash_is_reported_and_the_rest_goes_on(tmp_path: Path, measured: list[str]) -> None:
    told: list[str] = []
    done = run_validation(ValidationRequest(tmp_path, scenes=("foliage", "street")), told.append)
    first, second = done.results
    assert (first["status"], second["status"]) == ("failed", "done") and "Segmentation" in first["message"]
    assert done.exit_code == 1 and any("Segmentation" in line for line in told)
    assert b"Segmentation" in report(tmp_path)["report.html"]


def test_what_is_there_is_not_replaced_unasked(tmp_path: Path, measured: list[str]) -> None:
    run(tmp_path)
    measured.clear()
    with pytest.raises(UnwritableOutput, match="--resume"):
        run(tmp_path)
    assert not measured
    run(tmp_path, overwrite=True)
    assert sorted(measured) == sorted(QUICK)


@pytest.mark.parametrize(
    "settings",
    [{"suite": "huge"}, {"scenes": ("nowhere",)}, {"scenes": ("street:fog=1",)}, {"scenes": ("small_room:turn=2",)},
     {"shard": (3, 2)}, {"shard": (0, 2)},
     {"scenes": ("street", "street")}],
    ids=str,
)  # fmt: skip
def test_bad_requests(tmp_path: Path, settings: dict[str, Any]) -> None:
    with pytest.raises(BadRequest):
        ValidationRequest(tmp_path, **settings)


def test_the_mark_follows_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    assert made_from() == made_from() and len(made_from()) == 16
    before = made_from()
    monkeypatch.setattr(validation, "PARTS", ("core",))
    assert made_from() != before


def test_a_real_process_that_cannot_render_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A true scene_process whose Blender is a program that fails."""
    fake = tmp_path / "blender"
    fake.write_text("#!/bin/sh\necho 'no graphics today' >&2\nexit 9\n", "utf-8")
    fake.chmod(0o755)
    monkeypatch.setenv("EDF_BLENDER", str(fake))
    done = run(tmp_path / "out", scenes=("street",))
    assert done.exit_code == 1 and "no graphics today" in done.results[0]["message"]
    assert "Traceback" not in done.results[0]["message"]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "SIGTERM"])
def test_interrupted_it_leaves_no_process_and_130(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wait_until: Callable[..., None], how: signal.Signals
) -> None:
    fake, pid = tmp_path / "blender", tmp_path / "pid"
    fake.write_text(f"#!/bin/sh\necho $$ > {pid}.new; mv {pid}.new {pid}\nexec sleep 3600\n", "utf-8")
    fake.chmod(0o755)
    monkeypatch.setenv("EDF_BLENDER", str(fake))
    line = [sys.executable, "-m", "edf_stitch", "validate", "-o", str(tmp_path / "out"), "--scene", "street"]
    with subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as job:
        wait_until(pid.exists)
        job.send_signal(how)
        said = job.communicate(timeout=600)[1]
    assert job.returncode == 130 and "--resume" in said and "Traceback" not in said, said
    wait_until(lambda: not runs(int(pid.read_text())))
    assert not list((tmp_path / "out").rglob("*.tmp"))


def runs(pid: int) -> bool:
    """Whether a process is at work. One that has ended may stay listed: not every machine's first process clears up."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.fixture
def wait_until() -> Callable[..., None]:
    def wait(condition: Callable[[], bool]) -> None:
        for _ in range(6000):
            if condition():
                return
            time.sleep(0.1)
        raise AssertionError("it never came")

    return wait
