"""Where Blender 4.2 to 5.2 differ, and the names that an OCIO configuration may lack: one place for all of it."""

from __future__ import annotations

import bpy

# Blender's names of colour spaces, since 4.0.
LINEAR, DISPLAY, DATA = "Linear Rec.709", "sRGB", "Non-Color"


def set_colour_space(image: bpy.types.Image, name: str) -> None:
    """Interpret an image's values so; a studio's own OCIO configuration may lack the name, and its default stays."""
    try:
        image.colorspace_settings.name = name
    except TypeError:
        pass


def scene_by_uid(uid: int) -> bpy.types.Scene | None:
    """The scene of a `session_uid`, which survives undo and renaming (a reference to the scene does not)."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == uid), None)
