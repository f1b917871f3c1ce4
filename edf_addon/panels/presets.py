"""Named sets of settings, by Blender's own mechanism: files in the user's presets folder, and those that come with the
extension, in edf_addon/presets."""

import re
from pathlib import Path
from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from .. import earlier, idnames, properties

SUBFOLDER = "edf_stitch"
# What a preset does not hold: pictures, cameras and masks of one file.
_OF_ONE_FILE = {"POINTER", "COLLECTION"}


class _Presets:
    """What Blender looks for at whatever lists presets."""

    @staticmethod
    def post_cb(context: Any, path: str) -> None:
        """A preset that an earlier release wrote was just run: it means what it meant then."""
        settings = properties.settings_of(context.scene)
        held = re.findall(rf"\.{idnames.SETTINGS}\.(\w+)", Path(path).read_text("utf-8"))
        for name, value in earlier.kept_now({name: getattr(settings, name, None) for name in held}).items():
            if name in earlier.THEN:
                setattr(settings, name, value)


class EDF_MT_presets(_Presets, bpy.types.Menu):  # noqa: N801
    bl_idname = idnames.Menu.PRESETS
    bl_label = "Stitch Presets"
    preset_subdir = SUBFOLDER
    preset_operator = "script.execute_preset"
    draw = bpy.types.Menu.draw_preset


class EDF_PT_presets(_Presets, PresetPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.PRESETS
    bl_label = "Stitch Presets"
    preset_subdir = SUBFOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = idnames.Operator.PRESET_ADD


class EDF_OT_preset_add(AddPresetBase, bpy.types.Operator):  # noqa: N801
    """Keep the settings under a name, or forget those of that name"""

    bl_idname = idnames.Operator.PRESET_ADD
    bl_label = "Add Stitch Preset"
    preset_menu = idnames.Menu.PRESETS
    preset_subdir = SUBFOLDER
    preset_defines: list[str] = []  # 4.x, where it runs on Python 3.13, does not find what is defined here

    @property
    def preset_values(self) -> list[str]:
        return [f"bpy.context.scene.{idnames.SETTINGS}.{name}" for name in names()]


def names() -> list[str]:
    """The properties that a preset holds."""
    group: Any = properties.EDF_PG_settings
    kinds = {one.identifier: one.type for one in group.bl_rna.properties}
    return [
        name for name in properties.names_of_settings(group)
        if kinds[name] not in _OF_ONE_FILE and name != "edited_matches"
    ]  # fmt: skip


CLASSES = (EDF_MT_presets, EDF_PT_presets, EDF_OT_preset_add)


_register, _unregister = bpy.utils.register_classes_factory(CLASSES)
# The folder whose `presets` Blender looks through.
_OURS = str(Path(__file__).resolve().parent.parent)


def register() -> None:
    """Make the presets known, ours and the menus that list them."""
    bpy.utils.register_preset_path(_OURS)
    _register()


def unregister() -> None:
    """Take them away again."""
    _unregister()
    bpy.utils.unregister_preset_path(_OURS)
