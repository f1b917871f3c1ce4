"""Matches by hand: set, moved, switched off and deleted with the mouse, on the pictures."""

# No `from __future__ import annotations` here: as in all files with operators.
from typing import Any

import bpy

from .. import editor, idnames, pictures, properties
from ..bridge import photo
from ..overlays import drawing, free_view
from . import match_editing

# How near to a match a click has to be to mean it; px of the screen, before the interface's scale.
REACH = 12.0
HELP = (
    "Click: choose or add a match  ·  Ctrl-click: exactly there  ·  Drag: move  ·  D: on/off  ·  X: delete  ·  "
    "Tab: other picture  ·  Enter: done"
)


class EDF_OT_match_edit(bpy.types.Operator):  # noqa: N801
    """Set, move and delete matches with the mouse: click a point in one picture, then the same in the other"""

    bl_idname = idnames.Operator.MATCH_EDIT
    bl_label = "Edit on the Pictures"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = match_editing.why_not(context)
        if not reason and (context.area is None or context.area.type != "IMAGE_EDITOR"):
            reason = "Matches are set in an Image Editor"
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def invoke(self, context: Any, _event: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        self._dragged: tuple[int, str] | None = None
        self._pair = _pair(settings)
        settings.show_matches = True
        drawing.pending.clear()
        if editor.side_of(settings, context.space_data.image) not in (editor.REFERENCE, editor.TARGET):
            context.space_data.image = settings.reference
        context.workspace.status_text_set(HELP)
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        editor.redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        if pictures.is_set(settings) or settings.reference is None or settings.target is None:
            return self._done(context)
        if self._pair != _pair(settings):  # chosen anew in the sidebar: what was begun belongs to the others
            self._pair, self._dragged = _pair(settings), None
            drawing.pending.clear()
        if event.type in {"RET", "NUMPAD_ENTER", "ESC"} and event.value == "PRESS":
            if event.type != "ESC" or not drawing.pending:
                return self._done(context)
            drawing.pending.clear()  # the half match first, the mode with the next ESC
            editor.redraw()
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE":
            return self._click(context, settings, event)
        if event.type == "MOUSEMOVE":
            return self._move(context, settings, event)
        if event.value == "PRESS" and event.type in {"X", "DEL", "D", "TAB"} and under(context, event) is not None:
            self._key(context, settings, event)
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}

    def _click(self, context: Any, settings: Any, event: Any) -> set[str]:
        if event.value == "RELEASE":
            if self._dragged is not None:
                self._dragged = None
                bpy.ops.ed.undo_push(message="Move Match")
                return {"RUNNING_MODAL"}
            return {"PASS_THROUGH"}
        place = under(context, event)
        if place is None:
            return {"PASS_THROUGH"}  # the sidebar's buttons, other editors
        space, region, position = place
        side = editor.side_of(settings, space.image)
        if side not in (editor.REFERENCE, editor.TARGET):
            return {"PASS_THROUGH"}
        point, scale = to_picture(settings, space, region, position)
        reach = REACH * context.preferences.system.ui_scale / scale
        there = None if drawing.pending else at(settings, side, point, reach)
        if there is not None:
            settings.match_index = there
            self._dragged = (there, side)
        elif match_editing.inside(point, getattr(settings, side)):
            drawing.pending[side] = point
            self._next(settings, space, side, exact=event.ctrl)
        editor.redraw()
        return {"RUNNING_MODAL"}

    def _next(self, settings: Any, space: Any, side: str, exact: bool) -> None:
        """With both points set: the match. With one: on to the other picture, unless an editor shows it already."""
        other = editor.TARGET if side == editor.REFERENCE else editor.REFERENCE
        if other in drawing.pending:
            if not exact:
                drawing.pending[side] = fine_tuned(settings, other, drawing.pending[other], drawing.pending[side])
            match_editing.add(settings, drawing.pending[editor.REFERENCE], drawing.pending[editor.TARGET])
            drawing.pending.clear()
            bpy.ops.ed.undo_push(message="Add Match")
        shown = {editor.side_of(settings, one.image) for _, one in editor.all_spaces(bpy.context)}
        if other not in shown:
            space.image = getattr(settings, other)

    def _move(self, context: Any, settings: Any, event: Any) -> set[str]:
        if self._dragged is None:
            return {"PASS_THROUGH"}
        place = under(context, event)
        index, side = self._dragged
        if place is not None and editor.side_of(settings, place[0].image) == side:
            point, _ = to_picture(settings, *place)
            if match_editing.inside(point, getattr(settings, side)):
                match_editing.move(settings.matches[index], side, point)
                match_editing.edited(settings)
                editor.redraw()
        return {"RUNNING_MODAL"}

    def _key(self, context: Any, settings: Any, event: Any) -> None:
        if event.type == "TAB":
            place = under(context, event)
            side = editor.side_of(settings, place[0].image) if place else None
            if place:
                place[0].image = settings.reference if side == editor.TARGET else settings.target
        elif 0 <= settings.match_index < len(settings.matches):
            if event.type == "D":
                match = settings.matches[settings.match_index]
                match.enabled = not match.enabled
            else:
                settings.matches.remove(settings.match_index)
                settings.match_index = min(settings.match_index, len(settings.matches) - 1)
            match_editing.edited(settings)
            bpy.ops.ed.undo_push(message="Edit Match")
        editor.redraw()

    def _done(self, context: Any) -> set[str]:
        drawing.pending.clear()
        editor.let_go(context)
        return {"FINISHED"}

    def cancel(self, context: Any) -> None:
        """Blender ends it: another file is opened, the window is closed."""
        self._done(context)


def _pair(settings: Any) -> tuple[int, int]:
    """The pictures that are chosen; a reference to them would not survive an undo."""
    return settings.reference.session_uid, settings.target.session_uid


def at(settings: Any, side: str, point: Any, within: float) -> int | None:
    """The match whose end in one picture lies nearest to a point, within so many px."""
    import numpy as np

    from ..overlays import overlay_geometry

    ends = drawing.match_arrays(settings)[side]
    return overlay_geometry.nearest(ends, np.array(point), within)


def fine_tuned(settings: Any, side: str, there: Any, here: Any) -> tuple[float, float]:
    """A click `here`, px of the other picture, moved to where that shows what the picture `side` shows `there`."""
    import numpy as np

    from ..overlays import overlay_geometry
    from . import fine_tune

    other = editor.TARGET if side == editor.REFERENCE else editor.REFERENCE
    images = [getattr(settings, one) for one in (side, other)]
    turns = [photo.orientation(image) for image in images]
    if turns[0] != turns[1]:  # one lies on its side: their patches would have to be turned
        return here
    stored = [
        overlay_geometry.as_stored(np.array(point, np.float64), tuple(image.size), turns[0])
        for point, image in zip((there, here), images, strict=True)
    ]  # fmt: skip
    found, _ = fine_tune.fine_tuned(*(_brightness(image) for image in images), *stored)
    x, y = overlay_geometry.upright(found, tuple(images[1].size), turns[0])
    return (float(x), float(y)) if match_editing.inside((x, y), images[1]) else here


def _brightness(image: bpy.types.Image) -> Any:
    """(H, W) float32, the top row first."""
    import numpy as np

    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, 4)[::-1, :, :3].mean(axis=2)


def under(context: Any, event: Any) -> tuple[Any, Any, tuple[float, float]] | None:
    """The Image Editor under the pointer: its space, the region that shows the picture, and where in it (px)."""
    for area, space in editor.all_spaces(context):
        for region in area.regions:
            x, y = event.mouse_x - region.x, event.mouse_y - region.y
            if not (0 <= x < region.width and 0 <= y < region.height):
                continue
            if region.type != "WINDOW":  # the sidebar lies over it
                return None
            is_covered = any(
                one.x <= event.mouse_x < one.x + one.width and one.y <= event.mouse_y < one.y + one.height
                for one in free_view.lying_over(area)
            )
            return None if is_covered else (space, region, (x, y))
    return None


def to_picture(
    settings: Any, space: Any, region: Any, position: tuple[float, float]
) -> tuple[tuple[float, float], float]:
    """The px of the upright picture under a position of the region, and how many px of the screen one of them takes."""
    import numpy as np

    from ..overlays import overlay_geometry

    size = (space.image.size[0], space.image.size[1])
    stored = overlay_geometry.from_view(np.array(region.view2d.region_to_view(*position)), size)
    x, y = overlay_geometry.upright(stored, size, editor.orientation(settings, space.image))
    (left, _), (right, _) = region.view2d.region_to_view(0, 0), region.view2d.region_to_view(region.width, 0)
    return (float(x), float(y)), region.width / max((right - left) * size[0], 1e-9)


CLASSES = (EDF_OT_match_edit,)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
