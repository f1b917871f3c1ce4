"""Circles over places that come from a certain picture, and guides, on that picture and while they are drawn."""

from __future__ import annotations

import json
from typing import Any

import bpy

from .. import editor, properties
from . import drawing

# What is being drawn: px of the panorama (column, row, radius).
pending: list[tuple[float, float, float]] = []
# The guide that is being set: session_uid of the image, and both ends in px of it upright.
line: dict[str, Any] = {}
_handlers: list[Any] = []


def circles_on(settings: Any, image: bpy.types.Image | None) -> list[tuple[float, float, float]]:
    """The circles, px of the upright picture, that are drawn over an image."""
    if image is None:
        return []
    if editor.side_of(settings, image) == editor.PANORAMA:
        return list(pending)
    picture = editor.beneath(settings, image)
    if picture is None:
        return []
    share = image.size[0] / max(1, picture.size[0])  # a mask may be smaller
    return [
        (x * share, y * share, radius * share)
        for place in settings.places if place.use and place.picture == picture
        for x, y, radius in json.loads(place.circles)
    ]  # fmt: skip


def lines_on(settings: Any, image: bpy.types.Image | None) -> list[list[float]]:
    """The guides, both ends in px of the upright picture, that are drawn over an image."""
    if image is None:
        return []
    own = [line["ends"]] if line.get("image") == image.session_uid else []
    return own + [list(guide.ends) for guide in settings.guides if guide.use and guide.picture == image]


def draw() -> None:
    """What Blender calls after it has drawn a picture."""
    import numpy as np

    context = bpy.context
    space, settings = context.space_data, properties.settings_of(context.scene)
    image = space.image
    if image is None or not space.overlay.show_overlays or not all(image.size):
        return
    circles, lines = circles_on(settings, image), lines_on(settings, image)
    if not circles and not lines:
        return
    import gpu

    from . import overlay_geometry

    gpu.state.blend_set("ALPHA")
    view = drawing.View(context, settings, image)
    rings = [overlay_geometry.rings(np.array([[x, y]]), radius) for x, y, radius in circles]
    ends = view.at(np.concatenate([*rings, np.reshape(lines, (-1, 2))]).astype(np.float64))
    drawing.lines(ends, drawing.SHADE, view, 2 * drawing.LINE_WIDTH)
    drawing.lines(ends, drawing.WAITING, view)
    gpu.state.blend_set("NONE")


def register() -> None:
    """Draw from now on, where there is a window."""
    if not bpy.app.background:
        _handlers.append(bpy.types.SpaceImageEditor.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Draw no longer."""
    while _handlers:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handlers.pop(), "WINDOW")
