"""What is done by hand: the list of matches."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import BoolProperty

from .. import idnames, pictures
from ..idnames import Operator
from ..operators import match_editing
from .rows import NOTE, SubPanel, words


class EDF_UL_matches(bpy.types.UIList):  # noqa: N801
    """The matches; the error is what the eye looks for."""

    bl_idname = idnames.List.MATCHES

    worst_first: BoolProperty(name="Worst First", description="Sort by error, the largest on top")
    only_doubtful: BoolProperty(
        name="Doubtful Only", description="Only those that were left out, are switched off or were missed by over 3 px"
    )

    def draw_item(
        self, _context: Any, layout: Any, _data: Any, item: Any, _icon: int, _active: Any, _name: str, index: int = 0,
        _flag: int = 0,
    ) -> None:
        layout.use_property_split = False
        row = layout.split(factor=0.5)
        place = row.row(align=True)
        place.active = item.enabled
        place.prop(item, "enabled", text="")
        place.label(text=f"{item.x:.0f}, {item.y:.0f}")
        side = row.row()
        side.alignment = "RIGHT"
        side.active = item.enabled
        side.label(text=standing(item), icon="ERROR" if item.state == "LEFT_OUT" else "NONE")

    def draw_filter(self, _context: Any, layout: Any) -> None:
        row = layout.row(align=True)
        row.prop(self, "worst_first", toggle=True)
        row.prop(self, "only_doubtful", toggle=True)

    def filter_items(self, _context: Any, data: Any, name: str) -> tuple[list[int], list[int]]:
        items = getattr(data, name)
        shown, order = [], []
        if self.only_doubtful:
            shown = [self.bitflag_filter_item if _doubtful(one) else 0 for one in items]
        if self.worst_first:
            order = [0] * len(items)
            for place, at in enumerate(sorted(range(len(items)), key=lambda at: -items[at].error)):
                order[at] = place
        return shown, order


def standing(match: Any) -> str:
    """What the list says of a match, in a word or two."""
    if match.state == "ADDED":
        return "new"
    if match.error < 0:
        return "not shown"
    return f"{match.error:.2f} px" if match.error < 10 else f"{match.error:.0f} px"


def _doubtful(match: Any) -> bool:
    return match.state == "LEFT_OUT" or not match.enabled or match.error > 3.0


class EDF_MT_matches(bpy.types.Menu):  # noqa: N801
    """What can be done to many matches at once"""

    bl_idname = idnames.Menu.MATCHES
    bl_label = "Matches"

    def draw(self, _context: Any) -> None:
        layout = self.layout
        for action, text, which in (
            ("DISABLE", "Switch Off Worse Than 3 px", "WORSE"), ("DISABLE", "Switch Off Left Out", "LEFT_OUT"),
            ("ENABLE", "Switch On All", "ALL"), ("INVERT", "Invert All", "ALL"),
        ):  # fmt: skip
            item = layout.operator(idnames.Operator.MATCH_ENABLE, text=text)
            item.action, item.which = action, which
        layout.separator()
        for text, which in (("Delete Switched Off", "DISABLED"), ("Delete All", "ALL")):
            layout.operator(idnames.Operator.MATCH_DELETE, text=text).which = which


class EDF_PT_matches(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MATCHES
    bl_label = "Matches"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout = self.layout
        layout.use_property_split = False
        layout.enabled = not pictures.is_set(settings)
        if reason := match_editing.why_not(context):
            words(layout, reason, width, NOTE)
        elif not len(settings.matches):
            words(layout, "A stitch fills this list; or add matches by hand, eight or more", width, NOTE)
        row = layout.row()
        row.template_list(idnames.List.MATCHES, "", settings, "matches", settings, "match_index", rows=5)
        side = row.column(align=True)
        side.operator(Operator.MATCH_EDIT, text="", icon="ADD")
        side.operator(Operator.MATCH_DELETE, text="", icon="REMOVE").which = "ACTIVE"
        side.menu(idnames.Menu.MATCHES, text="", icon="DOWNARROW_HLT")
        if 0 <= settings.match_index < len(settings.matches):
            match = settings.matches[settings.match_index]
            ends = layout.column(align=True)
            for label, names in (("Reference", ("x", "y")), ("Target", ("x2", "y2"))):
                line = ends.split(factor=0.3, align=True)
                line.label(text=label)
                for name in names:
                    line.prop(match, name, text="")
            ends.prop(match, "weight")
        if len(settings.matches):
            on = sum(match.enabled for match in settings.matches)
            layout.label(text=f"{on} of {len(settings.matches)} switched on")
        layout.operator(Operator.MATCH_EDIT, icon="CURSOR")
        layout.prop(settings, "edited_matches")
