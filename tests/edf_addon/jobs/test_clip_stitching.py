"""From clips in the panel to frames on disk, a movie clip and an image sequence, through a real worker."""

from pathlib import Path

import cv2
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import status  # noqa: E402
from edf_stitch.edf_addon.jobs import clip_stitching, job, modal  # noqa: E402
from edf_stitch.edf_addon.operators.clips import EDF_OT_stitch_clip_frames, first_frames  # noqa: E402


@pytest.fixture
def clips(blender, small_pair, tmp_path):
    """Two sequences of three frames that count differently, in the list."""
    (tmp_path / "in").mkdir()
    for side, first in (("reference", 1), ("target", 101)):
        for at in range(3):
            path = tmp_path / "in" / f"{side}_{first + at:04d}.png"
            cv2.imwrite(str(path), getattr(small_pair, side)[..., ::-1])
    names = [{"name": "reference_0001.png"}, {"name": "target_0101.png"}]
    assert bpy.ops.edf.add_clips(directory=str(tmp_path / "in"), files=names) == {"FINISHED"}
    blender.settings.dense = False
    return blender


def test_clips_become_frames_a_movie_clip_and_a_sequence(clips, tmp_path):
    assert clip_stitching.common_range(clips.settings) == (1, 3)
    assert bpy.ops.edf.stitch_clips(last=2) == {"FINISHED"}
    made = tmp_path / "in" / "stitched" / "reference"
    assert sorted(path.name for path in made.glob("*.png")) == ["reference_000001.png", "reference_000002.png"]
    (clip,) = [one for one in bpy.data.movieclips if "stitched" in one.filepath]
    assert clip.source == "SEQUENCE" and clip.frame_start == 1 and clip.size[0] > 300
    (image,) = [one for one in bpy.data.images if "stitched" in one.filepath]
    assert image.source == "SEQUENCE"
    assert "2 frames" in status.now.message and "2 of them new" in status.now.message
    (made / "reference_000002.png").unlink()
    assert bpy.ops.edf.stitch_clips(last=2) == {"FINISHED"}
    assert [one for one in bpy.data.movieclips if "stitched" in one.filepath] == [clip] and clip.frame_duration == 2
    assert "2 frames" in status.now.message and "1 of them new" in status.now.message, "it went on"


def test_all_frames_of_a_sequence_are_one_clip_and_each_movie_is_one():
    names = ("left_2.png", "left_10.png", "right_2.png", "left_2.exr", "take 1.mp4", "take 2.mp4", "a.png", "2_a.png",
             "1_a.png")  # fmt: skip
    found = first_frames(Path("in", name) for name in names)
    assert [path.name for path in found] == [name for name in names if name not in ("left_10.png", "1_a.png")]


def test_the_scenes_frames_count(clips):
    clips.settings.clips[1].clip.frame_start = 11
    clips.settings.clips[1].clip.frame_offset = 1
    assert clip_stitching.common_range(clips.settings) == (11, 3)
    told = clip_stitching.make_job(clips.scene, 11, 12, "out", "EXR")["clip"]
    assert told["folder"] == str(Path("out").absolute()), "the worker stands elsewhere"
    assert [camera["start"] for camera in told["cameras"]] == [1, 10] and told["suffix"] == ".exr"


def test_what_cannot_be_stitched_says_why(clips):
    settings = clips.settings
    settings.camera = "CAMERAS"
    assert "scene cameras" in clip_stitching.why_not(settings)
    settings.camera = "AUTOMATIC"
    settings.clips.add().clip = settings.clips[0].clip
    assert "twice" in clip_stitching.why_not(settings)
    bpy.ops.edf.remove_clip(row=2)
    bpy.ops.edf.remove_clip(row=1)
    with pytest.raises(RuntimeError, match="two clips or more"):
        bpy.ops.edf.stitch_clips()


def test_frames_that_are_nowhere_are_said_and_nothing_is_made(clips):
    with pytest.raises(RuntimeError, match="No frame from 200 to 201 is in all clips"):
        bpy.ops.edf.stitch_clips(first=200, last=201)
    assert not [one for one in bpy.data.movieclips if "stitched" in one.filepath]


def test_a_folder_that_is_nowhere_yet_or_that_nothing_can_be_written_into_is_said(clips, tmp_path):
    with pytest.raises(RuntimeError, match=r"^Error: “//out” lies beside the \.blend file, which is nowhere yet"):
        bpy.ops.edf.stitch_clips(folder="//out")
    (tmp_path / "file").touch()
    with pytest.raises(RuntimeError, match="^Error: .*out: .*file is a file, not a folder"):
        bpy.ops.edf.stitch_clips(folder=str(tmp_path / "file" / "out"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    told = clip_stitching.make_job(bpy.context.scene, 1, 2, "//out", "PNG")["clip"]
    assert Path(told["folder"]) == tmp_path / "out"


def test_cancelled_says_that_finished_frames_stay(clips, monkeypatch):
    begin = job.start

    def start_and_cancel(*given):
        begun = begin(*given)
        begun.cancel()
        return begun

    monkeypatch.setattr(modal.job, "start", start_and_cancel)
    assert bpy.ops.edf.stitch_clips() == {"CANCELLED"}
    assert status.now.message == EDF_OT_stitch_clip_frames.when_cancelled
