"""The list of pictures: a row each, with what the last stitch did with it."""

from __future__ import annotations

from typing import Any

import bpy

from .. import idnames, pictures
from ..idnames import Operator
from ..operators import picture_list
from .rows import NOTE, WARNING, words

# Icons of what the last stitch did.
STATES = {"NEW": "IMAGE_DATA", "USED": "CHECKMARK", "LEFT_OUT": "ERROR"}
ROWS = 5


class EDF_UL_pictures(bpy.types.UIList):  # noqa: N801
    """The pictures; of more than two, the camera marks whose place is the viewpoint."""

    bl_idname = idnames.List.PICTURES

    def draw_item(
        self, _context: Any, layout: Any, data: Any, item: Any, _icon: int, _active: Any, _name: str, index: int = 0,
        _flag: int = 0,
    ) -> None:
        layout.use_property_split = False
        row = layout.row(align=True)
        row.prop(item, "use", text="", icon="HIDE_OFF" if item.use else "HIDE_ON", emboss=False)
        named = row.row(align=True)
        named.active = item.use
        lost = item.image is None
        if lost:
            named.label(text="No longer in the file")
        else:  # Blender makes the thumbnail beside the name aside, when the row is seen first
            named.label(text=item.image.name, icon_value=layout.icon(item.image))
        if role := role_of(data, index):
            side = row.row()
            side.alignment = "RIGHT"
            side.label(text=role)
        icon = "ERROR" if lost else STATES[item.state]
        row.operator(Operator.PICTURE_STATE, text="", icon=icon, emboss=False).row = index
        if pictures.is_set(data):
            is_viewpoint = item.image is not None and item.image == data.seen_from
            icon = "OUTLINER_OB_CAMERA" if is_viewpoint else "CAMERA_DATA"
            row.operator(Operator.SEE_FROM, text="", icon=icon, emboss=is_viewpoint).row = index


class EDF_MT_pictures(bpy.types.Menu):  # noqa: N801
    """What can be done to the list of pictures"""

    bl_idname = idnames.Menu.PICTURES
    bl_label = "Pictures"

    def draw(self, _context: Any) -> None:
        layout = self.layout
        for which, name, _ in picture_list.WHICH:
            layout.operator(Operator.ADD_IMAGES, text=f"Add {name}").which = which
        layout.separator()
        layout.operator(Operator.OPEN_PAIR, icon="FILE_FOLDER")
        layout.operator(Operator.CLEAR_PICTURES, icon="X")


def draw_list(layout: Any, settings: Any, width: float) -> None:
    """The list, and the buttons that fill it."""
    layout.use_property_split = False
    row = layout.row()
    row.template_list(idnames.List.PICTURES, "", settings, "pictures", settings, "picture_index", rows=ROWS)
    side = row.column(align=True)
    side.operator(Operator.ADD_PICTURES, text="", icon="ADD")
    side.operator(Operator.REMOVE_PICTURE, text="", icon="REMOVE")
    side.menu(idnames.Menu.PICTURES, text="", icon="DOWNARROW_HLT")
    side.separator()
    for way, icon in (("UP", "TRIA_UP"), ("DOWN", "TRIA_DOWN")):
        side.operator(Operator.MOVE_PICTURE, text="", icon=icon).way = way
    if 0 <= settings.picture_index < len(settings.pictures):
        entry = settings.pictures[settings.picture_index]
        layout.template_ID(entry, "image", open="image.open")
        if entry.image is not None and entry.image.has_data:
            layout.label(text=f"{entry.image.size[0]} × {entry.image.size[1]}")
        if entry.state == "LEFT_OUT":
            words(layout, picture_list.said_of(entry), width, WARNING)
    buttons = layout.row(align=True)
    buttons.operator(Operator.ADD_PICTURES, icon="FILE_IMAGE")
    buttons.operator(Operator.ADD_FOLDER, icon="FILE_FOLDER")
    if len(pictures.used(settings)) == 2:
        layout.operator(Operator.SWAP, icon="ARROW_LEFTRIGHT")
    elif pictures.is_set(settings) and pictures.viewpoint(settings) is None:
        words(layout, "Seen from the first picture that connects with others; a row's camera chooses", width, NOTE)


def role_of(settings: Any, index: int) -> str:
    """What a row's picture is in a pair; "" in a set, and where it is not used."""
    used = [number for number, entry in enumerate(settings.pictures) if entry.use]
    if len(used) != 2 or index not in used:
        return ""
    return "Target" if used.index(index) else "Reference"
