"""Places of the panorama that are taken from a certain picture: drawn over the panorama, listed, removed."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import FloatProperty, FloatVectorProperty, IntProperty

from .. import editor, idnames, pictures, properties
from ..bridge import ownership, result
from ..jobs import following
from ..overlays import free_view, strokes
from .match_pointing import to_picture, under

# Radius of the brush, px of the screen before the interface's scale.
BRUSH = 30.0
# How far the pointer goes before another circle is drawn, of its radius.
SPACING = 0.5
DIGITS = {f"{key}{name}": n for key in ("", "NUMPAD_") for n, name in enumerate(
    ("ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE"), 1)}  # fmt: skip
DIGITS |= {f"NUMPAD_{n}": n for n in range(1, 10)}


class EDF_OT_take_from(bpy.types.Operator):  # noqa: N801
    """Draw over a place of the panorama that is to come from the picture that is active in the list"""

    bl_idname = idnames.Operator.TAKE_FROM
    bl_label = "Take This Place From Picture"
    bl_options = {"REGISTER", "UNDO"}

    picture: IntProperty(
        name="Picture", description="Row of the list, from 1, of the picture that it comes from; 0: the active row",
        default=0, min=0, options={"SKIP_SAVE"},
    )
    place: FloatVectorProperty(
        name="Place", description="Column and row in the panorama, in pixels from the top left", size=2,
        options={"SKIP_SAVE"},
    )
    radius: FloatProperty(
        name="Radius", description="Of the place, in pixels of the panorama", default=50.0, min=1.0,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Any) -> set[str]:
        return self._take(context, [(self.place[0], self.place[1], self.radius)])

    def invoke(self, context: Any, _event: Any) -> set[str]:
        if not editor.may_hold_pointer(context):
            self.report({"ERROR"}, "Places are drawn in an Image Editor: press the button in its sidebar")
            return {"CANCELLED"}
        panorama = editor.panorama(context)
        if editor.side_of(properties.settings_of(context.scene), context.space_data.image) != editor.PANORAMA:
            free_view.fit_in(context, panorama)
        strokes.pending.clear()
        self._draws = False
        self._say(context)
        context.window.cursor_modal_set("PAINT_BRUSH")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        if why_not(context) or (event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS"):
            return self._done(context, {"CANCELLED"})
        if event.value == "PRESS" and event.type in DIGITS:
            self.picture = DIGITS[event.type]
            self._say(context)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            self._draws = self._add(context, event)
            return {"RUNNING_MODAL"} if self._draws else {"PASS_THROUGH"}
        if event.type == "MOUSEMOVE" and self._draws:
            self._add(context, event)
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._draws:
            return self._done(context, self._take(context, list(strokes.pending)))
        return {"PASS_THROUGH"}

    def cancel(self, context: Any) -> None:
        """Blender ends it: another file is opened, the window is closed."""
        self._done(context, {"CANCELLED"})

    def _add(self, context: Any, event: Any) -> bool:
        """A circle under the pointer, where that is over the panorama and a little away from the last one."""
        there, settings = under(context, event), properties.settings_of(context.scene)
        if there is None or editor.side_of(settings, there[0].image) != editor.PANORAMA:
            return False
        (x, y), scale = to_picture(settings, *there)
        radius = BRUSH * context.preferences.system.ui_scale / scale
        if strokes.pending:
            last_x, last_y, _ = strokes.pending[-1]
            if (x - last_x) ** 2 + (y - last_y) ** 2 < (SPACING * radius) ** 2:
                return True
        strokes.pending.append((x, y, radius))
        editor.redraw()
        return True

    def _take(self, context: Any, drawn: list[tuple[float, float, float]]) -> set[str]:
        """Keeps what was drawn as a place of the picture's."""
        settings, panorama = properties.settings_of(context.scene), editor.panorama(context)
        picture = _picture(settings, self.picture)
        if picture is None:
            self.report({"ERROR"}, f"The list has no row {self.picture} with a picture: choose another number")
            return {"CANCELLED"}
        circles = circles_in(panorama, picture, drawn)
        if not circles:
            self.report({"ERROR"}, f"“{picture.name}” does not show this place: choose another picture of the list")
            return {"CANCELLED"}
        pictures.add_place(settings, picture, circles)
        following.ask(settings)
        return {"FINISHED"}

    def _say(self, context: Any) -> None:
        picture = _picture(properties.settings_of(context.scene), self.picture)
        name = "no picture" if picture is None else picture.name
        context.workspace.status_text_set(f"Draw what is to come from {name}  ·  1 to 9: that row of the list  ·  Esc")

    def _done(self, context: Any, how: set[str]) -> set[str]:
        strokes.pending.clear()
        editor.let_go(context)
        return how


class EDF_OT_place_remove(bpy.types.Operator):  # noqa: N801
    """Let the seams decide here again"""

    bl_idname = idnames.Operator.PLACE_REMOVE
    bl_label = "Remove Place"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return len(properties.settings_of(context.scene).places) > 0

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        settings.places.remove(settings.place_index)
        settings.place_index = max(0, min(settings.place_index, len(settings.places) - 1))
        following.ask(settings)
        return {"FINISHED"}


def why_not(context: Any) -> str:
    """Why no place can be taken from a picture; "" where it can."""
    settings, panorama = properties.settings_of(context.scene), editor.panorama(context)
    if panorama is None:
        return "Stitch first: places are drawn over the panorama"
    if not editor.is_of_chosen(settings, panorama):
        return "Other pictures are in the list than this panorama was made of: stitch again, or Restore Settings"
    return ""


def circles_in(
    panorama: bpy.types.Image, picture: bpy.types.Image, drawn: list[tuple[float, float, float]]
) -> list[list[float]]:
    """Circles over a panorama, px, as circles in a picture, px of it upright; those that it shows."""
    import numpy as np

    from ..overlays import picture_points

    known: Any = result.read(panorama)
    number = number_in(known, panorama, picture)
    if number is None or not drawn:
        return []
    size = known["geometry"]["full_sizes"][number]
    centres, radii = np.array(drawn)[:, :2], np.array(drawn)[:, 2]
    at = picture_points.in_picture(known, centres, number)
    beside = [
        picture_points.in_picture(known, centres + radii[:, None] * np.array(way), number) for way in ((1, 0), (0, 1))
    ]
    there = np.max([np.linalg.norm(one - at, axis=1) for one in beside], axis=0)
    shown = (at >= -there[:, None]).all(axis=1) & (at < np.array(size) + there[:, None]).all(axis=1)
    return [[float(x), float(y), float(r)] for (x, y), r in zip(at[shown], there[shown], strict=True)]


def number_in(known: dict[str, Any], panorama: bpy.types.Image, picture: bpy.types.Image) -> int | None:
    """The number of a picture among those whose cameras a result knows; None where it has no part in it."""
    given = ownership.pictures(panorama)
    if picture not in given:
        return None
    if "cameras" not in known["geometry"]:
        return given.index(picture) if len(given) == len(ownership.SIDES) else None
    name = known["pictures"][given.index(picture)]["name"]
    names = [one["name"] for one in known["geometry"]["cameras"]]
    return names.index(name) if name in names else None


def _picture(settings: Any, row: int) -> bpy.types.Image | None:
    """The picture of a row, from 1; of the active one where it is 0."""
    number = row - 1 if row else settings.picture_index
    return settings.pictures[number].image if number < len(settings.pictures) else None


CLASSES = (EDF_OT_take_from, EDF_OT_place_remove)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
