"""What an artist can do. Operators are thin: settings → job → worker → image."""

from typing import Any

import bpy

from . import idnames, properties


class EDF_OT_swap(bpy.types.Operator):  # noqa: N801
    """Make the target the reference and the reference the target, with their cameras, lenses and masks"""

    bl_idname = idnames.Operator.SWAP
    bl_label = "Swap Pictures"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        for one, other in (*properties.PICTURES, *(properties.LENSES if settings.own_lens else ())):
            mine, theirs = getattr(settings, one), getattr(settings, other)
            setattr(settings, one, theirs)
            setattr(settings, other, mine)
        for match in settings.matches:
            match.x, match.y, match.x2, match.y2 = match.x2, match.y2, match.x, match.y
            match.error = -1.0
        return {"FINISHED"}


class EDF_OT_reset(bpy.types.Operator):  # noqa: N801
    """Set everything back to its default; the pictures and the panorama stay"""

    bl_idname = idnames.Operator.RESET
    bl_label = "Reset Settings"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        for name in settings.bl_rna.properties.keys():
            if name not in properties.NO_SETTINGS and name != "rna_type":
                settings.property_unset(name)
        return {"FINISHED"}


CLASSES = (EDF_OT_swap, EDF_OT_reset)


def register() -> None:
    """Make the operators known."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away again."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
