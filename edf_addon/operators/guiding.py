"""Guides: lines that are upright or level, set with two clicks in a picture or in the panorama."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatVectorProperty, IntProperty

from .. import editor, idnames, offered, pictures, properties
from ..bridge import result
from ..jobs import following
from ..overlays import strokes
from .match_pointing import to_picture, under
from .taking import number_in


class EDF_OT_guide_add(bpy.types.Operator):  # noqa: N801
    """Click both ends of a line that is upright, or level, in a picture or the panorama: automatic Level holds to it"""

    bl_idname = idnames.Operator.GUIDE_ADD
    bl_label = "Add Guide"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(name="Kind", items=offered.GUIDES)
    picture: IntProperty(
        name="Picture", description="Row of the list, from 1, of the picture that it lies in; 0: in the panorama",
        default=0, min=0, options={"SKIP_SAVE"},
    )
    ends: FloatVectorProperty(
        name="Ends", description="Column and row of both ends, in pixels from the top left of the upright picture",
        size=4, options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = why_not(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        if not self.picture:
            return self._keep(context, editor.panorama(context), list(self.ends))
        if self.picture > len(settings.pictures):
            self.report({"ERROR"}, f"The list has no row {self.picture}: choose another number")
            return {"CANCELLED"}
        return self._keep(context, settings.pictures[self.picture - 1].image, list(self.ends))

    def invoke(self, context: Any, _event: Any) -> set[str]:
        if not editor.may_hold_pointer(context):
            self.report({"ERROR"}, "Guides are set in an Image Editor: press the button in its sidebar")
            return {"CANCELLED"}
        strokes.line.clear()
        name = bpy.types.UILayout.enum_item_name(self, "kind", self.kind)
        context.workspace.status_text_set(f"{name} guide: click one end, then the other  ·  Esc")
        context.window.cursor_modal_set("CROSSHAIR")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        if why_not(context) or (event.type in {"ESC", "RIGHTMOUSE"} and event.value == "PRESS"):
            return self._done(context, {"CANCELLED"})
        is_click = event.type == "LEFTMOUSE" and event.value == "PRESS"
        if not is_click and event.type != "MOUSEMOVE":
            return {"PASS_THROUGH"}
        there, settings = under(context, event), properties.settings_of(context.scene)
        if there is None or _lies_in(settings, there[0].image) is None:
            return {"PASS_THROUGH"}
        image, (point, _) = there[0].image, to_picture(settings, *there)
        if is_click and not strokes.line:
            strokes.line.update(image=image.session_uid, ends=[*point, *point])
        elif strokes.line.get("image") == image.session_uid:
            strokes.line["ends"][2:] = point
            if is_click:
                return self._done(context, self._keep(context, _lies_in(settings, image), strokes.line["ends"]))
        editor.redraw()
        return {"RUNNING_MODAL"} if is_click else {"PASS_THROUGH"}

    def cancel(self, context: Any) -> None:
        """Blender ends it: another file is opened, the window is closed."""
        self._done(context, {"CANCELLED"})

    def _keep(self, context: Any, image: bpy.types.Image | None, ends: list[float]) -> set[str]:
        settings = properties.settings_of(context.scene)
        found = (image, ends) if image in pictures.images(settings) else _in_a_picture(settings, image, ends)
        if found is None or ends[:2] == ends[2:]:
            self.report({"ERROR"}, "No picture shows both ends: click two points that one picture shows")
            return {"CANCELLED"}
        guide = settings.guides.add()
        guide.picture, guide.kind, guide.ends = found[0], self.kind, found[1]
        settings.guide_index = len(settings.guides) - 1
        settings.level = "AUTO"
        following.ask(settings)
        return {"FINISHED"}

    def _done(self, context: Any, how: set[str]) -> set[str]:
        strokes.line.clear()
        editor.let_go(context)
        return how


class EDF_OT_guide_remove(bpy.types.Operator):  # noqa: N801
    """Level without this guide"""

    bl_idname = idnames.Operator.GUIDE_REMOVE
    bl_label = "Remove Guide"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return len(properties.settings_of(context.scene).guides) > 0

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        settings.guides.remove(settings.guide_index)
        settings.guide_index = max(0, min(settings.guide_index, len(settings.guides) - 1))
        following.ask(settings)
        return {"FINISHED"}


def why_not(context: Any) -> str:
    """Why no guide can be set; "" where one can."""
    settings = properties.settings_of(context.scene)
    if not any(pictures.images(settings)):
        return "Add pictures to the list first"
    if settings.projection == "REFERENCE":
        return "The reference's own plane is never levelled: choose another Projection"
    return ""


def _lies_in(settings: Any, image: bpy.types.Image | None) -> bpy.types.Image | None:
    """The image, where it is a picture of the list or a panorama of it; else None."""
    return image if image in pictures.images(settings) or editor.is_of_chosen(settings, image) else None


def _in_a_picture(
    settings: Any, panorama: bpy.types.Image | None, ends: list[float]
) -> tuple[bpy.types.Image, list[float]] | None:
    """The picture that shows a line of a panorama most in its middle, and the ends there, px; None where none does."""
    import numpy as np

    from ..overlays import picture_points

    if panorama is None or not editor.is_of_chosen(settings, panorama):
        return None
    known: Any = result.read(panorama)
    best, found = 1.0, None
    for picture in pictures.images(settings):
        number = number_in(known, panorama, picture)
        if number is None:
            continue
        at = picture_points.in_picture(known, np.reshape(ends, (2, 2)), number)
        off = float(np.abs(2 * (at + 0.5) / np.array(known["geometry"]["full_sizes"][number]) - 1).max())
        if off < best:
            best, found = off, (picture, [float(one) for one in at.ravel()])
    return found


CLASSES = (EDF_OT_guide_add, EDF_OT_guide_remove)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
