"""The list of pictures: who is who in it, and what becomes of it."""

from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
pictures = pytest.importorskip("edf_stitch.edf_addon.pictures")
from edf_stitch.edf_addon import earlier, editor, properties  # noqa: E402
from edf_stitch.edf_addon.bridge import compat, ownership, result  # noqa: E402


def new(*names: str) -> list:
    return [bpy.data.images.new(name, 8, 8) for name in names]


def listed(settings) -> list:
    return [entry.image and entry.image.name for entry in settings.pictures]


def test_of_the_pictures_that_are_used_the_first_is_the_reference_and_the_second_the_target(blender):
    settings = blender.settings
    assert settings.reference is None and settings.target is None
    a, b, c = new("a", "b", "c")
    assert pictures.add(settings, [a, b, a, c]) == 3 and listed(settings) == ["a", "b", "c"]
    assert pictures.is_set(settings) and (settings.reference, settings.target) == (a, b)
    settings.pictures[0].use = False
    assert not pictures.is_set(settings) and (settings.reference, settings.target) == (b, c)
    settings.target = a
    assert listed(settings) == ["a", "b", "a"] and settings.reference == b, "in its place, and nothing else moves"


def test_a_side_makes_its_row_where_there_is_none(blender):
    (b,) = new("b")
    blender.settings.target = b
    assert listed(blender.settings) == [None, "b"] and blender.settings.reference is None


def test_rows_are_moved_removed_and_cleared(blender):
    settings = blender.settings
    pictures.add(settings, new("a", "b", "c"))
    settings.picture_index = 2
    assert bpy.ops.edf.move_picture(way="UP") == {"FINISHED"}
    assert (listed(settings), settings.picture_index) == (["a", "c", "b"], 1)
    bpy.ops.edf.remove_picture()
    assert listed(settings) == ["a", "b"] and "c" in bpy.data.images
    settings.picture_index = 0
    assert bpy.ops.edf.move_picture(way="UP") == {"CANCELLED"}, "it is the first already"
    bpy.ops.edf.clear_pictures()
    assert listed(settings) == [] and not bpy.ops.edf.remove_picture.poll()


def test_files_a_folder_and_images_of_the_file_are_added(blender, folder: Path, tmp_path: Path):
    settings = blender.settings
    files = [{"name": "target.png"}, {"name": "reference.png"}]
    assert bpy.ops.edf.add_pictures(directory=str(folder), files=files) == {"FINISHED"}
    assert listed(settings) == ["reference.png", "target.png"]
    for number in (10, 9):
        (tmp_path / f"p{number}.png").write_bytes((folder / "target.png").read_bytes())
    (tmp_path / "notes.txt").write_text("no picture")
    assert bpy.ops.edf.add_folder(directory=str(tmp_path)) == {"FINISHED"}
    assert listed(settings)[2:] == ["p9.png", "p10.png"], "as people count"
    assert settings.picture_index == 2, "the first of those that came"
    settings.ignore_reference = new("mask", "painted")[0]
    assert bpy.ops.edf.add_images(which="FILE") == {"FINISHED"} and listed(settings)[4:] == ["painted"]
    assert bpy.ops.edf.add_images(which="FILE") == {"CANCELLED"}, "all are there"
    with pytest.raises(RuntimeError, match="no pictures in this folder"):
        (tmp_path / "empty").mkdir()
        bpy.ops.edf.add_folder(directory=str(tmp_path / "empty"))
    with pytest.raises(RuntimeError, match="No pictures were chosen"):
        bpy.ops.edf.add_pictures(directory=str(folder), files=[])


def test_the_viewpoint_is_a_picture_that_is_used(blender):
    settings = blender.settings
    pictures.add(settings, new("a", "b", "c", "d"))
    assert pictures.viewpoint(settings) is None
    bpy.ops.edf.see_from(row=2)
    assert pictures.viewpoint(settings) == 3
    settings.pictures[0].use = False
    assert pictures.viewpoint(settings) == 2, "counted among those that are used"
    settings.pictures[2].use = False
    assert pictures.viewpoint(settings) is None
    bpy.ops.edf.see_from(row=2)
    assert settings.seen_from is None, "pressed again"


def test_what_became_of_each_picture_by_the_report():
    report = {
        "pictures": [{"name": "a"}, {"name": "m"}], "left_out": [{"name": "x", "why": "it connects with no other"}],
        "brackets": [{"names": ["m", "dark"]}],
    }  # fmt: skip
    told = pictures.fates(["a", "m", "dark", "x", "copy"], report)
    assert [state for state, _ in told] == ["USED", "USED", "USED", "LEFT_OUT", "LEFT_OUT"]
    assert told[3][1] == "it connects with no other" and "same picture" in told[4][1]


def test_what_the_last_stitch_said_of_a_picture_goes_when_it_is_exchanged(blender):
    settings = blender.settings
    pictures.add(settings, new("a", "b", "c"))
    pictures.mark(settings, [("USED", ""), ("LEFT_OUT", "why"), ("USED", "")])
    settings.pictures[1].image = new("d")[0]
    assert [(entry.state, entry.why) for entry in settings.pictures] == [("USED", ""), ("NEW", ""), ("USED", "")]


def test_in_a_set_no_picture_is_a_side_and_what_is_for_pairs_is_refused(blender):
    settings = blender.settings
    images = new("a", "b", "c")
    pictures.add(settings, images[:2])
    assert editor.side_of(settings, images[0]) == editor.REFERENCE
    pictures.add(settings, images)
    assert editor.side_of(settings, images[0]) is None
    assert not bpy.ops.edf.mask_paint.poll()
    with pytest.raises(RuntimeError, match="switch all but two"):
        bpy.ops.edf.match_add(point=(1, 1), target_point=(1, 1))


def test_two_pictures_of_an_earlier_release_are_the_list(blender, monkeypatch):
    """With the matches that belong to them, and what was the default then."""
    settings, then = blender.settings, dict(zip(("reference", "target"), new("a", "b"), strict=True))
    settings.matches_reference, settings.matches_target = then.values()
    settings.matches.add()
    settings.version = 0
    monkeypatch.setattr(compat, "take_kept", lambda _, name: then.pop(name, None))
    properties.bring_up_to_date()
    assert listed(settings) == ["a", "b"] and len(settings.matches) == 1
    assert (settings.version, settings.projection) == (earlier.VERSION, "REFERENCE")
    properties.bring_up_to_date()
    assert listed(settings) == ["a", "b"]


def test_a_panorama_is_behind_where_it_was_seen_from_another_picture(blender):
    settings, panorama, images = blender.settings, *new("panorama"), new("a", "b", "c")
    pictures.add(settings, images)
    result.store(panorama, {"settings": properties.keep(settings), "pictures": [{}] * 3})
    ownership.hold(panorama, images, {})
    assert not editor.is_behind(settings, panorama)
    bpy.ops.edf.see_from(row=1)
    assert editor.is_behind(settings, panorama)
    ownership.hold(panorama, images, {"seen_from": images[1]})
    images[1].name = "renamed"
    assert not editor.is_behind(settings, panorama), "a picture is known by itself"


def test_a_path_from_where_a_script_stands_is_one_for_the_worker_too(blender, folder: Path, monkeypatch):
    monkeypatch.chdir(folder.parent)
    assert bpy.ops.edf.add_pictures(directory=folder.name, files=[{"name": "target.png"}]) == {"FINISHED"}
    assert Path(blender.settings.pictures[0].image.filepath) == folder / "target.png"
