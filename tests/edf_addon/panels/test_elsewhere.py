"""Entries in Blender's menus, and files that are dropped."""

from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")
editor = pytest.importorskip("edf_stitch.edf_addon.editor")
elsewhere = pytest.importorskip("edf_stitch.edf_addon.panels.elsewhere")


class Layout:
    """Notes the operators that are drawn; they must exist."""

    def __init__(self) -> None:
        self.drawn: list[tuple[str, SimpleNamespace]] = []

    def separator(self) -> None: ...

    def operator(self, idname: str, **_: str) -> SimpleNamespace:
        room, _, name = idname.partition(".")
        getattr(getattr(bpy.ops, room), name).get_rna_type()
        self.drawn.append((str(idname), SimpleNamespace()))
        return self.drawn[-1][1]


@pytest.mark.parametrize(("entries", "names"), [
    (elsewhere.in_image_menu, ["edf.stitch", "edf.stitch_files", "edf.stitch_environment", "edf.use_as_world"]),
    (elsewhere.in_add_menu, ["edf.stitch_files"]), (elsewhere.in_import_menu, ["edf.stitch_files"] * 2),
])  # fmt: skip
def test_each_menu_has_its_entries(blender, entries, names):
    layout = Layout()
    entries(SimpleNamespace(layout=layout), None)
    assert [name for name, _ in layout.drawn] == names
    if entries is elsewhere.in_add_menu:
        assert layout.drawn[0][1].as_empty, "what is added is in the scene"
    if entries is elsewhere.in_import_menu:
        assert layout.drawn[1][1].as_world, "an environment lights the scene"


def test_blenders_menus_hold_them(blender):
    for name, entries in elsewhere.MENUS:
        assert entries in getattr(bpy.types, name)._dyn_ui_initialize()


def test_pictures_can_be_dropped_on_an_image_editor_only(blender):
    handler = elsewhere.EDF_FH_pictures
    assert handler.is_registered and handler.bl_import_operator == "edf.add_pictures"
    assert {".jpg", ".exr", ".heic", ".dng"} <= set(handler.bl_file_extensions.split(";"))
    for kind, taken in (("IMAGE_EDITOR", True), ("VIEW_3D", False)):
        assert handler.poll_drop(SimpleNamespace(area=SimpleNamespace(type=kind))) == taken


def test_one_file_alone_is_no_panorama(blender, folder):
    with pytest.raises(RuntimeError, match="two pictures or more"):
        bpy.ops.edf.stitch_files(directory=str(folder), files=[{"name": "target.png"}])


def test_files_become_a_panorama_that_an_empty_shows(blender, folder):
    blender.settings.dense = False
    files = [{"name": "target.png"}, {"name": "reference.png"}]
    assert bpy.ops.edf.stitch_files(directory=str(folder), files=files, as_empty=True) == {"FINISHED"}
    (empty,) = bpy.context.selected_objects
    assert empty.data == blender.settings.result and empty.empty_display_type == "IMAGE"


def test_files_become_an_environment_that_lights_the_scene(blender, folder):
    blender.settings.dense = False
    files = [{"name": "target.png"}, {"name": "reference.png"}]
    assert bpy.ops.edf.stitch_files(directory=str(folder), files=files, as_world=True) == {"FINISHED"}
    assert blender.settings.result.size[0] == 2 * blender.settings.result.size[1], "a whole sphere"
    assert blender.scene.world.name == blender.settings.result.name
    assert not editor.is_behind(blender.settings, blender.settings.result), "no small flat panorama takes its place"
