"""The tab itself: the pictures, the buttons, how far it is and how it went."""

from __future__ import annotations

from typing import Any

import bpy

from .. import explain, idnames, pictures, status
from ..idnames import Operator
from ..jobs import health, stitching
from . import presets
from .picture_list import draw_list
from .rows import NOTE, WARNING, Sidebar, words


class EDF_PT_main(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.MAIN
    bl_label = "EDF Stitch"

    def draw_header_preset(self, _context: Any) -> None:
        presets.EDF_PT_presets.draw_panel_header(self.layout)

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout, job = self.layout, getattr(context.window_manager, idnames.JOB)
        if problem := health.problem():
            words(layout.box(), explain.sentence(problem), width, WARNING)
        column = layout.column()
        column.enabled = not job.running
        draw_list(column, settings, width)
        layout.separator(factor=0.5)
        (_working if job.running else _ready)(layout, settings, job, width)


def _ready(layout: Any, settings: Any, job: Any, width: float) -> None:
    """The buttons, and how the last stitch went."""
    reason = stitching.why_not(settings)
    column = layout.column(align=True)
    column.enabled = not reason
    large = column.row()
    large.scale_y = 1.5
    large.operator(Operator.STITCH, text="Stitch", icon="IMAGE_DATA")
    column.operator(Operator.ENVIRONMENT, icon="WORLD")
    quick = column.row(align=True)
    quick.operator(Operator.PREVIEW)
    quick.prop(settings, "preview_scale", text="")
    if reason:
        words(layout, explain.sentence(reason), width, NOTE)
    elif settings.edited_matches and not pictures.is_set(settings):
        words(layout, "With the matches of the list; none are searched for", width, NOTE)
    if job.message:
        words(layout, job.message, width, WARNING if job.failed else "CHECKMARK")


def _working(layout: Any, _settings: Any, job: Any, width: float) -> None:
    """How far it is."""
    row = layout.row(align=True)
    row.scale_y = 1.5
    row.progress(factor=job.share, text=explain.how_far(job.stage, job.share, status.seconds_left()))
    row.operator(Operator.CANCEL, text="", icon="X")
    words(layout, "Cancelling…" if job.cancelling else "ESC over this editor cancels; Blender is free meanwhile", width)
