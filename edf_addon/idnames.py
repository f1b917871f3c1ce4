"""Every name under which Blender knows something of ours: one place, so that a panel never names what is not there."""

from __future__ import annotations

from enum import StrEnum


class Operator(StrEnum):
    """Operators, as bpy.ops calls them."""

    STITCH = "edf.stitch"
    PREVIEW = "edf.preview"
    RESTITCH = "edf.restitch"
    CANCEL = "edf.cancel"
    OPEN_PAIR = "edf.open_pair"
    SWAP = "edf.swap"
    RESET = "edf.reset"
    RESTORE = "edf.restore"
    SAVE = "edf.save"


class Panel(StrEnum):
    """Panels of the Image Editor's sidebar."""


class Menu(StrEnum):
    """Menus."""


# Where the properties hang: bpy.types.Scene.edf_stitch (settings), bpy.types.WindowManager.edf_stitch_job.
SETTINGS = "edf_stitch"
JOB = "edf_stitch_job"
# The sidebar's tab.
TAB = "EDF Stitch"
