"""The panorama, saved."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import editor, idnames, properties
from ..bridge import images


class EDF_OT_save(bpy.types.Operator):  # noqa: N801
    """Save the panorama as a file with its values kept: EXR or Radiance HDR (float), PNG or TIFF"""

    bl_idname = idnames.Operator.SAVE
    bl_label = "Save Panorama"
    bl_options = {"REGISTER"}

    image: StringProperty(name="Image", description="Which; the one that is shown, or was made last, where empty")
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    check_existing: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        return editor.shown(context) is not None or properties.settings_of(context.scene).result is not None

    def invoke(self, context: Any, _event: Any) -> set[str]:
        image = self._image(context)
        self.filepath = bpy.path.clean_name(image.name) + (".exr" if image.is_float else ".png")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, _context: Any) -> bool:
        """The file dialog asks after every change: a name without a kind gets one."""
        if Path(self.filepath).suffix.lower() in images.KINDS or not Path(self.filepath).name:
            return False
        self.filepath = str(Path(self.filepath).with_suffix(".exr"))
        return True

    def execute(self, context: Any) -> set[str]:
        try:
            path = images.place_of(self.filepath)
            images.save(self._image(context), path)
        except images.Unusable as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Saved {path}")
        return {"FINISHED"}

    def _image(self, context: Any) -> bpy.types.Image:
        if self.image:
            return images.named(self.image)
        return editor.panorama(context) or editor.shown(context)


CLASSES = (EDF_OT_save,)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
