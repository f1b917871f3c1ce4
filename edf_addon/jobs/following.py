"""The picture follows the settings: whenever an artist changes what of the scene the panorama shows, from where, or how
it is composed, a small one takes the place of the one that is shown.

A pair's is made of the matches that the last panorama stands on, so nothing is searched for; the engine keeps geometry,
field and depth of that size, so that only the first one has to find them. Of a set the stitch itself keeps small
pictures and geometry (`kept`), and a worker that waits for the first change finds field and depth meanwhile. Each
change ends what was begun for the one before.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import bpy

from .. import editor, idnames, pictures, properties, status
from ..bridge import compat, result
from . import modal, stitching

# Editors in which such a picture was shown, and px of the screen across all of it.
_shown_in: dict[int, float] = {}
# Whether something was changed that the settings do not tell, like a mask.
_asked = False
# Seconds without another change before it begins, and before it looks again where other work is going on.
REST, AGAIN = 0.25, 1.0
# Pixels of the larger picture at most: so many are composed in about a second on two cores.
MOST_PIXELS = 200_000


def changed(settings: Any) -> None:
    """What is followed was changed: begin soon, unless it is changed again. Nothing follows under `-b`."""
    if bpy.app.background or settings.result is None:
        return
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
    bpy.app.timers.register(_begin, first_interval=REST)
    if _asked or editor.is_behind(settings, settings.result):
        modal.start_ahead()


def ask(settings: Any) -> None:
    """An operator changed a mask or a place: begin soon. One undo takes back both that and what follows."""
    global _asked
    _asked = not bpy.app.background and settings.result is not None
    changed(settings)


def make_job(context: bpy.types.Context, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """As `stitching.make_job`, small, without what is only measured, and without a seam that was painted over another
    frame."""
    settings = properties.settings_of(context.scene)
    found = result.read(settings.result)
    if pictures.is_set(settings):
        job, memory = stitching.make_job(context, folder)
        kept = (found or {}).get("kept") or job["kept"]
        job |= {"kept": kept, "small": True, "take": []}
        memory["kept"] = kept
        if found is not None:
            memory["pictures"] = found["pictures"]
    else:
        job, memory = stitching.make_job(context, folder, _scale_of_pair(settings), found)
    job["options"]["measure"] = False
    job.pop("seam", None)
    memory["shown"] = settings.result.session_uid
    return job, memory


def _scale_of_pair(settings: Any) -> float:
    from ...core.options import LEAST_SCALE

    pixels = max(image.size[0] * image.size[1] for image in (settings.reference, settings.target))
    return max(min(settings.scale, math.sqrt(MOST_PIXELS / max(pixels, 1))), LEAST_SCALE)


def take_over(context: bpy.types.Context, folder: Path, found: dict[str, Any], memory: dict[str, Any]) -> str:
    """As `stitching.take_over`, shown only where the panorama was that it follows, as large as that."""
    before = compat.by_uid(bpy.data.images, memory["shown"])
    shown = [both for both in editor.all_spaces(context) if before is not None and both[1].image == before]
    # px of the screen across the whole image; without a window nothing is drawn that wide
    widths = [0.0 if bpy.app.background else space.zoom[0] * before.size[0] for _, space in shown]
    words = stitching.take_over(context, folder, found, memory, "preview", [space for _, space in shown])
    for (area, space), width in zip(shown, widths, strict=True):
        _shown_in[space.as_pointer()] = width
        _as_wide(context, area, space, width)
    return words


def be_ready(request: dict[str, Any]) -> None:
    """A panorama was made by this job: have a worker ready for what is changed of it first, and of a set the field and
    the depth that this takes. Nothing follows under `-b`."""
    if bpy.app.background:
        return
    first = None
    if "kept" in request and not request.get("small"):
        first = {"kept": request["kept"], "pictures": request["pictures"],
                 "options": {**request["options"], "measure": False}}  # fmt: skip
    modal.start_ahead(first)


def _as_wide(context: bpy.types.Context, area: bpy.types.Area, space: bpy.types.SpaceImageEditor, width: float) -> None:
    """Shows the image of an editor so many px of the screen wide."""
    window = next((one for one in context.window_manager.windows if area in one.screen.areas[:]), None)
    region = next(one for one in area.regions if one.type == "WINDOW")
    if width and window is not None:
        with context.temp_override(window=window, area=area, region=region):
            bpy.ops.image.view_zoom_ratio(ratio=width / space.image.size[0])


@bpy.app.handlers.persistent
def _show_again(*_: Any) -> None:
    """What Blender calls after an undo or a redo: where the picture is gone that was shown, the panorama of then is.
    What is being made of the settings, guides, masks and places of before is made anew, of those that are there now."""
    settings = properties.settings_of(bpy.context.scene)
    last = settings.result
    if modal.make_way():
        ask(settings)
    status.forget_unless(modal.there())
    for _area, space in editor.all_spaces(bpy.context):
        if space.as_pointer() in _shown_in and space.image is None and last is not None:
            space.image = last
            if not bpy.app.timers.is_registered(_as_wide_again):
                bpy.app.timers.register(_as_wide_again)


def _as_wide_again() -> None:
    """Once the undo is over: the editors in question show all of their image as wide as before."""
    for area, space in editor.all_spaces(bpy.context):
        if space.image is not None and space.as_pointer() in _shown_in:
            _as_wide(bpy.context, area, space, _shown_in[space.as_pointer()])


def _begin() -> float | None:
    """Starts the work, where there is something to follow; returns when to look again."""
    global _asked
    for window in bpy.context.window_manager.windows:
        settings = properties.settings_of(window.scene)
        is_known = editor.is_of_chosen(settings, settings.result)
        if not (editor.is_behind(settings, settings.result) or (_asked and is_known)):
            continue
        if modal.is_working():
            return AGAIN
        joins, _asked = _asked, False
        with bpy.context.temp_override(window=window):
            getattr(bpy.ops.edf, idnames.Operator.FOLLOW.partition(".")[2])("INVOKE_DEFAULT", joins=joins)
        return None
    _asked = False
    return None


_HANDLERS = (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post)


def register() -> None:
    """Follow from now on."""
    properties.on_reframe.append(changed)
    pictures.on_joined.append(ask)
    for handlers in _HANDLERS:
        handlers.append(_show_again)


def unregister() -> None:
    """Follow no longer."""
    if changed in properties.on_reframe:
        properties.on_reframe.remove(changed)
        pictures.on_joined.remove(ask)
    for handlers in _HANDLERS:
        if _show_again in handlers:
            handlers.remove(_show_again)
    if bpy.app.timers.is_registered(_begin):
        bpy.app.timers.unregister(_begin)
