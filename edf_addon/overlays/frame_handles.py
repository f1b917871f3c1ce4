"""The frame of a panorama while it is dragged: its edges with handles, its middle and its horizon."""

from __future__ import annotations

from typing import Any

import bpy

from .. import editor, properties
from . import drawing

# What is drawn: session_uid of the panorama (`image`); both ends (2, 2) px of the frame (`box`); two points of the
# horizon (`line`) or None. Empty while nothing is dragged.
dragged: dict[str, Any] = {}
HANDLE = 6.0  # px of the screen before the interface's scale, radius
_handlers: list[Any] = []


def draw() -> None:
    """What Blender calls after it has drawn a picture."""
    import numpy as np

    context = bpy.context
    image = context.space_data.image
    if not dragged or image is None or image.session_uid != dragged["image"]:
        return
    import gpu

    from . import overlay_geometry

    gpu.state.blend_set("ALPHA")
    view = drawing.View(context, properties.settings_of(context.scene), image)
    (left, top), (right, bottom) = dragged["box"] - 0.5
    across, down = np.array([left, (left + right) / 2, right]), np.array([top, (top + bottom) / 2, bottom])
    rim = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]])
    handles = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    ends = [overlay_geometry.segments(view.at(rim)), overlay_geometry.rings(view.at(handles), HANDLE * view.unit)]
    if dragged["line"] is not None:
        ends.append(view.at(np.asarray(dragged["line"])))
    drawing.lines(np.concatenate(ends), drawing.SHADE, view, 2 * drawing.LINE_WIDTH)
    drawing.lines(np.concatenate(ends), drawing.FRAME, view)
    gpu.state.blend_set("NONE")


def show(panorama: bpy.types.Image, box: Any, line: Any) -> None:
    """Draw these from now on, over a panorama."""
    dragged.update(image=panorama.session_uid, box=box, line=line)
    editor.redraw()


def register() -> None:
    """Draw from now on, where there is a window."""
    if not bpy.app.background:
        _handlers.append(bpy.types.SpaceImageEditor.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Draw no longer."""
    dragged.clear()
    while _handlers:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handlers.pop(), "WINDOW")
