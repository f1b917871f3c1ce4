"""What is painted: masks of the pictures, the seam of a pair, and places that come from a certain picture."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy

from .. import editor, idnames, pictures
from ..idnames import Operator
from ..operators import mask_painting, picture_masks, taking
from .rows import NOTE, SubPanel, words


class EDF_UL_places(bpy.types.UIList):  # noqa: N801
    """The places, by the pictures that they come from."""

    bl_idname = idnames.List.PLACES

    def draw_item(
        self, _context: Any, layout: Any, _data: Any, item: Any, _icon: int, _active: Any, _name: str, index: int = 0,
        _flag: int = 0,
    ) -> None:
        row = layout.row(align=True)
        row.active = item.use
        row.prop(item, "use", text="")
        row.label(text="No longer in the file" if item.picture is None else f"From {item.picture.name}")


class EDF_PT_masks(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MASKS
    bl_label = "Masks"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        self.layout.use_property_split = False
        (_of_row if pictures.is_set(settings) else _of_pair)(self.layout, context, settings, width)
        self.layout.label(text="Places From One Picture")
        row = self.layout.row()
        row.template_list(idnames.List.PLACES, "", settings, "places", settings, "place_index", rows=2)
        side = row.column(align=True)
        side.operator(Operator.TAKE_FROM, text="", icon="ADD")
        side.operator(Operator.PLACE_REMOVE, text="", icon="REMOVE")
        if reason := taking.why_not(context):
            words(self.layout, reason, width, NOTE)
        else:
            self.layout.operator(Operator.TAKE_FROM, icon="BRUSH_DATA")
        if said := _painted(context, settings):
            words(self.layout, said, width, NOTE)
            self.layout.operator(Operator.MASK_DONE, icon="CHECKMARK")


def _of_row(layout: Any, _context: Any, settings: Any, width: float) -> None:
    """The masks of the active picture of the list."""
    if not 0 <= settings.picture_index < len(settings.pictures):
        return
    entry = settings.pictures[settings.picture_index]
    for kind, label, _ in picture_masks.KINDS:
        layout.label(text=f"{label}: {entry.image.name}" if entry.image else label)
        row = layout.row(align=True)
        row.template_ID(entry, kind, open="image.open")
        row.operator(Operator.PICTURE_MASK, text="", icon="BRUSH_DATA").kind = kind
        if getattr(entry, kind) is not None:
            row.operator(Operator.PICTURE_MASK_REMOVE, text="", icon="X").kind = kind


def _of_pair(layout: Any, context: Any, settings: Any, width: float) -> None:
    """What is ignored in either picture, and the painted seam."""
    for side, label, _ in mask_painting.SIDES[:2]:
        layout.label(text=f"Ignore in {label}")
        row = layout.row(align=True)
        row.template_ID(settings, mask_painting.MASKS[side], open="image.open")
        row.operator(Operator.MASK_PAINT, text="", icon="BRUSH_DATA").side = side
    layout.label(text="Painted Seam")
    layout.template_ID(settings, "seam_mask", open="image.open")
    reason = mask_painting.why_not(context, "seam")
    row = layout.row(align=True)
    row.enabled = not reason
    for text, black in (("From Reference", True), ("From Target", False)):
        button = row.operator(Operator.MASK_PAINT, text=text)
        button.side, button.black = "seam", black
    if reason:
        words(layout, reason, width, NOTE)


def _painted(context: Any, settings: Any) -> str:
    """What the mask that the editor shows does; "" where it shows none."""
    if painted := mask_painting.painted_for(context):
        return (
            "Orange comes from the target, dark from the reference" if painted == "seam"
            else f"White is kept out of the {painted}; it is shown in red"
        )  # fmt: skip
    found = pictures.mask_of(settings, editor.shown(context))
    if found is None:
        return ""
    return "White is never used; it is shown in red" if found[1] == "ignore" else "White comes from this picture"
