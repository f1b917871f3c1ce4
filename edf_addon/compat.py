"""Where Blender 4.2 to 5.2 differ, and the names that an OCIO configuration may lack: one place for all of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

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


@contextmanager
def written_as(scene: bpy.types.Scene, file_format: str, bits: int) -> Iterator[bpy.types.Scene]:
    """The scene, as long as it lasts, with this format and depth for `Image.save_render`."""
    settings = scene.render.image_settings
    # in this order: what a format offers depends on what stands before. 5.0 has media_type (movies, multilayer files).
    wanted = {"media_type": "IMAGE", "file_format": file_format, "color_mode": "RGBA", "color_depth": str(bits)}
    names = [name for name in wanted if hasattr(settings, name)]
    before = [getattr(settings, name) for name in names]
    try:
        for name in names:
            setattr(settings, name, wanted[name])
        yield scene
    finally:
        for name, value in zip(names, before, strict=True):
            setattr(settings, name, value)


@contextmanager
def saving_scene(file_format: str, bits: int) -> Iterator[bpy.types.Scene]:
    """A scene for `Image.save_render` that keeps an image's values: no view transform."""
    scene = bpy.data.scenes.new("EDF Stitch saving")
    try:
        scene.view_settings.view_transform = "Standard"
        with written_as(scene, file_format, bits):
            yield scene
    finally:
        bpy.data.scenes.remove(scene)
