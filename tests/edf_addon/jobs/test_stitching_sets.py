"""From a list of more than two pictures to a panorama in the file, through the operators and a real worker."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import status  # noqa: E402
from edf_stitch.edf_addon.bridge import ownership, result  # noqa: E402
from edf_stitch.edf_addon.jobs import modal  # noqa: E402
from edf_stitch.edf_addon.operators import stitch  # noqa: E402
from edf_stitch.edf_addon.scene import take_along  # noqa: E402

USED = ["1.png", "2.png", "3.png"]


def test_a_list_becomes_a_panorama_that_is_kept_and_stitched_again(listed, tmp_path, pixels_of):
    settings = listed.settings
    bpy.ops.edf.see_from(row=1)
    settings.pictures[3].use = True
    settings.take_masks = True
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    panorama, found = settings.result, result.read(settings.result)
    assert [entry.state for entry in settings.pictures] == ["USED"] * 3 + ["LEFT_OUT"] and settings.pictures[3].why
    assert [one["name"] for one in found["report"]["pictures"]][0] == "2.png", "the viewpoint"
    assert "left out: 4.png" in status.now.message and panorama.size[0] > 400
    assert {"labels", "1.png mask"} <= set(result.companions(panorama))
    first = pixels_of(panorama).copy()
    path = str(tmp_path / "kept.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    settings = bpy.context.scene.edf_stitch
    assert np.array_equal(pixels_of(settings.result), first)
    assert bpy.ops.edf.depth_mesh() == {"FINISHED"} and bpy.context.object.name.startswith("Depth of ")
    assert 50_000 < len(bpy.context.object.data.polygons) <= 200_000, "from the nodes that the file keeps"
    assert [entry.state for entry in settings.pictures] == ["USED"] * 3 + ["LEFT_OUT"]
    bpy.ops.edf.clear_pictures()
    bpy.ops.edf.reset()
    assert bpy.ops.edf.restitch() == {"FINISHED"}
    assert settings.seen_from.name == "2.png" and not settings.dense and len(settings.pictures) == 4
    assert np.array_equal(pixels_of(settings.result), first)


def test_cameras_and_mesh_of_a_set_stand_where_its_pictures_were_taken(listed):
    assert bpy.ops.edf.stitch() == {"FINISHED"}
    scene, panorama = listed.scene, listed.settings.result
    before = (scene.camera, scene.render.resolution_x, scene.frame_end)
    assert bpy.ops.edf.create_cameras(baseline=2.0) == {"FINISHED"}
    cameras = [take_along.find(panorama, f"Picture {name}") for name in USED]
    assert [one.data.background_images[0].image.name for one in cameras] == USED
    assert (scene.camera, scene.render.resolution_x, scene.frame_end) == before
    made = {one for one in bpy.data.objects if one.type == "CAMERA"}
    assert set(bpy.context.selected_objects) == made == set(scene.collection.children[0].objects) - {cameras[0].parent}
    places = [one.matrix_basis.translation for one in cameras]
    assert (places[2] - places[0]).length == pytest.approx(2.0) and places[0].length == 0
    assert 0.8 < (places[1] - places[0]).length < 1.2, "evenly in a row"
    assert bpy.ops.edf.depth_mesh(baseline=2.0) == {"FINISHED"}
    mesh = take_along.find(panorama, "MESH").data
    depths = [vertex.co.length for vertex in mesh.vertices]
    assert len(mesh.polygons) > 100 and 2.0 < np.median(depths) < 60.0


def test_an_environment_surrounds_the_scene_and_one_undo_brings_all_back(listed, pixels_of):
    before = listed.scene.world = bpy.data.worlds.new("mine")
    assert bpy.ops.edf.stitch_environment(holes="INPAINT", replace=True) == {"FINISHED"}
    assert status.now.message.endswith("shows it: look at it in Rendered shading.")
    panorama, world = listed.settings.result, listed.scene.world
    assert (pixels_of(panorama)[..., 3] == 1).all(), "filled above and below"
    assert panorama.size[0] == 2 * panorama.size[1] and world[take_along.OF] == panorama
    settings = listed.settings
    assert before.use_fake_user
    assert (settings.projection, settings.holes) == ("EQUIRECTANGULAR", "INPAINT"), "what follows is the sphere, too"
    told = result.read(panorama)["settings"]
    assert (told["projection"], told["crop"], told["holes"]) == ("EQUIRECTANGULAR", "FULL", "INPAINT")
    listed.scene.world = before
    bpy.ops.edf.use_as_world(replace=False)
    assert listed.scene.world == before and [one for one in bpy.data.worlds if one.get(take_along.OF)] == [world]


def test_undo_takes_a_panorama_of_a_set_back(listed):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.edf.stitch()
    bpy.ops.ed.undo_push(message="Stitch")
    bpy.ops.ed.undo()
    settings = bpy.context.scene.edf_stitch
    assert settings.result is None and [entry.state for entry in settings.pictures] == ["NEW"] * 4


def test_a_picture_that_is_deleted_while_a_set_is_stitched(listed):
    class Modal(stitch._Stitching):
        def report(self, _kind: set[str], _words: str) -> None: ...

    working = Modal()
    assert working._start(bpy.context)
    bpy.data.images.remove(bpy.data.images["2.png"])
    event = SimpleNamespace(type="TIMER", value="NOTHING")
    while working.modal(bpy.context, event) == {"PASS_THROUGH"}:
        time.sleep(0.02)
    assert not modal.is_working() and "Other pictures are chosen" in status.now.message
    (words,) = ownership.missing(listed.settings.result)
    assert words == "“2.png”, picture 2 of this panorama, is no longer in the file"
    with pytest.raises(RuntimeError, match="remove its row"):
        bpy.ops.edf.stitch()


@pytest.mark.parametrize(("change", "words"), [
    (lambda settings: setattr(settings, "camera", "CAMERAS"), "Scene Cameras are for two"),
    (lambda settings: setattr(settings, "field", "APAP"), "choose Slack or Strict"),
    (lambda settings: setattr(settings, "fade", "INFINITY"), "choose another Outside"),
])  # fmt: skip
def test_what_is_for_pairs_only_is_refused_in_words(listed, change, words):
    change(listed.settings)
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.edf.stitch()
