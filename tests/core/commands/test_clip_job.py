"""Clips for a program that watches: frames laid out by its numbers, movies as pictures, gone on with."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.batch.list import BatchItem
from edf_stitch.core.commands import clip_job
from edf_stitch.core.commands.clip_job import lay_out, stitch_clip
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.system.errors import BadRequest, StitchError, UnreadableImage, UnwritableOutput
from edf_stitch.synthetic_scenes.two_planes import Pair


def silent(_what: str, _share: float) -> None:
    pass


def sequence(folder: Path, stem: str, first: int, pictures: list[np.ndarray]) -> Path:
    """Files STEM0012.png and on; returns the first."""
    for at, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{stem}{first + at:04d}.png"), picture[..., ::-1])
    return folder / f"{stem}{first:04d}.png"


def movie(path: Path, pictures: list[np.ndarray]) -> Path:
    height, width = pictures[0].shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (width, height))
    for picture in pictures:
        writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()
    return path


GRAYS = [np.full((32, 48, 3), level, np.uint8) for level in (40, 80, 120, 160)]


def test_a_sequence_is_laid_out_by_the_programs_numbers(tmp_path: Path) -> None:
    path = sequence(tmp_path, "shot_v2.", 12, GRAYS)
    (tmp_path / "shot_v2.0014.png").unlink()
    pattern = lay_out({"path": str(path), "start": 1}, range(2, 6), tmp_path / "out", silent)
    assert pattern.name == "frame_%06d.png"
    assert sorted(one.name for one in pattern.parent.iterdir()) == ["frame_000002.png", "frame_000004.png"]
    assert cv2.imread(str(pattern.parent / "frame_000004.png")).mean() == 160
    ages = [(folder / name).stat().st_mtime_ns for folder, name in (
        (pattern.parent, "frame_000004.png"), (tmp_path, "shot_v2.0015.png"),
    )]  # fmt: skip
    assert ages[0] == ages[1]


def test_a_movie_is_laid_out_as_pictures_as_old_as_it(tmp_path: Path) -> None:
    path = movie(tmp_path / "shot.avi", GRAYS)
    pattern = lay_out({"path": str(path), "start": 10}, range(11, 13), tmp_path / "out", silent)
    found = sorted(pattern.parent.iterdir())
    assert [one.name for one in found] == ["frame_000011.png", "frame_000012.png"]
    assert [round(cv2.imread(str(one)).mean() / 10) for one in found] == [8, 12]
    assert {one.stat().st_mtime_ns for one in found} == {path.stat().st_mtime_ns}


def test_what_is_no_clip_is_refused_in_words(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "still.png"), GRAYS[0])
    (tmp_path / "not.mp4").write_bytes(b"no movie")
    with pytest.raises(BadRequest, match="no number in its name"):
        lay_out({"path": str(tmp_path / "still.png"), "start": 1}, range(1, 2), tmp_path / "out", silent)
    with pytest.raises(UnreadableImage, match="is no movie"):
        lay_out({"path": str(tmp_path / "not.mp4"), "start": 1}, range(1, 2), tmp_path / "out", silent)


def test_damaged_frames_are_named_by_their_clip(tmp_path: Path) -> None:
    for stem in ("left_", "right_"):
        (tmp_path / f"{stem}0012.png").write_bytes(b"nonsense")
    clip = {
        "cameras": [{"path": str(tmp_path / f"{stem}0012.png"), "start": 1} for stem in ("left_", "right_")],
        "first": 1, "last": 1, "folder": str(tmp_path / "out"), "name": "both", "suffix": ".png",
    }  # fmt: skip
    with pytest.raises(StitchError, match="frame 1 of left_0012.png: not a picture") as refused:
        stitch_clip(tmp_path, clip, StitchOptions(), silent, lambda: False)
    assert ".edf-" not in str(refused.value)
    with pytest.raises(BadRequest, match="two clips or more"):
        stitch_clip(tmp_path, {**clip, "cameras": clip["cameras"][:1]}, StitchOptions(), silent, lambda: False)
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(UnwritableOutput, match="is a file, not a folder"):
        stitch_clip(tmp_path, {**clip, "folder": str(tmp_path / "file")}, StitchOptions(), silent, lambda: False)


def test_a_damaged_frame_of_a_movie_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = movie(tmp_path / "shot.avi", GRAYS)
    real = cv2.VideoCapture

    class Damaged:
        def __init__(self, name: str) -> None:
            self.movie, self.at = real(name), 0

        def __getattr__(self, name: str) -> object:
            return getattr(self.movie, name)

        def retrieve(self) -> tuple[bool, np.ndarray | None]:
            self.at += 1
            return (False, None) if self.at == 2 else self.movie.retrieve()

    monkeypatch.setattr(cv2, "VideoCapture", Damaged)
    pattern = lay_out({"path": str(path), "start": 1}, range(1, 4), tmp_path / "out", silent)
    assert sorted(one.name for one in pattern.parent.iterdir()) == ["frame_000001.png", "frame_000003.png"]


def test_clips_that_count_differently_become_one_and_are_gone_on_with(tmp_path: Path, small_pair: Pair) -> None:
    (tmp_path / "in").mkdir()
    left = sequence(tmp_path / "in", "left_", 1, [small_pair.reference] * 3)
    right = sequence(tmp_path / "in", "right_", 101, [small_pair.target] * 3)
    clip = {
        "cameras": [{"path": str(left), "start": 1}, {"path": str(right), "start": 1}],
        "first": 1, "last": 2, "folder": str(tmp_path / "out"), "name": "both", "suffix": ".png",
    }  # fmt: skip
    said: list[str] = []

    def run(**changed: int) -> dict:
        options = StitchOptions(dense=False)
        stitch_clip(tmp_path, {**clip, **changed}, options, lambda what, _: said.append(what), lambda: False)
        return json.loads((tmp_path / "result.json").read_text("utf-8"))

    found = run()
    assert (found["frames"], found["done"], found["skipped"], found["failed"]) == ([1, 2], 2, 0, "")
    assert found["path"] == str(tmp_path / "out" / "both" / "both_000001.png") and Path(found["path"]).is_file()
    assert any(what.startswith("frame 2 of 2: ") for what in said)
    assert not list((tmp_path / "out").glob(".edf-*")), "what was laid out goes"
    assert (run()["done"], run()["skipped"]) == (0, 2)


def test_two_at_once_into_one_folder_lay_out_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one that begins later takes nothing from the other."""
    left, right = (sequence(tmp_path, stem, 1, GRAYS) for stem in ("left_", "right_"))
    clip = {
        "cameras": [{"path": str(one), "start": 1} for one in (left, right)],
        "first": 1, "last": 4, "folder": str(tmp_path / "out"), "name": "one", "suffix": ".png",
    }  # fmt: skip
    found: list[list[bool]] = []

    def batch(items: list[BatchItem], *rest: object) -> object:
        if items[0].name == "one":
            with pytest.raises(StitchError, match="stopped"):
                stitch_clip(tmp_path, {**clip, "name": "two"}, StitchOptions(), silent, lambda: False)
        found.append([path.is_file() for path in items[0].files(2)])
        raise StitchError("stopped")

    monkeypatch.setattr(clip_job, "run_batch", batch)
    with pytest.raises(StitchError, match="stopped"):
        stitch_clip(tmp_path, clip, StitchOptions(), silent, lambda: False)
    assert found == [[True, True], [True, True]]
    assert not list((tmp_path / "out").iterdir())
