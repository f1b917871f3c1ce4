"""A panorama owns its pictures, cameras and matches, whatever is chosen, renamed or replaced since it was stitched."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import status  # noqa: E402
from edf_stitch.edf_addon.bridge import cameras, images, ownership, result  # noqa: E402
from edf_stitch.edf_addon.operators import match_editing  # noqa: E402
from edf_stitch.edf_addon.overlays import drawing  # noqa: E402
from edf_stitch.edf_addon.scene import take_along  # noqa: E402

from .jobs.test_stitching import Modal  # noqa: E402

ROLES = ("REFERENCE", "TARGET")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Where the file lies that `settings` makes once and opens each time."""
    return tmp_path_factory.mktemp("kept") / "stitched.blend"


@pytest.fixture
def settings(chosen, kept):
    """After a stitch of the small pair."""
    if not kept.exists():
        bpy.ops.edf.stitch()
        bpy.ops.wm.save_as_mainfile(filepath=str(kept))
    bpy.ops.wm.open_mainfile(filepath=str(kept))
    status.end("")
    return bpy.context.scene.edf_stitch


def other(name: str = "other", size: tuple[int, int] = (240, 180)):
    return bpy.data.images.new(name, *size)


def backgrounds(panorama) -> list:
    """What the panorama's two cameras show behind the scene."""
    bpy.ops.edf.create_cameras()
    cameras = [take_along.find(panorama, role).data for role in ROLES]
    return [one.background_images[0].image if len(one.background_images) else None for one in cameras]


def paint(image) -> None:
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    pixels[:4000] = 1 - pixels[:4000] / 2
    image.pixels.foreach_set(pixels)
    image.update()


def test_after_another_stitch_the_cameras_have_their_own_pictures_behind_them(settings):
    first, pair = settings.result, [settings.reference, settings.target]
    bpy.ops.edf.swap()
    bpy.ops.edf.stitch()
    second = settings.result
    assert second != first and backgrounds(second) == pair[::-1]
    settings.result = first
    assert backgrounds(first) == pair


def test_other_pictures_in_the_panel_are_not_the_panoramas(settings):
    pair = [settings.reference, settings.target]
    settings.reference, settings.target = other(), None
    assert backgrounds(settings.result) == pair


def test_a_picture_that_was_renamed_is_still_the_panoramas(settings):
    pair = [settings.reference, settings.target]
    pair[0].name = "renamed"
    mine = settings.ignore_target = other("a mask")
    settings.reference = other("reference.png")
    assert bpy.ops.edf.restore() == {"FINISHED"}
    assert [settings.reference, settings.target] == pair and settings.ignore_target is None
    settings.ignore_target = mine
    assert backgrounds(settings.result) == pair


def test_another_picture_of_the_same_name_is_not_taken_for_it(settings):
    lost = settings.reference
    name = lost.name
    bpy.data.images.remove(lost)
    assert other(name).name == name
    with pytest.raises(RuntimeError, match=f"“{name}”, the reference of this panorama, is no longer in the file"):
        bpy.ops.edf.restore()
    with pytest.raises(RuntimeError, match="is no longer in the file"):
        bpy.ops.edf.restitch()
    assert backgrounds(settings.result) == [None, settings.target]
    settings.reference = bpy.data.images[name]
    assert not len(settings.matches), "they belonged to the one that was deleted"


def test_a_mask_comes_back_by_what_it_is_and_not_by_its_name(chosen):
    settings = chosen.settings
    settings.ignore_reference = mask = other("mask")
    bpy.ops.edf.stitch()
    mask.name = "renamed"
    other("mask")
    settings.ignore_reference = None
    bpy.ops.edf.restore()
    assert settings.ignore_reference == mask


def test_the_panorama_keeps_its_pictures_in_the_file(settings, tmp_path):
    """Nothing else in the file uses them."""
    settings.reference = settings.target = None
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    settings = bpy.context.scene.edf_stitch
    assert [image.name for image in ownership.pictures(settings.result)] == ["reference.png", "target.png"]
    assert ownership.changes(settings.result) == []
    assert bpy.ops.edf.restore() == {"FINISHED"} and settings.reference.name == "reference.png"


def test_a_picture_is_the_same_after_packing_and_another_after_painting(settings, capfd):
    assert ownership.changes(settings.result) == []
    settings.reference.pack()
    assert ownership.changes(settings.result) == []
    paint(settings.reference)
    words = "“reference.png”, the reference of this panorama, has changed since"
    assert [one.startswith(words) for one in ownership.changes(settings.result)] == [True]
    bpy.ops.edf.restore()
    bpy.ops.edf.create_cameras()
    assert capfd.readouterr().out.count(words) == 2, "said by both"


def test_what_was_painted_is_the_same_after_packing(chosen):
    paint(chosen.settings.target)
    bpy.ops.edf.stitch()
    chosen.settings.target.pack()
    assert ownership.changes(chosen.settings.result) == []
    paint(chosen.settings.target)
    assert len(ownership.changes(chosen.settings.result)) == 1


def test_another_file_under_the_same_picture_is_a_change(settings, folder):
    settings.reference.filepath = settings.target.filepath
    settings.reference.reload()
    assert len(ownership.changes(settings.result)) == 1


def test_another_content_of_the_same_file_is_a_change(chosen, tmp_path, fingerprint):
    path = tmp_path / "reference.png"
    path.write_bytes(Path(bpy.path.abspath(chosen.settings.reference.filepath)).read_bytes())
    image = bpy.data.images.load(str(path))
    known = fingerprint(image)
    assert not images.has_changed(image, known)
    path.write_bytes(Path(bpy.path.abspath(chosen.settings.target.filepath)).read_bytes())
    assert images.has_changed(image, known)
    path.unlink()
    assert images.has_changed(image, known)


def test_the_list_of_matches_goes_with_its_pictures_and_that_is_said(settings):
    count = len(settings.matches)
    settings.edited_matches = True
    settings.target = settings.target  # noqa: PLW0127 (chosen again in the panel)
    assert len(settings.matches) == count > 50 and settings.edited_matches
    settings.target = other()
    assert not len(settings.matches) and not settings.edited_matches and settings.match_index == -1
    assert f"{count} matches" in status.now.message and "other pictures" in status.now.message
    assert not status.now.failed


def test_choosing_pictures_with_no_list_says_nothing(blender):
    status.end("as it was")
    blender.settings.reference, blender.settings.target = other("a"), other("b")
    assert status.now.message == "as it was"


def test_swapping_turns_the_matches_round_and_keeps_them(settings):
    settings.edited_matches = True
    ends = [(match.x, match.y, match.x2, match.y2) for match in settings.matches]
    bpy.ops.edf.swap()
    assert [(match.x2, match.y2, match.x, match.y) for match in settings.matches] == ends and settings.edited_matches
    settings.target = settings.target  # noqa: PLW0127
    assert len(settings.matches) == len(ends), "they are those of the pictures as they stand now"
    settings.reference = other()
    assert not len(settings.matches)


def test_restoring_brings_the_panoramas_own_matches(settings):
    rows = [(match.x, match.y2) for match in settings.matches]
    settings.reference = other()
    settings.target = other("second")
    bpy.ops.edf.restore()
    assert [(match.x, match.y2) for match in settings.matches] == rows
    settings.target = settings.target  # noqa: PLW0127
    assert len(settings.matches) == len(rows), "they are the restored pictures'"


def test_names_that_choose_other_pictures_take_the_list_away(settings):
    settings.edited_matches = True
    other("blank")
    with pytest.raises(RuntimeError):  # nothing in it to match, and no list that would do instead
        bpy.ops.edf.stitch(reference="reference.png", target="blank")
    assert not len(settings.matches) and not settings.edited_matches


def test_names_that_choose_the_same_pictures_keep_it(settings):
    settings.edited_matches = True
    assert bpy.ops.edf.stitch(reference="reference.png", target="target.png") == {"FINISHED"}
    assert settings.edited_matches and len(settings.matches) > 50


def test_a_stitch_does_not_fill_the_list_of_pictures_that_were_chosen_meanwhile(chosen):
    working = Modal()
    assert working._start(bpy.context)
    settings, pair = chosen.settings, [chosen.settings.reference, chosen.settings.target]
    settings.target = other()
    assert working.until(lambda: False) == {"FINISHED"}
    settings = bpy.context.scene.edf_stitch
    assert settings.result.name == "reference panorama" and not len(settings.matches)
    assert "Restore Settings" in status.now.message
    assert ownership.pictures(settings.result) == pair
    bpy.ops.edf.restore()
    assert settings.target == pair[1] and len(settings.matches) == len(result.read(settings.result)["matches"]["rows"])


def test_undo_brings_the_list_back_with_its_pictures(settings):
    bpy.context.preferences.edit.use_global_undo = True
    count, name = len(settings.matches), settings.target.name
    bpy.ops.ed.undo_push(message="before")
    settings.target = other()
    bpy.ops.ed.undo_push(message="Choose")
    assert not len(settings.matches)
    bpy.ops.ed.undo()
    settings = bpy.context.scene.edf_stitch
    assert settings.target.name == name and len(settings.matches) == count
    assert [image.name for image in ownership.pictures(settings.result)] == ["reference.png", "target.png"]
    settings.target = settings.target  # noqa: PLW0127
    assert len(settings.matches) == count
    bpy.ops.ed.redo()
    assert not len(bpy.context.scene.edf_stitch.matches)


def test_a_camera_that_moved_since_is_told(settings):
    """By place and by lens, of the one that took the picture."""
    camera = bpy.data.objects.new("took it", bpy.data.cameras.new("lens"))
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.view_layer.update()
    known = json.loads(settings.result[result.KEY])
    then = cameras.describe(camera, bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    settings.result[result.KEY] = json.dumps({**known, "cameras": [then, then]})
    ownership.hold(settings.result, [], {"reference_camera": camera})
    said = []
    for x, lens in ((0, 50), (1, 50), (0, 50), (0, 51)):
        camera.location.x, camera.data.lens = x, lens
        bpy.context.view_layer.update()
        said.append(ownership.camera_changes(settings.result, bpy.context))
    assert [len(one) for one in said] == [0, 1, 0, 1] and "“took it”, the reference camera" in said[1][0]


@pytest.fixture
def pointed(settings):
    """Moves the pointer over what an Image Editor shows; returns what it is over, for each such editor."""

    def over(image) -> tuple:
        view2d = SimpleNamespace(region_to_view=lambda x, y: (0.5, 0.5))
        region = SimpleNamespace(type="WINDOW", view2d=view2d)
        context = SimpleNamespace(scene=bpy.context.scene, space_data=SimpleNamespace(image=image), region=region)
        drawing.follow(context, (1, 1))
        return drawing._pointer["panorama"], drawing._pointer["side"]

    return over


def test_the_pointer_is_in_the_panoramas_own_pictures(settings, pointed):
    """Its lines come from the panorama's geometry, whatever is chosen in the panel."""
    reference, target, panorama = settings.reference, settings.target, settings.result
    settings.reference, settings.target = target, other()
    assert pointed(reference) == (panorama.session_uid, "reference")
    assert pointed(target) == (panorama.session_uid, "target"), "though the panel has it as its reference"
    assert pointed(panorama) == (panorama.session_uid, "panorama")
    assert pointed(settings.target)[1] is None
    settings.ignore_reference = other("mask")
    assert pointed(settings.ignore_reference) == (panorama.session_uid, "target"), "as the picture that it lies over"


def test_matches_are_drawn_on_no_panorama_of_other_pictures(settings):
    known, panorama = drawing.match_arrays(settings), settings.result
    assert len(drawing.points_on(settings, known, "panorama", panorama)) == len(settings.matches)
    settings.target = other()
    match_editing.add(settings, (1, 2), (3, 4))
    assert drawing.points_on(settings, drawing.match_arrays(settings), "panorama", panorama) is None
    np.testing.assert_array_equal(drawing.points_on(settings, drawing.match_arrays(settings), "target", None), [[3, 4]])
