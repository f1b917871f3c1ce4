"""The sidebar's tab in the Image Editor, put together: an artist reads it in this order."""

from __future__ import annotations

import bpy

from .choices import EDF_PT_camera, EDF_PT_field, EDF_PT_frame, EDF_PT_output
from .clips import EDF_PT_clips
from .editing import EDF_MT_matches, EDF_PT_matches, EDF_UL_matches
from .finished import EDF_PT_overlays, EDF_PT_result, EDF_PT_take_along
from .guides import EDF_UL_guides
from .main import EDF_PT_main
from .masks import EDF_PT_masks, EDF_UL_places
from .picture_list import EDF_MT_pictures, EDF_UL_pictures

PANELS = (
    EDF_PT_main, EDF_PT_result, EDF_PT_overlays, EDF_PT_camera, EDF_PT_field, EDF_PT_matches, EDF_PT_masks,
    EDF_PT_frame, EDF_PT_output, EDF_PT_clips, EDF_PT_take_along,
)  # fmt: skip


register, unregister = bpy.utils.register_classes_factory(
    (EDF_UL_pictures, EDF_MT_pictures, EDF_UL_matches, EDF_MT_matches, EDF_UL_places, EDF_UL_guides, *PANELS)
)
