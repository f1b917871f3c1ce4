"""What came of a stitch: its facts, what lies over it, what is taken along."""

from __future__ import annotations

from typing import Any

import bpy

from .. import editor, explain, idnames
from ..bridge import ownership
from ..idnames import Operator
from ..operators import scene_objects
from ..scene import take_along
from .rows import LINE, NOTE, WARNING, Row, SubPanel, rows, words

# px of error at which the overlay's matches are red; overlay_geometry has it too, and is not loaded for a label.
WORST = 4.0
# Share of the width that the labels of facts take.
LABELS = 0.36
OVERLAYS = (
    Row("show_places"),
    Row("show_matches"),
    Row("show_epipolar"),
    Row("overlay", text="On Panorama"),
    Row("overlay_opacity", shown=lambda settings: settings.overlay == "DISPLACEMENT"),
)


class EDF_PT_result(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.RESULT
    bl_label = "Result"
    bl_options = set()

    @classmethod
    def poll(cls, context: Any) -> bool:
        return editor.panorama(context) is not None

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        image: Any = editor.panorama(context)
        known = editor.known(image)
        for warning in known["report"]["warnings"]:
            words(self.layout.box(), explain.sentence(warning), width, WARNING)
        column = self.layout.column(align=True)
        names = [("Panorama", image.name), ("Pictures", ", ".join(ownership.names(image)))]
        for what, value in [*names, *explain.facts(known["report"])]:
            line = column.split(factor=LABELS)
            label = line.row()
            label.scale_y = LINE
            label.alignment = "RIGHT"
            label.label(text=what)
            words(line, value, width * (1 - LABELS))
        self.layout.operator(Operator.SAVE, icon="FILE_TICK")
        row = self.layout.row(align=True)
        row.operator(Operator.RESTORE)
        row.operator(Operator.RESTITCH)


class EDF_PT_overlays(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.OVERLAYS
    bl_label = "Overlays"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout, space = self.layout, context.space_data
        image = editor.panorama(context)
        if not space.overlay.show_overlays:
            words(layout, "The editor's own overlays are off; its header switches them on", width, NOTE)
        rows(layout, settings, OVERLAYS, width)
        if image is None:
            words(layout, "There is something to see after a stitch", width, NOTE)
        elif settings.overlay == "DISPLACEMENT" and (ends := editor.known(image).get("heat_range")):
            low, high = ends
            words(layout, f"Blue {low:.0f} px, red {high:.0f} px from where infinity would be", width, NOTE)
        if settings.show_matches:
            words(layout, f"Blue: hit; red: missed by {WORST:.0f} px or more; gray: switched off or new", width, NOTE)


class EDF_PT_take_along(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.TAKE_ALONG
    bl_label = "Into the Scene"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        image, layout = editor.panorama(context), self.layout
        column = layout.column(align=True)
        column.operator(Operator.CREATE_CAMERAS, icon="OUTLINER_OB_CAMERA")
        column.operator(Operator.DEPTH_MESH, icon="MESH_GRID")
        column.operator(Operator.BACKPLATE, icon="IMAGE_BACKGROUND")
        if image is not None and take_along.find(image, take_along.RIG) is not None:
            column.operator(Operator.SET_DISTANCE, icon="DRIVER_DISTANCE")
        if not take_along.no_world(image):
            column.operator(Operator.USE_AS_WORLD, icon="WORLD")
        if reason := take_along.lacking(image) or take_along.lacking(image, depth=True):
            words(layout, reason, width, NOTE)
        layout.label(text="Look Through")
        through = layout.row(align=True)
        for role, label, _ in scene_objects.ROLES:
            button = through.row(align=True)
            button.enabled = image is not None and take_along.find(image, role) is not None
            button.operator(Operator.LOOK_THROUGH, text=label).role = role
