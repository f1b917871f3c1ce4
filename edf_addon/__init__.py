"""All that Blender sees. For now the command: `blender -b --command edf …`."""

from __future__ import annotations

import atexit
from typing import Any

import bpy

from . import command

_registered: list[Any] = []


def register() -> None:
    """Offer `--command edf`. Blender warns about a command that is registered twice, so a second call does nothing."""
    if not _registered:
        _registered.append(bpy.utils.register_cli_command("edf", command.run))
        # bpy as a Python module crashes on its way out when a command is still registered by then.
        atexit.register(unregister)


def unregister() -> None:
    """Withdraw the command; harmless when it is not offered."""
    while _registered:
        bpy.utils.unregister_cli_command(_registered.pop())
    atexit.unregister(unregister)
