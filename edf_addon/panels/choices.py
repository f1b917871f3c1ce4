"""How to stitch: camera, field, frame, output."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from .. import editor, engine_options, explain, idnames, offered, pictures
from ..bridge import photo
from ..idnames import Operator
from .guides import draw_guides
from .rows import NOTE, Row, SubPanel, rows, words


def _camera_is(*sources: str) -> Callable[[Any], bool]:
    return lambda settings: settings.camera in sources


def _own_lens(*sources: str) -> Callable[[Any], bool]:
    return lambda settings: settings.own_lens and settings.camera in sources and not pictures.is_set(settings)


def _may_have_own_lens(settings: Any) -> bool:
    return settings.camera in ("FOCAL", "FOCAL35", "FOCAL_PX") and not pictures.is_set(settings)


def _pack_why_not(settings: Any) -> str:
    return "" if settings.fake_user else "Images without a fake user may be dropped on save, packed or not"


def _is_framed(settings: Any) -> bool:
    return settings.projection != "REFERENCE"


def _has_part(settings: Any) -> bool:
    return _is_framed(settings) and not settings.slide_auto and not pictures.is_set(settings)


def _projection_why_not(settings: Any) -> str:
    if settings.projection not in ("AUTO", "REFERENCE") and settings.field not in offered.ROUND_FIELDS:
        return "This needs a field that knows depth everywhere: Slack or Strict"
    return ""


CAMERA = (
    Row("camera"),
    Row("focal", shown=_camera_is("FOCAL")),
    Row("sensor", shown=_camera_is("FOCAL")),
    Row("focal35", shown=_camera_is("FOCAL35")),
    Row("focal_px", shown=_camera_is("FOCAL_PX")),
    Row("own_lens", shown=_may_have_own_lens, text="Two Lenses"),
    Row("target_focal", shown=_own_lens("FOCAL"), text="Target"),
    Row("target_sensor", shown=_own_lens("FOCAL"), text="Sensor Width"),
    Row("target_focal35", shown=_own_lens("FOCAL35"), text="Target"),
    Row("target_focal_px", shown=_own_lens("FOCAL_PX"), text="Target"),
    Row("reference_camera", shown=_camera_is("CAMERAS"), text="Reference"),
    Row("target_camera", shown=_camera_is("CAMERAS"), text="Target"),
)
FIELD = (Row("field"), Row("fade"), Row("dense"))
FRAME = (
    Row("projection", why_not=_projection_why_not),
    Row("pannini_distance", shown=lambda settings: settings.projection == "PANNINI"),
    Row("slide_auto", shown=_is_framed),
    Row("slide", shown=lambda settings: _is_framed(settings) and not settings.slide_auto),
    Row("slide_part", shown=_has_part),
    Row("level", shown=_is_framed),
    Row("level_angles", shown=lambda settings: _is_framed(settings) and settings.level == "ANGLES"),
    Row("centre", shown=lambda settings: settings.projection not in engine_options.WHOLE),
    Row("fov", shown=lambda settings: settings.projection not in engine_options.WHOLE),
    Row("crop"),
    Row("crop_box", shown=lambda settings: settings.crop == "BOX"),
)
OUTPUT = (
    Row("blend"),
    Row("seam", why_not=lambda settings: "An average has no seam" if settings.blend == "LINEAR" else ""),
    Row("light"),
    Row("light_stops", shown=lambda settings: settings.light == "AUTO"),
    Row("holes", why_not=lambda settings: "An average has no holes" if settings.blend == "LINEAR" else ""),
    Row("exr_depth"),
    Row("exr_compression"),
    Row("scale"),
    Row("seed"),
)
KEEP = (Row("fake_user"), Row("pack", why_not=_pack_why_not))
TAKE = (Row("take_layers"), Row("take_masks"), Row("take_depth"))


class EDF_PT_camera(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.CAMERA
    bl_label = "Camera"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, CAMERA, width)
        if settings.camera == "AUTOMATIC" and not pictures.is_set(settings):
            for side in (editor.REFERENCE, editor.TARGET):
                words(self.layout, photo.camera_words(getattr(settings, side), side), width, "CAMERA_DATA")


class EDF_PT_field(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.FIELD
    bl_label = "Field"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, FIELD, width)


class EDF_PT_frame(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.FRAME
    bl_label = "Frame"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, FRAME, width)
        if _is_framed(settings) and settings.slide_auto:
            words(self.layout, explain.viewpoint(editor.report_of(context)), width, NOTE)
        elif not _is_framed(settings):
            words(self.layout, "Seen from the reference's own place, with every pixel of it", width, NOTE)
        if _is_framed(settings):
            draw_guides(self.layout, settings)
        self.layout.operator(Operator.FRAME_DRAG, icon="CON_LOCLIMIT")
        self.layout.operator(Operator.REFERENCE_FRAME, icon="IMAGE_REFERENCE")


class EDF_PT_output(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.OUTPUT
    bl_label = "Output"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, OUTPUT, width)
        self.layout.column(heading="Images").prop(settings, "fake_user")
        rows(self.layout, settings, KEEP[1:], width)
        column = self.layout.column(heading="Also Make")
        for row in TAKE:
            column.prop(settings, row.name)
        self.layout.operator(Operator.RESET, icon="LOOP_BACK")
