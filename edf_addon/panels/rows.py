"""What all panels of the tab are made of: properties a line each, long texts, the sidebar's width."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .. import explain, idnames, properties

# Blender's icon for each camera source would only repeat its name; these say what a line is about.
WARNING = "ERROR"
NOTE = "INFO"
# Height of a line of text beside that of a button.
LINE = 0.8


def _always(_settings: Any) -> str:
    return ""


@dataclass(frozen=True)
class Row:
    """A property in a panel: `name`; `why_not(settings)`: why it has no effect now, in words, "" where it has;
    `shown(settings)`: whether it is there at all; `text`: its label where the property's own is too long."""

    name: str
    why_not: Callable[[Any], str] = _always
    shown: Callable[[Any], bool] = lambda _: True
    text: str | None = None


def rows(layout: Any, settings: Any, table: tuple[Row, ...], width: float) -> None:
    """The properties of a table that are shown, one a line; those without effect are grayed out and say why."""
    column = layout.column()
    for row in table:
        if not row.shown(settings):
            continue
        reason = row.why_not(settings)
        line = column.column()
        line.active = not reason
        line.prop(settings, row.name, text=row.text) if row.text else line.prop(settings, row.name)
        if reason:
            words(column, reason, width, NOTE)


def words(layout: Any, text: str, width: float, icon: str = "NONE") -> None:
    """A text of any length, broken into lines that fit."""
    column = layout.column(align=True)
    column.scale_y = LINE
    indent = "BLANK1" if icon != "NONE" else "NONE"
    for number, line in enumerate(explain.lines(text, width - (28 if icon != "NONE" else 8))):
        column.label(text=line, icon=icon if number == 0 else indent)


def width_of(context: Any) -> float:
    """The width of the sidebar in px of an unscaled interface, as far as texts can use it."""
    return context.region.width / context.preferences.system.ui_scale - 50


class Sidebar:
    """A panel of the tab. `draw_rows` gets the settings and the width for texts."""

    bl_space_type = "IMAGE_EDITOR"
    bl_region_type = "UI"
    bl_category = idnames.TAB

    layout: Any

    def draw(self, context: Any) -> None:
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_rows(context, properties.settings_of(context.scene), width_of(context))

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        raise NotImplementedError


class SubPanel(Sidebar):
    bl_parent_id = idnames.Panel.MAIN
    bl_options = {"DEFAULT_CLOSED"}
