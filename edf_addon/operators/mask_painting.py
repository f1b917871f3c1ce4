"""Masks to paint: what is kept out of a picture, and which picture the panorama comes from."""

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty

from .. import editor, idnames, pictures, properties
from ..bridge import compat
from ..jobs import following

SIDES = (
    ("reference", "Reference", "Paint out parts of the reference"),
    ("target", "Target", "Paint out parts of the target"),
    ("seam", "Seam", "Paint over the panorama from which of the two pictures it comes"),
)
# The property that holds each side's mask.
MASKS = {"reference": "ignore_reference", "target": "ignore_target", "seam": "seam_mask"}


class EDF_OT_mask_paint(bpy.types.Operator):  # noqa: N801
    """Paint a mask. White over a picture: ignored (passers-by, reflections, a tripod). Over the panorama: white comes
    from the target, black from the reference. A mask is made where there is none yet"""

    bl_idname = idnames.Operator.MASK_PAINT
    bl_label = "Paint Out"
    bl_options = {"REGISTER", "UNDO"}

    side: EnumProperty(name="Picture", items=SIDES)
    black: BoolProperty(name="Black", description="Paint black instead of white")

    @classmethod
    def poll(cls, context: Any) -> bool:
        settings = properties.settings_of(context.scene)
        reason = pictures.PAIRS_ONLY if pictures.is_set(settings) else ""
        if settings.reference is None and settings.target is None:
            reason = "Choose a reference and a target first"
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        if reason := why_not(context, self.side):
            self.report({"ERROR"}, reason)
            return {"CANCELLED"}
        mask = getattr(settings, MASKS[self.side])
        if mask is None:
            mask = new_mask(picture_of(context, self.side), see_through=self.side == "seam")
            setattr(settings, MASKS[self.side], mask)
        begin_painting(context, mask, 0.0 if self.black else 1.0)
        return {"FINISHED"}


class EDF_OT_mask_done(bpy.types.Operator):  # noqa: N801
    """Back to the picture, or to the panorama, which follows the masks of its pictures"""

    bl_idname = idnames.Operator.MASK_DONE
    bl_label = "Done Painting"

    @classmethod
    def poll(cls, context: Any) -> bool:
        settings, image = properties.settings_of(context.scene), editor.shown(context)
        return painted_for(context) is not None or pictures.mask_of(settings, image) is not None

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        of_row = pictures.mask_of(settings, context.space_data.image)
        picture = picture_of(context, painted_for(context) or "reference") if of_row is None else of_row[0].image
        if of_row is not None and editor.is_of_chosen(settings, settings.result):
            picture = settings.result  # which follows the mask
        context.space_data.image, context.space_data.ui_mode = picture, "VIEW"
        following.ask(settings)
        return {"FINISHED"}


def painted_for(context: Any) -> str | None:
    """The side whose mask the editor shows."""
    image, settings = getattr(context.space_data, "image", None), properties.settings_of(context.scene)
    if image is None:
        return None
    return next((side for side, name in MASKS.items() if getattr(settings, name) == image), None)


def picture_of(context: Any, side: str) -> bpy.types.Image | None:
    """What a side's mask lies over."""
    return editor.panorama(context) if side == "seam" else getattr(properties.settings_of(context.scene), side)


def why_not(context: Any, side: str) -> str:
    """Why a side's mask cannot be painted; "" where it can."""
    picture = picture_of(context, side)
    if side != "seam":
        return "" if picture is not None else f"There is no {side} to paint out anything of"
    if picture is None:
        return "Stitch once: a seam is painted over the panorama"
    return ""


def new_mask(picture: bpy.types.Image, see_through: bool = False, longest: int = 0) -> bpy.types.Image:
    """An image of a picture's size, kept in the file: black, or transparent. longest: px of its longer side at most."""
    share = min(1.0, longest / max(picture.size)) if longest else 1.0
    width, height = (max(1, round(side * share)) for side in picture.size)
    mask = bpy.data.images.new(f"{picture.name} mask", width, height, alpha=see_through)
    if see_through:
        mask.generated_color = (0.0, 0.0, 0.0, 0.0)
    compat.set_colour_space(mask, compat.DATA)
    mask.use_fake_user = True
    mask.pack()
    return mask


def begin_painting(context: Any, mask: bpy.types.Image, gray: float = 1.0) -> None:
    """The editor shows a mask, and paints in a gray."""
    space = context.space_data
    if space is not None and space.type == "IMAGE_EDITOR":
        space.image, space.ui_mode = mask, "PAINT"
        _set_brush(context, gray)


def _set_brush(context: Any, gray: float) -> None:
    """A first stroke would otherwise have the colour of whatever was painted before."""
    for one in (context.tool_settings.image_paint.brush, compat.unified_paint(context)):
        if one is not None:
            one.color = (gray, gray, gray)


CLASSES = (EDF_OT_mask_paint, EDF_OT_mask_done)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
