"""All that Blender sees: the command `blender -b --command edf …`, the scene's properties, operators and panels.

Nothing of the engine is imported here, nor by what is registered: the work is done in a process of its own, and Blender
starts no slower for it.
"""

from __future__ import annotations

import atexit
from typing import Any

import bpy

from . import properties
from .jobs import command, following, modal
from .operators import (
    clips,
    framing,
    guiding,
    mask_painting,
    match_editing,
    match_pointing,
    opening,
    picture_list,
    picture_masks,
    saving,
    scene_objects,
    stitch,
    taking,
)
from .overlays import drawing, frame_handles, strokes
from .panels import elsewhere, presets, sidebar

# Registered in this order, unregistered in the opposite one; each has register() and unregister().
REGISTERED = (
    properties, modal, following, stitch, opening, picture_list, clips, saving, match_editing, match_pointing,
    mask_painting, picture_masks, taking, guiding, framing, scene_objects, presets, sidebar, elsewhere, drawing,
    strokes, frame_handles,
)  # fmt: skip
_commands: list[Any] = []
_registered: list[Any] = []


def register() -> None:
    """Switch everything on. Blender warns about what is registered twice, so a second call does nothing."""
    if _registered:
        return
    for module in REGISTERED:
        module.register()
        _registered.append(module)
    _commands.append(bpy.utils.register_cli_command("edf", command.run))
    # bpy as a Python module crashes on its way out when a command is still registered by then.
    atexit.register(unregister)


def unregister() -> None:
    """Switch everything off; harmless when it is not on."""
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    while _registered:
        _registered.pop().unregister()
    atexit.unregister(unregister)
