"""Masks to paint: what is white in them is kept out of a picture."""

from typing import Any

import bpy
from bpy.props import EnumProperty

from . import compat, idnames, properties

SIDES = (
    ("reference", "Reference", "Paint out parts of the reference"),
    ("target", "Target", "Paint out parts of the target"),
)


class EDF_OT_mask_paint(bpy.types.Operator):  # noqa: N801
    """Paint over what is to be ignored (passers-by, reflections, a tripod): white is kept out of everything. A mask is
    made where there is none yet"""

    bl_idname = idnames.Operator.MASK_PAINT
    bl_label = "Paint Out"
    bl_options = {"REGISTER", "UNDO"}

    side: EnumProperty(name="Picture", items=SIDES)

    @classmethod
    def poll(cls, context: Any) -> bool:
        settings = properties.settings_of(context.scene)
        if settings.reference is None and settings.target is None:
            cls.poll_message_set("Choose a reference and a target first")
            return False
        return True

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        picture = getattr(settings, self.side)
        if picture is None:
            self.report({"ERROR"}, f"There is no {self.side} to paint out anything of")
            return {"CANCELLED"}
        mask = getattr(settings, f"ignore_{self.side}")
        if mask is None:
            mask = new_mask(picture)
            setattr(settings, f"ignore_{self.side}", mask)
        space = context.space_data
        if space is not None and space.type == "IMAGE_EDITOR":
            space.image, space.ui_mode = mask, "PAINT"
            _white_brush(context)
        return {"FINISHED"}


class EDF_OT_mask_done(bpy.types.Operator):  # noqa: N801
    """Back to the picture"""

    bl_idname = idnames.Operator.MASK_DONE
    bl_label = "Done Painting"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return painted_for(context) is not None

    def execute(self, context: Any) -> set[str]:
        side = painted_for(context) or SIDES[0][0]
        settings = properties.settings_of(context.scene)
        context.space_data.image, context.space_data.ui_mode = getattr(settings, side), "VIEW"
        return {"FINISHED"}


def painted_for(context: Any) -> str | None:
    """The side whose mask the editor shows."""
    image, settings = getattr(context.space_data, "image", None), properties.settings_of(context.scene)
    if image is None:
        return None
    return next((side for side, *_ in SIDES if getattr(settings, f"ignore_{side}") == image), None)


def new_mask(picture: bpy.types.Image) -> bpy.types.Image:
    """A black image of a picture's size, kept in the file."""
    width, height = picture.size
    mask = bpy.data.images.new(f"{picture.name} mask", width, height, alpha=False)
    compat.set_colour_space(mask, compat.DATA)
    mask.use_fake_user = True
    mask.pack()
    return mask


def _white_brush(context: Any) -> None:
    """Black on black is what a first stroke would be with a brush that painted something else before."""
    for one in (context.tool_settings.image_paint.brush, compat.unified_paint(context)):
        if one is not None:
            one.color = (1.0, 1.0, 1.0)


CLASSES = (EDF_OT_mask_paint, EDF_OT_mask_done)


def register() -> None:
    """Make the operators known."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Take them away again."""
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
