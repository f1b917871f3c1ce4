"""Clips in `edf batch`: one alignment for all frames, frames that are missing or bad, resumed and in shards."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.batch import run as batch
from edf_stitch.core.batch.list import read_list
from edf_stitch.core.batch.pieces import BatchRequest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.pipeline import StitchOptions, stitch
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...sets import FOCAL, make_set
from ..textured_room import flat, sphere, turned
from . import batch_work
from .batch_work import files, lasting, raw, run, save, summary

said = batch_work.said

# What the clip's pictures show together is found by the first test that stitches it.
pytestmark = pytest.mark.usefixtures("with_cache")

FRAMES = (7, 8, 9, 10)
SIDE = 48


def make_clip(folder: Path, small_pair: Pair) -> Path:
    """A folder with in/a_0007.png … and in/b_0007.png … of four frames through which something walks, and clip.csv."""
    (folder / "in").mkdir()
    random = np.random.default_rng(3)
    for at, number in enumerate(FRAMES):
        for side, picture, start in (("a", small_pair.reference, 10), ("b", small_pair.target, 0)):
            shown = picture.copy()
            left = start + at * SIDE  # textured, and nowhere near where an alignment would want it
            shown[120 : 120 + SIDE, left : left + SIDE] = random.integers(0, 256, (SIDE, SIDE, 3), np.uint8)
            save(folder / "in" / f"{side}_{number:04d}.png", shown)
    (folder / "clip.csv").write_text("in/a_%04d.png,in/b_####.png,shot\n", "utf-8")
    return folder


@pytest.fixture
def work(tmp_path: Path, small_pair: Pair) -> Path:
    return make_clip(tmp_path, small_pair)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, small_pair: Pair) -> Path:
    """The same with the clip stitched into out/, in one go. Nothing is to be written there."""
    folder = make_clip(tmp_path_factory.mktemp("clip"), small_pair)
    assert clip(folder) == 0
    return folder


def clip(work: Path, *arguments: str, out: str = "out") -> int:
    return run(work, "--warp", "--layers", *arguments, items="clip.csv", out=out)


def panoramas(folder: Path) -> dict[str, np.ndarray]:
    return {path.stem: raw(path) for path in sorted((folder / "shot").glob("*.png"))}


def test_a_clip_has_one_alignment_and_nothing_swims(whole: Path) -> None:
    out = whole / "out"
    made = panoramas(out)
    assert list(made) == [f"shot_{number:04d}" for number in FRAMES]
    assert len({picture.shape for picture in made.values()}) == 1, "one canvas"
    height, width = made["shot_0007"].shape[:2]
    with np.load(out / "shot.warp.npz") as warp:
        x, y = warp["offset"]
        map_x, map_y = warp["map_x_01"], warp["map_y_01"]
    assert map_x.shape == (height, width)
    for at, (name, number) in enumerate(zip(made, FRAMES, strict=True)):
        reference = raw(out / "shot" / f"{name}.layers" / f"00_a_{number:04d}.png")
        assert np.array_equal(reference[y : y + 180, x : x + 240, :3], raw(whole / "in" / f"a_{number:04d}.png"))
        # what does not walk stands still, to the last bit, also where only the target shows it
        target = raw(out / "shot" / f"{name}.layers" / f"01_b_{number:04d}.png")
        walking = np.hypot(map_x - at * SIDE - SIDE / 2, map_y - 120 - SIDE / 2) < SIDE
        first = np.hypot(map_x - SIDE / 2, map_y - 120 - SIDE / 2) < SIDE
        still = (target[..., 3] > 0) & ~walking & ~first
        assert still.sum() > 15_000
        assert np.array_equal(target[still], raw(out / "shot" / "shot_0007.layers" / "01_b_0007.png")[still])
    report = json.loads((out / "shot.report.json").read_text("utf-8"))
    assert report["clip"] == {"frames": list(FRAMES), "aligned_on": list(FRAMES), "shown": 7}
    assert report["pictures"][0]["name"] == "a_0007.png" and report["matches"]["found"] > 400
    assert set(files(out)) == {
        "batch.json", ".edf/shot.json", *(f".edf/shot/{name}.json" for name in made),
        *(f"shot.{kind}" for kind in ("report.json", "matches.csv", "timing.json", "warp.npz")),
        *(f"shot/{name}{one}" for name in made for one in (
            ".png", ".layers/occluded_01.png", ".layers/confidence.png", ".layers/labels.png", ".layers/seam.png",
            ".layers/canvas.json")),
        *(f"shot/shot_{number:04d}.layers/0{i}_{side}_{number:04d}.png" for number in FRAMES
          for i, side in enumerate("ab")),
    }  # fmt: skip
    (item,) = summary(out)["items"]
    assert (item["status"], item["panorama"], item["size"]) == ("done", "shot/shot_0007.png", [width, height])
    assert item["frames"] == {"done": 4, "skipped": 0, "failed": [], "missing": []}
    assert item["measured"] == report["measured"] and "overlap_psnr_db" in item["measured"]


def test_frames_stitched_one_by_one_would_swim(whole: Path, known: StitchOptions) -> None:
    """What the test above relies on."""
    maps = [stitch([whole / "in" / f"{side}_{n:04d}.png" for side in "ab"], known).warp.maps[1].x for n in FRAMES[:2]]
    assert maps[0].shape != maps[1].shape or not np.array_equal(*maps)


def test_missing_frames_are_told_and_left_out(work: Path, said: Callable) -> None:
    (work / "in" / "b_0008.png").unlink()
    (work / "clip.csv").write_text("reference,target,name,first,last\nin/a_%04d.png,in/b_%04d.png,shot,7,12\n", "utf-8")
    assert clip(work, "--quiet") == 0
    assert said() == ["edf: warning: shot: frames 8, 11–12 are missing of some cameras and were left out"]
    assert list(panoramas(work / "out")) == ["shot_0007", "shot_0009", "shot_0010"]
    assert summary(work / "out")["items"][0]["frames"]["missing"] == [8, 11, 12]


def test_a_bad_frame_is_reported_and_the_rest_goes_on(
    work: Path, whole: Path, said: Callable, small_pair: Pair
) -> None:
    """The first cannot be read, another has another size: the alignment is taken from the others."""
    good = {side: (work / "in" / side).read_bytes() for side in ("a_0007.png", "b_0009.png")}
    (work / "in" / "a_0007.png").write_bytes(b"not a picture")
    save(work / "in" / "b_0009.png", small_pair.target[:-2])
    assert clip(work, "--keep-going") == 1
    line = said()[0]
    assert line.startswith("edf: [1/1] shot: failed: 2 of 4 frames; frame 7: ") and "a_0007.png: not a picture" in line
    assert list(panoramas(work / "out")) == ["shot_0008", "shot_0010"]
    (item,) = summary(work / "out")["items"]
    assert [(one["frame"], one["exit_code"]) for one in item["frames"]["failed"]] == [(7, 4), (9, 2)]
    assert "240×178" in item["frames"]["failed"][1]["message"] and item["frames"]["done"] == 2
    report = json.loads((work / "out" / "shot.report.json").read_text("utf-8"))
    assert report["clip"]["aligned_on"] == [8, 10] and report["clip"]["shown"] == 8
    # once repaired, all is made again: another alignment would make it swim
    for name, data in good.items():
        (work / "in" / name).write_bytes(data)
    assert clip(work, "--resume") == 0
    height, width = raw(work / "out" / "shot" / "shot_0007.png").shape[:2]
    assert said()[0] == f"edf: [1/1] shot: {width}×{height}, 4 frames done, 0 skipped"
    assert lasting(work / "out") == lasting(whole / "out")


def test_a_clip_without_frames(work: Path, said: Callable) -> None:
    (work / "clip.csv").write_text("in/c_%04d.png,in/b_%04d.png,shot\nin/a_%04d.png,in/b_%04d.png,other\n", "utf-8")
    assert clip(work, "--quiet", "--keep-going") == 1
    assert "edf: [1/2] shot: failed: no frame of" in said()[0] and (work / "out" / "other" / "other_0010.png").exists()
    for number in FRAMES:
        (work / "in" / f"a_{number:04d}.png").write_bytes(b"")
    assert clip(work, "--quiet", "--keep-going", out="none") == 1
    assert "[2/2] other: failed: none of the frames 7–10 can be used to align the clip: " in said()[1]
    assert set(files(work / "none")) == {"batch.json", ".edf/.failed/shot.json", ".edf/.failed/other.json"}


def test_an_interrupted_clip_goes_on_where_it_was(
    work: Path, whole: Path, said: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0
    original = batch.compose

    def compose(*args: object, **more: object) -> object:
        nonlocal calls
        calls += len(args) == 5  # what was decided is handed over
        if calls == 4:  # the report, 7, 8, then 9
            raise KeyboardInterrupt
        return original(*args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(batch, "compose", compose)
        assert clip(work) == 130
    assert list(panoramas(work / "out")) == ["shot_0007", "shot_0008"]
    assert len(files(work / "out")) == 2 * 8 + 4 + 3 + 1, "two frames with layers, the report's, stamps, batch.json"
    times = {path: path.stat().st_mtime_ns for path in (work / "out").rglob("shot*") if path.is_file()}
    said()
    assert clip(work, "--resume") == 0 and "2 frames done, 2 skipped" in said()[0]
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert lasting(work / "out") == lasting(whole / "out")
    assert clip(work, "--resume") == 0 and said()[0] == "edf: [1/1] shot: skipped, 0 frames done, 4 skipped"


def test_shards_of_a_clip_find_the_same_alignment(work: Path, whole: Path) -> None:
    for shard in ("3/3", "1/3", "2/3"):
        assert clip(work, "--shard", shard) == 0
    assert lasting(work / "out") == lasting(whole / "out")
    done = [summary(work / "out", f"batch.shard-{n}-of-3.json")["items"][0]["frames"]["done"] for n in (1, 2, 3)]
    assert done == [1, 2, 1], "the report counts as a turn"


def test_from_python_with_one_inscribed_crop_for_all_frames(work: Path, whole: Path, known: StitchOptions) -> None:
    """Also where a frame shows less than the others."""
    hole = raw(work / "in" / "b_0009.png")[..., ::-1]
    save(work / "in" / "b_0009.png", np.dstack([hole, np.where(np.arange(240) < 200, 255, 0)[None].repeat(180, 0)]))
    told: list[tuple[str, float]] = []
    items, options = read_list(work / "clip.csv"), replace(known, crop="inscribed")
    batch.run_batch(items, options, BatchRequest(work / "out"), lambda *step: told.append(step))
    made = list(panoramas(work / "out").values())
    assert len({picture.shape[:2] for picture in made}) == 1, "one canvas"
    assert [picture.shape[2] for picture in made] == [3, 3, 4, 3], "nothing transparent but the hole"
    assert made[0].shape[:2] < panoramas(whole / "out")["shot_0007"].shape[:2]
    shares = [share for _, share in told]
    assert shares == sorted(shares) and shares[0] == 0 and 0.9 < shares[-1] <= 1
    assert all(stage.startswith("[1/1] ") for stage, _ in told)


def test_a_clip_on_a_sphere_keeps_one_inscribed_crop(work: Path, known: StitchOptions) -> None:
    """A box of the whole sphere, found on the part of it that the pictures cover."""
    options = replace(known, projection="equirectangular", crop="inscribed")
    batch.run_batch(read_list(work / "clip.csv"), options, BatchRequest(work / "out"))
    made = list(panoramas(work / "out").values())
    assert len(made) == len(FRAMES) and len({picture.shape for picture in made}) == 1
    assert made[0].shape[2] == 3 and 100 < made[0].shape[0] < made[0].shape[1] < 400, "nothing transparent"
    report = json.loads((work / "out" / "shot.report.json").read_text("utf-8"))
    assert (report["canvas"]["height"], report["canvas"]["width"]) == made[0].shape[:2]


def test_a_clip_of_three_cameras_has_one_alignment(tmp_path: Path) -> None:
    """A fourth camera that shows something else is left out of every frame."""
    random, cameras = np.random.default_rng(5), make_set().pictures[:3]
    elsewhere = random.integers(0, 256, cameras[0].light.shape, np.uint8)
    for at, number in enumerate((3, 4, 5)):
        for side, picture in zip("abcd", [*cameras, elsewhere], strict=True):
            shown = picture.view.copy() if side != "d" else elsewhere
            if side == "a":
                shown[60 + 10 * at : 80 + 10 * at, 10:30] = random.integers(0, 256, (20, 20, 3), np.uint8)
            save(tmp_path / f"{side}_{number:04d}.png", shown)
    (tmp_path / "clip.csv").write_text(
        "reference,target,picture3,picture4,name\na_%04d.png,b_%04d.png,c_%04d.png,d_%04d.png,shot\n", "utf-8"
    )
    options = StitchOptions(camera=CameraRequest(focal_px=(FOCAL,)), blend="feather", slide=0.0, dense=False)
    summed_up = batch.run_batch(read_list(tmp_path / "clip.csv"), options, BatchRequest(tmp_path / "out"))
    (outcome,) = summed_up.outcomes
    assert outcome.status == "done", outcome.message
    assert any("d_0003.png is left out" in line for line in outcome.warnings)
    report = json.loads((tmp_path / "out" / "shot.report.json").read_text("utf-8"))
    assert [one["name"] for one in report["pictures"]] == ["a_0003.png", "b_0003.png", "c_0003.png"]
    made = list(panoramas(tmp_path / "out").values())
    assert len(made) == 3 and len({one.shape for one in made}) == 1
    changed = [(one != made[0]).any(axis=-1) for one in made[1:]]
    for mask in changed:
        assert 0 < mask.mean() < 0.02, "what moves, and nothing else"


@pytest.mark.slow
def test_a_clip_of_a_sphere_and_a_camera_tells_its_progress_as_that_of_many(tmp_path: Path) -> None:
    """Two files a frame, and nine pictures: stages that a pair does not have."""
    at = np.array([0.1, 0.0, -0.2])
    for number in (1, 2):
        save(tmp_path / f"s_{number}.png", np.rint(sphere(at, turned(20), 400)).astype(np.uint8))
        save(tmp_path / f"a_{number}.png", flat(np.array([0.4, 0.1, 0.1]), turned(25), 190.0, (320, 240)))
    (tmp_path / "clip.csv").write_text("s_%d.png,a_%d.png,shot\n", "utf-8")
    told: list[float] = []
    summed_up = batch.run_batch(
        read_list(tmp_path / "clip.csv"), StitchOptions(dense=False, blend="feather"), BatchRequest(tmp_path / "out"),
        lambda stage, share: told.append(share),
    )  # fmt: skip
    (outcome,) = summed_up.outcomes
    assert outcome.status == "done", outcome.message
    assert np.diff(told).min() > -0.01 and 0.9 < told[-1] <= 1
