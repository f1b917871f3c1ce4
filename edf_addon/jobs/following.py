"""The picture follows the frame: whenever an artist changes what of the scene the panorama shows, or from where, a
small one takes the place of the one that is shown.

It is made of the matches that the last panorama stands on, so nothing is searched for; the engine keeps geometry, field
and depth of that size, so that only the first one has to find them. Each change ends what was begun for the one before.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy

from .. import editor, idnames, properties
from ..bridge import compat, result
from . import modal, stitching

# Seconds without another change before it begins, and before it looks again where other work is going on.
REST, AGAIN = 0.25, 1.0
# Pixels of the larger picture at most: so many are composed in about a second on two cores.
MOST_PIXELS = 200_000


def changed(settings: Any) -> None:
    """The frame was changed: begin soon, unless it is changed again. Nothing follows under `-b`."""
    if bpy.app.background or settings.result is None:
        return
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
    bpy.app.timers.register(_begin, first_interval=REST)


def make_job(context: bpy.types.Context, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """As `stitching.make_job`, small and without what is only measured."""
    settings = properties.settings_of(context.scene)
    pixels = max(image.size[0] * image.size[1] for image in (settings.reference, settings.target))
    scale = min(settings.scale, math.sqrt(MOST_PIXELS / max(pixels, 1)))
    job, memory = stitching.make_job(context, folder, max(scale, 0.02), result.read(settings.result))
    job["options"]["measure"] = False
    memory["shown"] = settings.result.session_uid
    return job, memory


def take_over(context: bpy.types.Context, folder: Path, found: dict[str, Any], memory: dict[str, Any]) -> str:
    """As `stitching.take_over`, shown only where the panorama was that it follows."""
    before = compat.by_uid(bpy.data.images, memory["shown"])
    spaces = [space for _, space in editor.all_spaces(context) if space.image is not None and space.image == before]
    return stitching.take_over(context, folder, found, memory, "preview", spaces)


def _begin() -> float | None:
    """Starts the work, where there is something to follow; returns when to look again."""
    for window in bpy.context.window_manager.windows:
        settings = properties.settings_of(window.scene)
        if not editor.is_behind(settings, settings.result):
            continue
        if modal.is_working():
            return AGAIN
        with bpy.context.temp_override(window=window):
            getattr(bpy.ops.edf, idnames.Operator.FOLLOW.partition(".")[2])("INVOKE_DEFAULT")
        break
    return None


def register() -> None:
    """Follow from now on."""
    properties.on_reframe.append(changed)


def unregister() -> None:
    """Follow no longer."""
    if changed in properties.on_reframe:
        properties.on_reframe.remove(changed)
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
