"""The sidebar's tab in the Image Editor: pictures, Stitch, how to, what came of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy

from . import (
    editor,
    explain,
    health,
    idnames,
    mask_painting,
    match_editing,
    photo,
    presets,
    properties,
    stitching,
    take_along,
)
from .idnames import Operator

# Blender's icon for each camera source would only repeat its name; these say what a line is about.
WARNING, NOTE = "ERROR", "INFO"
# px of error at which the overlay's matches are red; overlay_geometry has it too, and is not loaded for a label.
WORST = 4.0
# Height of a line of text beside that of a button.
LINE = 0.8
# Share of the width that the labels of facts take.
LABELS = 0.36


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


def _camera_is(*sources: str) -> Callable[[Any], bool]:
    return lambda settings: settings.camera in sources


def _own_lens(*sources: str) -> Callable[[Any], bool]:
    return lambda settings: settings.own_lens and settings.camera in sources


def _pack_why_not(settings: Any) -> str:
    return "" if settings.fake_user else "Images without a fake user may be dropped on save, packed or not"


def _is_round(settings: Any) -> bool:
    return settings.projection != "PERSPECTIVE"


def _projection_why_not(settings: Any) -> str:
    if _is_round(settings) and settings.field not in properties.ROUND_FIELDS:
        return "A round panorama needs a field that knows depth everywhere: Slack or Strict"
    return ""


CAMERA = (
    Row("camera"),
    Row("focal", shown=_camera_is("FOCAL")),
    Row("sensor", shown=_camera_is("FOCAL")),
    Row("focal35", shown=_camera_is("FOCAL35")),
    Row("focal_px", shown=_camera_is("FOCAL_PX")),
    Row("own_lens", shown=_camera_is("FOCAL", "FOCAL35", "FOCAL_PX"), text="Two Lenses"),
    Row("target_focal", shown=_own_lens("FOCAL"), text="Target"),
    Row("target_sensor", shown=_own_lens("FOCAL"), text="Sensor Width"),
    Row("target_focal35", shown=_own_lens("FOCAL35"), text="Target"),
    Row("target_focal_px", shown=_own_lens("FOCAL_PX"), text="Target"),
    Row("reference_camera", shown=_camera_is("CAMERAS"), text="Reference"),
    Row("target_camera", shown=_camera_is("CAMERAS"), text="Target"),
)
FIELD = (Row("field"), Row("fade"), Row("dense"))
OUTPUT = (
    Row("projection", why_not=_projection_why_not),
    Row("level", shown=_is_round),
    Row("level_angles", shown=lambda settings: _is_round(settings) and settings.level == "ANGLES"),
    Row("blend"),
    Row("seam", why_not=lambda settings: "An average has no seam" if settings.blend == "LINEAR" else ""),
    Row("exposure"),
    Row("holes", why_not=lambda settings: "An average has no holes" if settings.blend == "LINEAR" else ""),
    Row("crop"),
    Row("crop_box", shown=lambda settings: settings.crop == "BOX"),
    Row("scale"),
    Row("seed"),
)
OVERLAYS = (
    Row("show_matches"),
    Row("show_epipolar"),
    Row("overlay", text="On Panorama"),
    Row("overlay_opacity", shown=lambda settings: settings.overlay == "DISPLACEMENT"),
)
KEEP = (Row("fake_user"), Row("pack", why_not=_pack_why_not))
TAKE = (Row("take_layers"), Row("take_masks"), Row("take_depth"))


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


class _Sidebar:
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


class _Sub(_Sidebar):
    bl_parent_id = idnames.Panel.MAIN
    bl_options = {"DEFAULT_CLOSED"}


class EDF_PT_main(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MAIN
    bl_label = "EDF Stitch"

    def draw_header_preset(self, _context: Any) -> None:
        presets.EDF_PT_presets.draw_panel_header(self.layout)

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout, job = self.layout, getattr(context.window_manager, idnames.JOB)
        if problem := health.problem():
            words(layout.box(), explain.sentence(problem), width, WARNING)
        pictures = layout.column()
        pictures.enabled = not job.running
        for side in (editor.REFERENCE, editor.TARGET):
            pictures.use_property_split = False
            pictures.label(text=f"{side.capitalize()}{_size(getattr(settings, side))}")
            pictures.template_ID(settings, side, open="image.open")
        both = pictures.row(align=True)
        both.operator(Operator.OPEN_PAIR, icon="FILE_FOLDER")
        swap = both.row(align=True)
        swap.enabled = settings.reference is not None or settings.target is not None
        swap.operator(Operator.SWAP, text="Swap", icon="ARROW_LEFTRIGHT")
        layout.separator(factor=0.5)
        (_working if job.running else _ready)(layout, settings, job, width)


def _size(image: bpy.types.Image | None) -> str:
    return "" if image is None or not all(image.size) else f"  ·  {image.size[0]} × {image.size[1]}"


def _ready(layout: Any, settings: Any, job: Any, width: float) -> None:
    """The buttons, and how the last stitch went."""
    reason = stitching.why_not(settings)
    column = layout.column(align=True)
    column.enabled = not reason
    large = column.row()
    large.scale_y = 1.5
    large.operator(Operator.STITCH, icon="IMAGE_DATA")
    quick = column.row(align=True)
    quick.operator(Operator.PREVIEW)
    quick.prop(settings, "preview_scale", text="")
    if reason:
        words(layout, explain.sentence(reason), width, NOTE)
    elif settings.edited_matches:
        words(layout, "With the matches of the list; none are searched for", width, NOTE)
    if job.message:
        words(layout, job.message, width, WARNING if job.failed else "CHECKMARK")


def _working(layout: Any, _settings: Any, job: Any, width: float) -> None:
    """How far it is."""
    row = layout.row(align=True)
    row.scale_y = 1.5
    row.progress(factor=job.share, text=f"{explain.stage(job.stage)}  {job.share:.0%}")
    row.operator(Operator.CANCEL, text="", icon="X")
    words(layout, "Cancelling…" if job.cancelling else "ESC cancels; Blender can be used meanwhile", width)


class EDF_PT_camera(_Sub, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.CAMERA
    bl_label = "Camera"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, CAMERA, width)
        if settings.camera == "AUTOMATIC":
            for side in (editor.REFERENCE, editor.TARGET):
                words(self.layout, photo.camera_words(getattr(settings, side), side), width, "CAMERA_DATA")


class EDF_PT_field(_Sub, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.FIELD
    bl_label = "Field"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        rows(self.layout, settings, FIELD, width)


class EDF_PT_matches(_Sub, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MATCHES
    bl_label = "Matches"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout = self.layout
        layout.use_property_split = False
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


class EDF_PT_masks(_Sub, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MASKS
    bl_label = "Masks"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout = self.layout
        layout.use_property_split = False
        for side, label, _ in mask_painting.SIDES[:2]:
            layout.label(text=f"Ignore in {label}")
            row = layout.row(align=True)
            row.template_ID(settings, mask_painting.MASKS[side], open="image.open")
            row.operator(Operator.MASK_PAINT, text="", icon="BRUSH_DATA").side = side
        layout.label(text="Painted Seam")
        layout.template_ID(settings, "seam_mask", open="image.open")
        reason = mask_painting.why_not(context, "seam")
        row = layout.row(align=True)
        row.enabled = not reason
        for text, black in (("From Reference", True), ("From Target", False)):
            button = row.operator(Operator.MASK_PAINT, text=text)
            button.side, button.black = "seam", black
        if reason:
            words(layout, reason, width, NOTE)
        if painted := mask_painting.painted_for(context):
            said = (
                "Orange comes from the target, dark from the reference" if painted == "seam"
                else f"White is kept out of the {painted}; it is shown in red"
            )  # fmt: skip
            words(layout, said, width, NOTE)
            layout.operator(Operator.MASK_DONE, icon="CHECKMARK")


class EDF_PT_overlays(_Sub, bpy.types.Panel):  # noqa: N801
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
        elif settings.overlay == "DISPLACEMENT":
            low, high = editor.known(image)["heat_range"]
            words(layout, f"Blue {low:.0f} px, red {high:.0f} px from where infinity would be", width, NOTE)
        if settings.show_matches:
            words(layout, f"Blue: hit; red: missed by {WORST:.0f} px or more; gray: switched off or new", width, NOTE)


class EDF_PT_output(_Sub, bpy.types.Panel):  # noqa: N801
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


class EDF_PT_result(_Sub, bpy.types.Panel):  # noqa: N801
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
        for what, value in [("Panorama", image.name), *explain.facts(known["report"])]:
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


class EDF_PT_take_along(_Sub, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.TAKE_ALONG
    bl_label = "Take Along"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        image, layout = editor.panorama(context), self.layout
        column = layout.column(align=True)
        column.operator(Operator.CREATE_CAMERAS, icon="OUTLINER_OB_CAMERA")
        column.operator(Operator.DEPTH_MESH, icon="MESH_GRID")
        if not take_along.no_world(image):
            column.operator(Operator.USE_AS_WORLD, icon="WORLD")
        if reason := take_along.lacking(image) or take_along.lacking(image, depth=True):
            words(layout, reason, width, NOTE)
        layout.label(text="Look Through")
        through = layout.row(align=True)
        for role, label, _ in take_along.ROLES:
            button = through.row(align=True)
            button.enabled = image is not None and take_along.find(image, role) is not None
            button.operator(Operator.LOOK_THROUGH, text=label).role = role


CLASSES = (
    EDF_PT_main, EDF_PT_result, EDF_PT_overlays, EDF_PT_camera, EDF_PT_field, EDF_PT_matches, EDF_PT_masks,
    EDF_PT_output, EDF_PT_take_along,
)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(CLASSES)
