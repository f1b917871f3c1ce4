"""From two images of a file to a panorama in it, through the operators and a real worker."""

import json
import os
import signal
import time
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.system.progress import STAGES
from edf_stitch.synthetic_scenes.two_planes import Pair

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import properties, status  # noqa: E402
from edf_stitch.edf_addon.bridge import images, result  # noqa: E402
from edf_stitch.edf_addon.jobs import command, job, modal, stitching  # noqa: E402
from edf_stitch.edf_addon.operators import stitch  # noqa: E402

from .. import picture_files  # noqa: E402


def event(kind: str = "TIMER", value: str = "NOTHING") -> SimpleNamespace:
    return SimpleNamespace(type=kind, value=value)


class Modal(stitch._Stitching):
    """A stitch as Blender's window runs it, one event after the other, where there is no window."""

    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []

    def report(self, kind: set[str], words: str) -> None:
        self.said.append((*kind, words))

    def until(self, reached) -> set[str]:
        end = time.monotonic() + 600  # for a worker that hangs; a machine may be slow
        while True:
            answer = self.modal(bpy.context, event())
            if answer != {"PASS_THROUGH"} or reached():
                return answer
            assert time.monotonic() < end
            time.sleep(0.005)


@pytest.fixture
def working(chosen) -> Modal:
    one = Modal()
    assert one._start(bpy.context)
    return one


def names() -> set[str]:
    return {image.name for image in bpy.data.images}


def test_a_script_gets_the_panorama(chosen, pixels_of):
    """Opaque where the reference lies, whose every pixel is kept; and everything else that an artist may ask."""
    settings = chosen.settings
    settings.take_layers = settings.take_masks = settings.take_depth = True
    bpy.ops.edf.reference_frame()
    settings.crop = "REFERENCE"
    settings.blend = "FEATHER"  # multi-band evens light out a little way into the part that only the reference shows
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    panorama = settings.result
    assert panorama.name == "reference panorama" and panorama.use_fake_user and panorama.packed_file
    assert not panorama.is_float and panorama.colorspace_settings.name == "sRGB"
    alone = pixels_of(result.companions(panorama)["target mask"])[..., 0] == 0
    assert alone.mean() > 0.1
    assert np.array_equal(pixels_of(panorama)[alone], pixels_of(settings.reference)[alone]), "top is top"
    kept = result.read(panorama)
    assert [one["name"] for one in kept["pictures"]] == ["reference.png", "target.png"]
    assert kept["report"]["two_view"]["model"] == "general" and kept["has_depth"]
    assert kept["geometry"]["full_sizes"] == [[240, 180], [240, 180]]
    assert len(kept["matches"]["rows"]) == len(settings.matches) > 50
    others = result.companions(panorama)
    assert set(others) == {"reference layer", "target layer", "reference mask", "target mask", "inverse depth", "heat",
                           "difference", "occluded", "seam", "confidence"}  # fmt: skip
    assert {tuple(image.size) for image in others.values()} == {tuple(panorama.size)}
    assert others["inverse depth"].is_float and others["heat"].name.startswith(".")
    assert "px in" in status.now.message and not status.now.failed and not modal.is_working()
    assert kept["report"]["verdict"]["is"] == "good" and "look" not in status.now.message


def test_the_same_again_from_what_the_panorama_keeps(chosen, pixels_of):
    """Saved, opened again, restored, stitched again without a search: the same panorama."""
    settings = chosen.settings
    settings.field, settings.seed = "STRICT", 3
    bpy.ops.edf.stitch()
    first = pixels_of(settings.result).copy()
    count = sum(match.enabled for match in settings.matches)
    path = os.path.join(bpy.app.tempdir, "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    os.unlink(path)
    settings = bpy.context.scene.edf_stitch
    assert np.array_equal(pixels_of(settings.result), first)
    bpy.ops.edf.reset()
    settings.matches.clear()
    settings.reference = settings.target = None
    assert bpy.ops.edf.restitch() == {"FINISHED"}
    assert (settings.field, settings.seed, settings.edited_matches) == ("STRICT", 3, True)
    assert sum(match.enabled for match in settings.matches) == count
    again = pixels_of(settings.result)
    assert np.array_equal(again, first)


def test_a_list_that_was_not_touched_makes_the_same_panorama(chosen, pixels_of):
    """At another scale too; what was switched off and on again counts as untouched, and what stays off does not."""
    settings = chosen.settings
    settings.scale = 0.6
    bpy.ops.edf.stitch()
    first = pixels_of(settings.result)
    match = next(match for match in settings.matches if match.enabled)
    match.enabled = False
    settings.edited_matches = True
    assert stitching.untouched_matches(settings) == ""
    match.enabled = True
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    assert np.array_equal(pixels_of(settings.result), first)
    match.x += 0.5
    assert stitching.untouched_matches(settings) == ""
    match.x -= 0.5
    assert stitching.untouched_matches(settings)
    settings.reference, settings.target = settings.target, settings.reference
    assert stitching.untouched_matches(settings) == "", "of other pictures"


def test_edited_matches_are_used_and_nothing_else(chosen):
    settings = chosen.settings
    bpy.ops.edf.stitch()
    settings.edited_matches = True
    keep = [match.enabled for match in settings.matches]
    off = keep.index(True)
    settings.matches[off].enabled = False
    places = [(match.x, match.y2) for match in settings.matches]
    assert bpy.ops.edf.preview() == {"FINISHED"}
    assert [(match.x, match.y2) for match in settings.matches] == places
    kept = result.read(settings.result)
    assert kept["report"]["matches"]["found"] == sum(keep) - 1
    assert kept["matches"]["weights"][off] == 0 and kept["matches"]["states"][off] == "LEFT_OUT"
    assert settings.matches[off].error >= 0, "what is switched off is measured all the same"


def test_a_preview_is_small_and_takes_the_place_of_the_last(chosen):
    settings = chosen.settings
    settings.preview_scale = 0.6
    bpy.ops.edf.preview()
    settings.preview_scale = 0.5
    bpy.ops.edf.preview()
    assert settings.result.name == "reference preview"
    assert len([name for name in names() if "preview" in name]) == 3, names()  # itself, heat, difference
    kept = result.read(settings.result)
    assert kept["report"]["options"]["scale"] == 0.5 and kept["geometry"]["full_sizes"][0] == [240, 180]
    match = max(settings.matches, key=lambda match: match.x)
    assert match.x > 150, "matches are in px of the full pictures"


def test_a_pair_of_float_images_gives_a_float_panorama(chosen, folder, pixels_of, tmp_path):
    """Painted over, linear, brighter than white: nothing is lost on the way."""
    settings = chosen.settings
    for side in ("reference", "target"):
        light = picture_files.read(folder / f"{side}.png").pixels * 4
        setattr(settings, side, bpy.data.images.load(picture_files.write(tmp_path / f"{side}.exr", light)))
    bpy.ops.edf.reference_frame()
    settings.crop, settings.blend, settings.take_masks = "REFERENCE", "FEATHER", True
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    panorama = settings.result
    assert panorama.is_float and panorama.colorspace_settings.name == "Linear Rec.709"
    here, there = pixels_of(panorama), pixels_of(settings.reference)
    alone = pixels_of(result.companions(panorama)["target mask"])[..., 0] == 0
    assert alone.mean() > 0.1 and here.max() > 2
    assert np.abs(here - there)[alone].max() < 1e-6


def shifted_gradient(width: int, height: int, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """A texture over a gradient, (H, W, 3) uint8 that gets brighter to the right and redder to the bottom, and the
    same some pixels further to the right."""
    random = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(width + shift), np.arange(height))
    spots = np.kron(random.integers(-40, 40, (height // 6 + 1, (width + shift) // 6 + 1)), np.ones((6, 6)))
    base = 60 + 120 * x / (width + shift) + spots[:height, : width + shift]
    whole = np.clip(np.stack([base + 60 * y / height, base, base + 20], axis=-1), 0, 255).astype(np.uint8)
    return whole[:, :width], whole[:, shift:]


@pytest.mark.parametrize("kind", ["bytes", "float"])
def test_colours_and_rows_survive_the_whole_way(blender, tmp_path, kind):
    """A pure shift: every pixel of the panorama is known. Compared value by value in the files that were saved."""
    left, right = shifted_gradient(240, 160, 60)
    truth = np.concatenate([left, right[:, -60:]], axis=1)
    settings = blender.settings
    for side, array in (("reference", left), ("target", right)):
        light = picture_from_array(array).pixels
        path = tmp_path / f"{side}{'.png' if kind == 'bytes' else '.exr'}"
        setattr(settings, side, bpy.data.images.load(picture_files.write(path, light)))
    rows = [(x, y, x - 60, y) for x in range(70, 235, 12) for y in range(8, 155, 12)]
    for x, y, x2, y2 in rows:
        match = settings.matches.add()
        match.x, match.y, match.x2, match.y2 = x, y, x2, y2
    settings.edited_matches = True
    bpy.ops.edf.reference_frame()
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    for suffix in (".exr", ".png"):
        assert bpy.ops.edf.save(filepath=str(tmp_path / f"out{suffix}")) == {"FINISHED"}
        saved = picture_files.read(tmp_path / f"out{suffix}")
        height, width = saved.view.shape[:2]
        assert abs(width - 300) <= 1 and abs(height - 160) <= 1
        expected = picture_from_array(truth).pixels
        inner = (slice(2, 156), slice(2, 230))  # the reference alone: exact
        top, left_edge = 0, 0
        apart = np.abs(saved.pixels[top : top + 160, left_edge : left_edge + 300] - expected[:height, :width])
        assert apart[inner].max() < (2e-6 if kind == "float" and suffix == ".exr" else 2 / 255)
        assert np.median(apart[2:156, 245:296]) < 0.01
        assert saved.pixels[100:, :, 0].mean() > saved.pixels[:60, :, 0].mean(), "redder to the bottom"


def worker_that(monkeypatch, prepare: str) -> None:
    """The real worker, after Python code that has its module at hand as `worker`."""
    line, environment = command.worker_command([], job.WORKER)
    code = f"import sys\nfrom {line[-1].removesuffix('.' + job.WORKER)}.{job.WORKER.rpartition('.')[0]} import worker\n"
    code += f"from pathlib import Path\n{prepare}\nsys.exit(worker.main(Path(sys.argv[1])))"
    python = line[: line.index("-m")]
    monkeypatch.setattr(command, "worker_command", lambda argv, _: ([*python, "-c", code, *argv], environment))


def pausing_at(monkeypatch, stage: str) -> None:
    """The worker stops to think at the stage, so that it is there when something happens to it."""
    pause = "import time; say, kind, stops = worker._say, worker._Stop, []\n"
    pause += "worker._Stop = lambda: stops.append(kind()) or stops[0]\n"
    pause += f"def pausing(line):\n say(line)\n if line.get('stage') == {stage!r}:\n"
    # asked, and not only interrupted: Python swallows an interruption that falls into the end of an object
    pause += "  (Path(sys.argv[1]) / 'paused').touch()\n  while not stops[0].asked: time.sleep(0.01)\n"
    pause += "  raise KeyboardInterrupt\nworker._say = pausing"
    worker_that(monkeypatch, pause)


@pytest.mark.parametrize("stage", STAGES)
def test_cancel_at_every_stage_leaves_nothing(chosen, monkeypatch, stage):
    if stage in ("read", "features", "geometry", "field", "dense"):  # what is kept is not looked for
        monkeypatch.setenv("EDF_CACHE", os.devnull)
    pausing_at(monkeypatch, stage)
    monkeypatch.setattr(job, "GRACE", 300)  # it ends by itself, however long a busy machine takes over that
    chosen.settings.dense = chosen.settings.exposure = True  # with all that has a stage of its own
    chosen.settings.seam = "GRAPHCUT"
    working = Modal()
    assert working._start(bpy.context)
    before = names()
    # the first stage is taken for granted while Python starts up, and cancelled then it ends in another way
    working.until(lambda: status.now.stage == stage and (working._job.folder / "paused").exists())
    assert status.now.running and status.now.stage == stage
    modal.cancel()
    assert status.now.cancelling
    assert working.until(lambda: False) == {"CANCELLED"}
    assert working.said == [("INFO", "Cancelled. Nothing was changed.")]
    assert working._job._process.returncode in (130, -signal.SIGINT), "it ended by itself"
    assert names() == before and not modal.is_working() and not status.now.running


def test_a_result_that_cannot_be_taken_over_leaves_the_file_as_it_was(working, monkeypatch):
    """The last of its pictures is damaged: nothing of the others stays either."""
    before = names()
    bring = images.bring

    def damaged(path, name, pack, fake_user):
        if name.endswith("difference"):
            path.write_bytes(b"no picture")
        return bring(path, name, pack, fake_user)

    monkeypatch.setattr(images, "bring", damaged)
    assert working.until(lambda: False) == {"CANCELLED"}
    assert working.said[0][0] == "ERROR" and "cannot be taken over" in working.said[0][1]
    assert names() == before and bpy.context.scene.edf_stitch.result is None and status.now.failed


def test_a_match_that_was_moved_meanwhile_stays_unmeasured(blender):
    for _ in range(2):
        match = blender.settings.matches.add()
        match.x = 5
    found = {"rows": [[5, 0, 0, 0]] * 2, "errors": [0.5, 0.5], "states": ["USED"] * 2, "weights": [1, 1]}
    blender.settings.matches[1].x = 6
    stitching.fill_matches(blender.settings, found, edited=True)
    assert [match.error for match in blender.settings.matches] == [0.5, -1]
    blender.settings.matches.add()
    stitching.fill_matches(blender.settings, {**found, "errors": [3, 3]}, edited=True)
    assert blender.settings.matches[0].error == 0.5, "the list is another one by now"


def test_escape_cancels_and_other_keys_reach_blender(working, monkeypatch):
    assert working.modal(bpy.context, event("A", "PRESS")) == {"PASS_THROUGH"}
    monkeypatch.setattr(modal, "_is_over_editor", lambda *_: False)
    assert working.modal(bpy.context, event("ESC", "PRESS")) == {"PASS_THROUGH"}, "it is meant for another editor"
    monkeypatch.setattr(modal, "_is_over_editor", lambda *_: True)
    assert working.modal(bpy.context, event("ESC", "PRESS")) == {"RUNNING_MODAL"}
    assert working.until(lambda: False) == {"CANCELLED"}
    assert status.now.message == "Cancelled. Nothing was changed."


def test_a_killed_worker_gives_a_message_and_changes_nothing(chosen, monkeypatch):
    pausing_at(monkeypatch, "features")
    working = Modal()
    assert working._start(bpy.context)
    before = names()
    working.until(lambda: status.now.stage == "features")
    os.kill(working._job._process.pid, signal.SIGKILL)
    assert working.until(lambda: False) == {"CANCELLED"}
    assert working.said[0][0] == "ERROR" and "want of memory" in working.said[0][1]
    assert names() == before and status.now.failed


def test_opening_another_file_ends_the_work(working):
    process, folder = working._job._process, working._job.folder
    bpy.ops.wm.read_homefile(use_empty=True)
    assert process.poll() is not None and not folder.exists() and not modal.is_working()
    assert "another file" in status.now.message
    assert working.modal(bpy.context, event()) == {"CANCELLED"}


def test_switching_off_ends_the_work(working):
    import edf_stitch

    process = working._job._process
    edf_stitch.unregister()
    assert process.poll() is not None and not modal.is_working()
    edf_stitch.register()


def test_one_work_at_a_time(working):
    assert not bpy.ops.edf.stitch.poll() and not bpy.ops.edf.preview.poll()
    assert bpy.ops.edf.cancel.poll()
    second = Modal()
    assert not second._start(bpy.context)
    assert "still at work" in second.said[0][1] and status.now.running
    assert bpy.ops.edf.cancel() == {"FINISHED"}
    working.until(lambda: False)
    assert not bpy.ops.edf.cancel.poll()


def test_a_reference_that_is_deleted_meanwhile_changes_nothing_for_the_work(working):
    bpy.data.images.remove(bpy.context.scene.edf_stitch.reference)
    assert working.until(lambda: False) == {"FINISHED"}
    settings = bpy.context.scene.edf_stitch
    assert settings.result.name == "reference panorama" and settings.reference is None
    with pytest.raises(RuntimeError, match="“reference.png”, the reference of this panorama, is no longer in the file"):
        bpy.ops.edf.restitch()


def test_a_scene_that_is_deleted_meanwhile(working):
    first = bpy.context.scene
    bpy.data.scenes.new("other")
    bpy.data.scenes.remove(first)
    assert working.until(lambda: False) == {"FINISHED"}
    assert "reference panorama" in names()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: setattr(s, "target", s.reference), "both reference and target"),
        (lambda s: setattr(s, "target", None), "takes two pictures or more"),
        (lambda s: setattr(s, "camera", "CAMERAS"), "No reference camera is chosen"),
        (lambda s: setattr(s, "edited_matches", True), "none that is switched on"),
        (lambda s: setattr(s, "crop", "BOX"), "not a part of the panorama"),
        (lambda s: setattr(s, "ignore_reference", white(8, 8)), "a mask needs the picture's size"),
        (lambda s: setattr(s, "ignore_reference", white(240, 180)), "invert the mask"),
        (lambda s: setattr(s, "target", white(240, 180)), "points of detail"),
        (lambda s: setattr(s, "target", bpy.data.images.load(s.reference.filepath)), "the same picture"),
        (lambda s: setattr(s, "target", noise(240, 180)), "match"),
    ],
)
def test_what_cannot_be_stitched_is_said_in_words(chosen, change, words):
    before = names()
    change(chosen.settings)
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.edf.stitch()
    assert status.now.failed and words in status.now.message
    assert not [name for name in names() - before if "panorama" in name]


def noise(width: int, height: int):
    """A picture that has nothing in common with any other."""
    spots = np.kron(np.random.default_rng(1).random((height // 4, width // 4)), np.ones((4, 4)))
    image = bpy.data.images.new("noise", width, height)
    image.pixels.foreach_set(np.dstack([spots] * 3 + [np.ones_like(spots)]).astype(np.float32).ravel())
    return image


def white(width: int, height: int):
    image = bpy.data.images.new("white", width, height)
    image.pixels.foreach_set(np.ones(width * height * 4, np.float32))
    return image


def test_what_is_painted_out_is_kept_out(chosen):
    """The right half of the target: hardly any of it is left in the panorama."""
    mask = bpy.data.images.new("mask", 240, 180)
    paint = np.zeros((180, 240, 4), np.float32)
    paint[..., 3] = 1
    paint[:, 160:] = 1
    mask.pixels.foreach_set(paint.ravel())
    chosen.settings.ignore_target = mask
    bpy.ops.edf.stitch()
    assert all(match.x2 < 164 for match in chosen.settings.matches)
    assert result.read(chosen.settings.result)["settings"]["ignore_target"] == "mask"


def test_two_cameras_of_the_scene_give_the_geometry(chosen, small_pair: Pair):
    from edf_stitch.core.cameras.blender_camera import lens_for, matrix_world_of

    took = {"reference": small_pair.reference_camera, "target": small_pair.target_camera}
    for side, known in took.items():
        lens = lens_for(known.K, (240, 180))
        data = bpy.data.cameras.new(side)
        data.lens, data.sensor_width, data.sensor_fit = lens.lens, lens.sensor_width, lens.sensor_fit
        data.shift_x, data.shift_y = lens.shift_x, lens.shift_y
        camera = bpy.data.objects.new(side, data)
        chosen.scene.collection.objects.link(camera)
        camera.matrix_world = matrix_world_of(known.R, known.t).T  # Blender takes columns
        setattr(chosen.settings, f"{side}_camera", camera)
    bpy.context.view_layer.update()
    chosen.settings.camera = "CAMERAS"
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    report = result.read(chosen.settings.result)["report"]
    R = took["target"].R @ took["reference"].R.T
    assert np.allclose(report["two_view"]["R"], R, atol=1e-5)
    assert np.allclose(report["two_view"]["K"], took["reference"].K, atol=1e-3)
    assert report["two_view"]["focal_source"] == "camera file"


def test_two_files_are_opened_at_once(blender, folder):
    opened = bpy.ops.edf.open_pair(
        directory=str(folder), files=[{"name": "target.png"}, {"name": "reference.png"}]
    )
    assert opened == {"FINISHED"}
    assert (blender.settings.reference.name, blender.settings.target.name) == ("reference.png", "target.png")
    with pytest.raises(RuntimeError, match="two pictures .1 was chosen"):
        bpy.ops.edf.open_pair(directory=str(folder), files=[{"name": "target.png"}])


def test_names_choose_images(chosen):
    chosen.settings.reference = chosen.settings.target = None
    with pytest.raises(RuntimeError, match="no image named “nothing”"):
        bpy.ops.edf.stitch(reference="nothing", target="target.png")
    assert bpy.ops.edf.stitch(reference="reference.png", target="target.png") == {"FINISHED"}


def test_what_a_file_of_somebody_else_keeps_is_no_result(blender):
    image = bpy.data.images.new("x", 4, 4)
    for kept in ("", "{", "[1]", '{"version": 999}', json.dumps({"version": "1"})):
        image[result.KEY] = kept
        assert result.read(image) is None
    image[result.KEY] = 5
    assert result.read(image) is None and result.read(None) is None


def test_settings_of_a_later_version_are_taken_as_far_as_they_are_known(blender):
    kept = properties.keep(blender.settings)
    kept |= {"field": "NO_SUCH_FIELD", "from_the_future": 3, "seed": 9, "reference_camera": "gone"}
    blender.settings.field = "PAPER"
    properties.restore(blender.settings, kept, {})
    assert (blender.settings.field, blender.settings.seed) == ("SLACK", 9)
    assert json.loads(json.dumps(kept)) == kept


def test_a_broken_library_is_told_in_words(chosen, monkeypatch):
    from edf_stitch.edf_addon.jobs import health

    worker_that(monkeypatch, "sys.modules['cv2'] = None")
    assert health.problem() == ""
    with pytest.raises(RuntimeError, match="cannot be loaded.*cv2"):
        bpy.ops.edf.stitch()
    assert "reinstall" in health.problem()
    monkeypatch.undo()
    bpy.ops.edf.stitch()
    assert health.problem() == ""


def test_another_pair_does_not_inherit_the_edited_matches(chosen, folder):
    files = [{"name": "reference.png"}, {"name": "target.png"}]
    chosen.settings.edited_matches = True
    bpy.ops.edf.open_pair(directory=str(folder), files=files)
    assert chosen.settings.edited_matches, "the same pair again"
    chosen.settings.target = bpy.data.images.new("other", 8, 8)
    bpy.ops.edf.open_pair(directory=str(folder), files=files)
    assert not chosen.settings.edited_matches


def test_the_slider_starts_where_the_viewpoint_was_chosen(blender):
    """And stays where an artist has put it."""
    settings, memory = blender.settings, {"settings": {"slide_auto": True}}
    stitching._leave_the_slide(settings, memory, {"slide": {"s1": 0.5, "part": [0.25, 0.75]}})
    assert settings.slide == 0.5 and tuple(settings.slide_part) == (0.25, 0.75)
    stitching._leave_the_slide(settings, memory, {})
    settings.slide_auto = False
    stitching._leave_the_slide(settings, memory, {"slide": {"s1": 1.0, "part": [0.0, 1.0]}})
    assert settings.slide == 0.5
