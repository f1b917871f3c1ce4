"""The frame of the panorama, dragged in the window: its edges, its middle and its horizon."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
import math
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatVectorProperty

from .. import editor, idnames, properties
from ..bridge import result
from ..jobs import following
from ..overlays import frame_handles, free_view
from .match_pointing import to_picture, under

# px of the screen before the interface's scale within which an edge or the horizon is caught.
WITHIN = 12.0
_EDGES = ("LEFT", "RIGHT", "TOP", "BOTTOM", "LEFT TOP", "RIGHT TOP", "LEFT BOTTOM", "RIGHT BOTTOM")
PARTS = (
    *((one, one.title(), "The crop ends here") for one in _EDGES),
    ("MIDDLE", "Middle", "Moves the frame, or the box that is cropped, or turns a whole sphere"),
    ("HORIZON", "Horizon", "Up and down in the middle; turned at its ends"),
)
# What has neither a middle nor a horizon of its own.
_PLANE = "The reference's own plane is never moved: choose another Projection"


class EDF_OT_frame_drag(bpy.types.Operator):  # noqa: N801
    """Drag an edge of the panorama to crop it, its middle to move the frame, or its horizon to level it"""

    bl_idname = idnames.Operator.FRAME_DRAG
    bl_label = "Drag Frame"
    bl_options = {"REGISTER", "UNDO"}

    part: EnumProperty(name="Part", description="What is dragged", items=PARTS, default="MIDDLE")
    start: FloatVectorProperty(
        name="From", description="Column and row in the panorama, in pixels from the top left", size=2,
        options={"SKIP_SAVE"},
    )
    end: FloatVectorProperty(
        name="To", description="Column and row in the panorama, in pixels from the top left", size=2,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Any) -> set[str]:
        from ..overlays import frame_drag

        settings, known = properties.settings_of(context.scene), editor.known(editor.panorama(context))
        is_flat = settings.projection == "REFERENCE" or frame_drag.horizon_row(known) is None
        if self.part not in _EDGES and is_flat:
            self.report({"ERROR"}, _PLANE)
            return {"CANCELLED"}
        words = apply(settings, known, self.part, list(self.start), list(self.end))
        following.ask(settings)
        if words:
            self.report({"INFO"}, words)
        return {"FINISHED"}

    def invoke(self, context: Any, _event: Any) -> set[str]:
        if not editor.may_hold_pointer(context):
            self.report({"ERROR"}, "Frames are dragged in an Image Editor: press the button in its sidebar")
            return {"CANCELLED"}
        panorama = editor.panorama(context)
        free_view.fit_in(context, panorama)
        self._drags = False
        _show(context, "MIDDLE", (0.0, 0.0), (0.0, 0.0))
        context.workspace.status_text_set("Drag an edge, the middle or the horizon  ·  Esc")
        context.window.cursor_modal_set("SCROLL_XY")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        if why_not(context) or (event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS"):
            return self._done(context, {"CANCELLED"})
        if event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._drags:
            return self._done(context, self.execute(context))
        is_press = event.type == "LEFTMOUSE" and event.value == "PRESS"
        there = under(context, event) if is_press or (event.type == "MOUSEMOVE" and self._drags) else None
        if there is None or there[0].image != editor.panorama(context):
            return {"PASS_THROUGH"}
        point, scale = to_picture(properties.settings_of(context.scene), *there)
        if is_press and not self._catch(context, point, WITHIN * context.preferences.system.ui_scale / scale):
            return {"PASS_THROUGH"}
        self.end = point
        _show(context, self.part, self.start, self.end)
        return {"RUNNING_MODAL"}

    def cancel(self, context: Any) -> None:
        """Blender ends it: another file is opened, the window is closed."""
        self._done(context, {"CANCELLED"})

    def _catch(self, context: Any, point: tuple[float, float], within: float) -> bool:
        """Begin to drag what lies at a px of the panorama; returns whether something does."""
        import numpy as np

        from ..overlays import frame_drag

        part = frame_drag.part_at(editor.known(editor.panorama(context)), np.array(point), within)
        self._drags = part is not None
        if part is not None:
            self.part, self.start = part, point
        return self._drags

    def _done(self, context: Any, how: set[str]) -> set[str]:
        frame_handles.dragged.clear()
        editor.let_go(context)
        return how


def why_not(context: Any) -> str:
    """Why no frame can be dragged; "" where one can."""
    settings, panorama = properties.settings_of(context.scene), editor.panorama(context)
    if panorama is None:
        return "Stitch first: the frame is dragged over the panorama"
    if not editor.is_of_chosen(settings, panorama):
        return "Other pictures are in the list than this panorama was made of: stitch again, or Restore Settings"
    known: Any = result.read(panorama)
    if "share" not in known or "box" not in known["report"]["canvas"]:
        return "An earlier release made this panorama: stitch again"
    return ""


def apply(settings: Any, known: dict[str, Any], part: str, start: list[float], end: list[float]) -> str:
    """What was dragged of a panorama, from one px to another, becomes settings; returns words about what else has
    changed, or none."""
    import numpy as np

    from ..overlays import frame_drag

    first, last = np.array(start), np.array(end)
    if part == frame_drag.HORIZON:
        line = frame_drag.horizon_by(known, first, last)
        return _level(settings, frame_drag.level_by_line(known, line))
    if part == frame_drag.MIDDLE and settings.crop != "BOX":
        if settings.projection == "EQUIRECTANGULAR":
            return _level(settings, frame_drag.level_turned(known, last - first))
        settings.centre = frame_drag.centre_by(known, tuple(settings.centre), last - first)
        return ""
    settings.crop_box = frame_drag.box_by(known, part, last - first)
    settings.crop = "BOX"
    return ""


def _level(settings: Any, angles: tuple[float, float, float]) -> str:
    settings.level_angles, settings.level = [math.radians(angle) for angle in angles], "ANGLES"
    if settings.crop != "BOX":
        return ""
    settings.crop = "AUTO"
    return "Crop is Automatic again: its box was one of the frame of before"


def _show(context: Any, part: str, start: Any, end: Any) -> None:
    """Draws the frame as what is dragged would have it."""
    import numpy as np

    from ..overlays import frame_drag

    panorama = editor.panorama(context)
    known, first, last = editor.known(panorama), np.array(start), np.array(end)
    told, row = known["report"]["canvas"], frame_drag.horizon_row(known)
    box = np.array([[0.0, 0.0], [told["width"], told["height"]]])
    middle = np.array([told["width"] / 2, 0.0 if row is None else row])
    line = None if row is None else frame_drag.horizon_by(known, middle, middle)
    if part == frame_drag.HORIZON:
        line = frame_drag.horizon_by(known, first, last)
    elif part == frame_drag.MIDDLE:
        box = box + last - first
    else:
        box = frame_drag.shown_box(known, frame_drag.box_by(known, part, last - first))
    frame_handles.show(panorama, box, line)


CLASSES = (EDF_OT_frame_drag,)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
