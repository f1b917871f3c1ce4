"""Presets: settings under a name, and back; by the files that Blender's own mechanism writes."""

from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon import engine_options  # noqa: E402
from edf_stitch.edf_addon.panels import presets  # noqa: E402

OLD = {"field": "STRICT", "fade": "PLANE", "projection": "PERSPECTIVE", "crop": "INSCRIBED", "holes": "TRANSPARENT",
       "exposure": False, "scale": 0.5}  # fmt: skip


@pytest.fixture
def resources(tmp_path, monkeypatch):
    """A presets folder of its own."""
    original = bpy.utils.user_resource
    monkeypatch.setattr(
        bpy.utils, "user_resource",
        lambda kind, path="", create=False: (
            _made(tmp_path / path) if kind == "SCRIPTS" else original(kind, path=path, create=create)
        ),
    )  # fmt: skip
    return tmp_path


def _made(folder):
    folder.mkdir(parents=True, exist_ok=True)
    return str(folder)


def test_a_preset_brings_back_what_it_was_made_of_and_nothing_else(blender, resources):
    settings = blender.settings
    settings.reference = bpy.data.images.new("a", 8, 8)
    settings.field, settings.camera, settings.focal, settings.crop = "STRICT", "FOCAL", 35.5, "BOX"
    settings.crop_box, settings.take_depth = (1, 2, 30, 40), True
    bpy.ops.edf.preset_add(name="Plates")
    files = list(resources.rglob("*.py"))
    assert [file.name for file in files] == ["Plates.py"]
    bpy.ops.edf.reset()
    settings.show_matches = True
    settings.reference = bpy.data.images.new("b", 8, 8)
    bpy.ops.script.execute_preset(filepath=str(files[0]), menu_idname="EDF_MT_presets")
    assert (settings.field, settings.camera, settings.crop) == ("STRICT", "FOCAL", "BOX")
    assert settings.focal == pytest.approx(35.5) and tuple(settings.crop_box) == (1, 2, 30, 40) and settings.take_depth
    assert settings.reference.name == "b" and settings.show_matches


def test_a_preset_of_an_earlier_release_means_what_it_meant_then(blender, resources):
    settings, file = blender.settings, resources / "old.py"
    lines = ("import bpy", *(f"bpy.context.scene.edf_stitch.{name} = {value!r}" for name, value in OLD.items()))
    file.write_text("\n".join(lines), "utf-8")
    bpy.ops.script.execute_preset(filepath=str(file), menu_idname="EDF_PT_presets")
    assert (settings.projection, settings.fade, settings.crop) == ("REFERENCE", "PLANE", "INSCRIBED")
    assert (settings.slide_auto, settings.holes, settings.light) == (False, "TRANSPARENT", "NONE")
    assert settings.scale == 0.5, "what stands behind the exposure is read, too"
    settings.projection = "PERSPECTIVE"
    bpy.ops.edf.preset_add(name="New")
    settings.projection = "AUTO"
    (new,) = resources.rglob("New.py")
    bpy.ops.script.execute_preset(filepath=str(new), menu_idname="EDF_PT_presets")
    assert settings.projection == "PERSPECTIVE"


def test_a_preset_holds_every_setting_and_no_picture():
    held = set(presets.names())
    assert {*engine_options.CHOICES, *engine_options.VALUES, "camera", "crop", "focal", "take_layers", "pack"} <= held
    assert not held & {"reference", "target", "result", "matches", "ignore_reference", "reference_camera",
                       "edited_matches"}  # fmt: skip


OURS = {
    "Photo_Pair": ("AUTO", "AUTO", "AUTO", True), "Handheld_Panorama": ("AUTO", "INSCRIBED", "INPAINT", True),
    "HDRI": ("EQUIRECTANGULAR", "FULL", "INPAINT", False),
    "Matte_Painting_Plate": ("REFERENCE", "FULL", "TRANSPARENT", False),
}  # fmt: skip


def test_blenders_own_mechanism_finds_the_presets_that_come_along(blender):
    found = [path for folder in bpy.utils.preset_paths(presets.SUBFOLDER) for path in Path(folder).glob("*.py")]
    assert {path.stem for path in found} >= set(OURS)
    shown = [bpy.path.display_name(name, title_case=False) for name in OURS]  # as Blender's menus of presets do
    assert shown == ["Photo Pair", "Handheld Panorama", "HDRI", "Matte Painting Plate"]


@pytest.mark.parametrize("name", OURS)
def test_each_sets_the_same_whatever_was_set_before(blender, name):
    """One after another leaves nothing of the other: all set the same properties."""
    settings = blender.settings
    (path,) = [path for folder in bpy.utils.preset_paths(presets.SUBFOLDER) for path in Path(folder).glob(f"{name}.py")]
    for other in (None, *OURS):
        if other is not None:
            bpy.ops.script.execute_preset(filepath=str(path.with_stem(other)), menu_idname="EDF_PT_presets")
        bpy.ops.script.execute_preset(filepath=str(path), menu_idname="EDF_PT_presets")
        assert (settings.projection, settings.crop, settings.holes, settings.slide_auto) == OURS[name]
        assert settings.take_layers == (name == "Matte_Painting_Plate")
        assert settings.light == ("REFERENCE" if name == "Matte_Painting_Plate" else "AUTO")
