"""Circles over places that come from a certain picture, on that picture, and over those that are being drawn."""

from __future__ import annotations

import json
from typing import Any

import bpy

from .. import editor, properties
from . import drawing

# What is being drawn: px of the panorama (column, row, radius).
pending: list[tuple[float, float, float]] = []
_handlers: list[Any] = []


def circles_on(settings: Any, image: bpy.types.Image | None) -> list[tuple[float, float, float]]:
    """The circles, px of the upright picture, that are drawn over an image."""
    if image is None:
        return []
    if editor.side_of(settings, image) == editor.PANORAMA:
        return list(pending)
    picture = editor.beneath(settings, image)
    share = image.size[0] / max(1, picture.size[0])  # a mask may be smaller
    return [
        (x * share, y * share, radius * share)
        for place in settings.places if place.use and place.picture == picture
        for x, y, radius in json.loads(place.circles)
    ]  # fmt: skip


def draw() -> None:
    """What Blender calls after it has drawn a picture."""
    import numpy as np

    context = bpy.context
    space, settings = context.space_data, properties.settings_of(context.scene)
    image = space.image
    if image is None or not space.overlay.show_overlays or not all(image.size):
        return
    circles = circles_on(settings, image)
    if not circles:
        return
    import gpu

    from . import overlay_geometry

    gpu.state.blend_set("ALPHA")
    view = drawing.View(context, settings, image)
    ends = np.concatenate([overlay_geometry.rings(np.array([[x, y]]), radius) for x, y, radius in circles])
    ends = view.at(ends.astype(np.float64))
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
