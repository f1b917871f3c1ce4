"""The guides that level holds to."""

from __future__ import annotations

from typing import Any

import bpy

from .. import idnames, offered
from ..idnames import Operator

ICONS = {"VERTICAL": "EMPTY_SINGLE_ARROW", "HORIZONTAL": "REMOVE"}


class EDF_UL_guides(bpy.types.UIList):  # noqa: N801
    """The guides, by their pictures."""

    bl_idname = idnames.List.GUIDES

    def draw_item(
        self, _context: Any, layout: Any, _data: Any, item: Any, _icon: int, _active: Any, _name: str, index: int = 0,
        _flag: int = 0,
    ) -> None:
        row = layout.row(align=True)
        row.active = item.use
        row.prop(item, "use", text="")
        name = "No longer in the file" if item.picture is None else item.picture.name
        row.label(text=f"{item.kind.capitalize()} in {name}", icon=ICONS[item.kind])


def draw_guides(layout: Any, settings: Any) -> None:
    """The list, where there are any, and the buttons that fill it."""
    layout.use_property_split = False
    if len(settings.guides):
        row = layout.row()
        row.template_list(idnames.List.GUIDES, "", settings, "guides", settings, "guide_index", rows=2)
        row.operator(Operator.GUIDE_REMOVE, text="", icon="REMOVE")
    buttons = layout.row(align=True)
    for kind, name, _ in offered.GUIDES:
        buttons.operator(Operator.GUIDE_ADD, text=f"{name} Guide", icon=ICONS[kind]).kind = kind
