"""All that Blender sees: the command `blender -b --command edf …`, the scene's properties, operators and panels.

Nothing of the engine is imported here, nor by what is registered: the work is done in a process of its own, and Blender
starts no slower for it.
"""

from __future__ import annotations

import atexit
from typing import Any

import bpy

from . import (
    command,
    mask_painting,
    match_editing,
    match_pointing,
    operators,
    overlays,
    panels,
    presets,
    properties,
    take_along,
)

# Registered in this order, unregistered in the opposite one; each has register() and unregister().
ROOMS = (
    properties, operators, match_editing, match_pointing, mask_painting, take_along, presets, panels, overlays,
)  # fmt: skip
_commands: list[Any] = []
_registered: list[Any] = []


def register() -> None:
    """Switch everything on. Blender warns about what is registered twice, so a second call does nothing."""
    if _registered:
        return
    for room in ROOMS:
        room.register()
        _registered.append(room)
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
