"""Matches by hand: set by coordinates, switched off and deleted, in the list."""

# No `from __future__ import annotations` here: Blender reads the annotations of properties as they are.
from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, FloatVectorProperty

from .. import editor, idnames, pair, pictures, properties
from ..bridge import photo

WHICH = (
    ("ACTIVE", "Active", "The match that is chosen in the list"),
    ("WORSE", "Worse Than", "Those that the last stitch missed by more than so many pixels"),
    ("LEFT_OUT", "Left Out", "Those that contradicted the others"),
    ("DISABLED", "Switched Off", "Those that are switched off"),
    ("ALL", "All", "Every match of the list"),
)
ACTIONS = (
    ("DISABLE", "Switch Off", "Keep them in the list, and out of the next stitch"),
    ("ENABLE", "Switch On", "Use them in the next stitch"),
    ("INVERT", "Invert", "Switch off what is on, and on what is off"),
)


class _WithMatches:
    """Operators that change the list."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        reason = why_not(context)
        if not reason and not len(properties.settings_of(context.scene).matches):
            reason = "There are no matches yet: stitch once, or add some"
        if reason:
            cls.poll_message_set(reason)  # type: ignore[attr-defined]
        return not reason


class EDF_OT_match_add(bpy.types.Operator):  # noqa: N801
    """Add a match: a point of the reference and where the target shows the same"""

    bl_idname = idnames.Operator.MATCH_ADD
    bl_label = "Add Match"
    bl_options = {"REGISTER", "UNDO"}

    point: FloatVectorProperty(name="Point", description="In the reference, px from its top left", size=2)
    target_point: FloatVectorProperty(name="Target Point", description="In the target, px from its top left", size=2)
    weight: FloatProperty(name="Weight", default=1.0, min=0.001)

    @classmethod
    def poll(cls, context: Any) -> bool:
        if reason := why_not(context):
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        for point, side in ((self.point, editor.REFERENCE), (self.target_point, editor.TARGET)):
            if not inside(point, getattr(settings, side)):
                self.report({"ERROR"}, f"({point[0]:g}, {point[1]:g}) lies outside the {side}")
                return {"CANCELLED"}
        add(settings, self.point, self.target_point, self.weight)
        return {"FINISHED"}


class EDF_OT_match_delete(_WithMatches, bpy.types.Operator):  # noqa: N801
    """Take matches off the list"""

    bl_idname = idnames.Operator.MATCH_DELETE
    bl_label = "Delete Matches"

    which: EnumProperty(name="Which", items=WHICH)
    worse_than: FloatProperty(name="Worse Than", default=3.0, min=0.0, subtype="PIXEL")

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        chosen = indices(settings, self.which, self.worse_than)
        for index in reversed(chosen):
            settings.matches.remove(index)
        if chosen:
            edited(settings)
        settings.match_index = min(settings.match_index, len(settings.matches) - 1)
        self.report({"INFO"}, f"{len(chosen)} deleted")
        return {"FINISHED"}


class EDF_OT_match_enable(_WithMatches, bpy.types.Operator):  # noqa: N801
    """Switch matches on or off for the next stitch"""

    bl_idname = idnames.Operator.MATCH_ENABLE
    bl_label = "Switch Matches"

    action: EnumProperty(name="Action", items=ACTIONS)
    which: EnumProperty(name="Which", items=WHICH)
    worse_than: FloatProperty(name="Worse Than", default=3.0, min=0.0, subtype="PIXEL")

    def execute(self, context: Any) -> set[str]:
        settings = properties.settings_of(context.scene)
        chosen = indices(settings, self.which, self.worse_than)
        for index in chosen:
            match = settings.matches[index]
            match.enabled = not match.enabled if self.action == "INVERT" else self.action == "ENABLE"
        if chosen:
            edited(settings)
        return {"FINISHED"}


def why_not(context: Any) -> str:
    """Why matches cannot be edited now; "" where they can."""
    settings = properties.settings_of(context.scene)
    if pictures.is_set(settings):
        return pictures.PAIRS_ONLY
    if settings.reference is None or settings.target is None:
        return "Choose a reference and a target first"
    if getattr(context.window_manager, idnames.JOB).running:
        return "A stitch is going on"
    return ""


def add(settings: Any, point: Any, target_point: Any, weight: float = 1.0) -> Any:
    """A new match at the end of the list, chosen there."""
    match = settings.matches.add()
    match.x, match.y = point
    match.x2, match.y2 = target_point
    match.weight, match.state = weight, "ADDED"
    settings.match_index = len(settings.matches) - 1
    edited(settings)
    return match


def move(match: Any, side: str, point: Any) -> None:
    """Put one end of a match elsewhere: it counts as new then."""
    if side == editor.REFERENCE:
        match.x, match.y = point
    else:
        match.x2, match.y2 = point
    match.error, match.state = -1.0, "ADDED"


def indices(settings: Any, which: str, worse_than: float) -> list[int]:
    """The matches that one of WHICH means, ascending."""
    if which == "ACTIVE":
        return [settings.match_index] if 0 <= settings.match_index < len(settings.matches) else []
    chosen = {
        "WORSE": lambda one: one.error > worse_than,
        "LEFT_OUT": lambda one: one.state == "LEFT_OUT",
        "DISABLED": lambda one: not one.enabled,
        "ALL": lambda _: True,
    }[which]
    return [index for index, one in enumerate(settings.matches) if chosen(one)]


def edited(settings: Any) -> None:
    """From now on the list is what is meant, for the pictures that are chosen."""
    pair.owns_matches(settings)
    settings.edited_matches = True


def inside(point: Any, image: bpy.types.Image) -> bool:
    """Whether a point, px of the upright picture, lies in it."""
    width, height = photo.upright_size(image)
    return -0.5 <= point[0] <= width - 0.5 and -0.5 <= point[1] <= height - 0.5


CLASSES = (EDF_OT_match_add, EDF_OT_match_delete, EDF_OT_match_enable)


register, unregister = bpy.utils.register_classes_factory(CLASSES)
