"""Masks of the pictures of the list: what is never used of one, and what is to be shown of it."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import EnumProperty, IntProperty

from .. import idnames, pictures, properties
from ..jobs import following
from . import mask_painting

# Identifiers are those of `pictures.MASKS`.
KINDS = (
    ("ignore", "Never Use", "What is white is kept out of the panorama: passers-by, reflections, a tripod"),
    ("show", "Use Here", "What is white comes from this picture, wherever it shows it"),
)
# Longest side of a new mask, px: finer than a hand paints, and read in a moment when work begins.
LONGEST = 2048


class _OfARow:
    """Operators on the mask of a row. row: its number; -1 is the active one."""

    @classmethod
    def poll(cls, context: Any) -> bool:
        has_rows = any(entry.image is not None for entry in properties.settings_of(context.scene).pictures)
        if not has_rows:
            cls.poll_message_set("Add pictures to the list first")  # type: ignore[attr-defined]
        return has_rows

    def entry(self, context: Any) -> Any:
        """The row; None where there is none, or its picture is gone."""
        settings = properties.settings_of(context.scene)
        number = settings.picture_index if self.row < 0 else self.row  # type: ignore[attr-defined]
        entry = settings.pictures[number] if number < len(settings.pictures) else None
        return None if entry is None or entry.image is None or not all(entry.image.size) else entry


_ROW = {"name": "Row", "description": "Of the list, from 0; -1: the active one", "default": -1, "min": -1}


class EDF_OT_picture_mask(_OfARow, bpy.types.Operator):  # noqa: N801
    """Paint a mask of this picture of the list, in white. It is used when the panorama is composed next; a mask is made
    where there is none yet"""

    bl_idname = idnames.Operator.PICTURE_MASK
    bl_label = "Paint Picture Mask"
    bl_options = {"REGISTER", "UNDO"}

    row: IntProperty(**_ROW)
    kind: EnumProperty(name="Kind", items=KINDS)

    def execute(self, context: Any) -> set[str]:
        entry = self.entry(context)
        if entry is None:
            self.report({"ERROR"}, "This row has no picture to paint a mask of: choose another row of the list")
            return {"CANCELLED"}
        mask = getattr(entry, self.kind)
        if mask is None:
            mask = mask_painting.new_mask(entry.image, longest=LONGEST)
            mask.name = f"{entry.image.name} {bpy.types.UILayout.enum_item_name(self, 'kind', self.kind)}"
            setattr(entry, self.kind, mask)
        mask_painting.begin_painting(context, mask)
        return {"FINISHED"}


class EDF_OT_picture_mask_remove(_OfARow, bpy.types.Operator):  # noqa: N801
    """Use this mask no longer; its image stays in the file"""

    bl_idname = idnames.Operator.PICTURE_MASK_REMOVE
    bl_label = "Remove Picture Mask"
    bl_options = {"REGISTER", "UNDO"}

    row: IntProperty(**_ROW)
    kind: EnumProperty(name="Kind", items=KINDS)

    def execute(self, context: Any) -> set[str]:
        entry = self.entry(context)
        if entry is None or getattr(entry, self.kind) is None:
            return {"CANCELLED"}
        setattr(entry, self.kind, None)
        following.ask(properties.settings_of(context.scene))
        return {"FINISHED"}


assert tuple(kind for kind, *_ in KINDS) == pictures.MASKS
CLASSES = (EDF_OT_picture_mask, EDF_OT_picture_mask_remove)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
