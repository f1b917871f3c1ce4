"""Clips of cameras that stand still."""

from __future__ import annotations

from typing import Any

import bpy

from .. import explain, idnames
from ..idnames import Operator
from ..jobs import clip_stitching
from .rows import NOTE, SubPanel, words


class EDF_PT_clips(SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = idnames.Panel.CLIPS
    bl_label = "Clips"

    def draw_rows(self, context: Any, settings: Any, width: float) -> None:
        layout = self.layout
        layout.use_property_split = False
        column = layout.column(align=True)
        for number, entry in enumerate(settings.clips):
            row = column.row(align=True)
            if entry.clip is None:
                row.label(text="No longer in the file", icon="ERROR")
            else:
                row.label(text=f"{entry.clip.name}: {entry.clip.frame_duration} frames", icon="SEQUENCE")
            row.operator(Operator.REMOVE_CLIP, text="", icon="X").row = number
        layout.operator(Operator.ADD_CLIPS, icon="FILE_MOVIE")
        layout.operator(Operator.STITCH_CLIPS, icon="SEQUENCE")
        if reason := clip_stitching.why_not(settings):
            words(layout, explain.sentence(reason), width, NOTE)
