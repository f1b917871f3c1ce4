"""What the sidebar and the headers of an Image Editor leave free of its picture."""

from __future__ import annotations

from typing import Any

import bpy

# Regions that may lie over the picture (Preferences ▸ Editing ▸ Region Overlap).
OVER = ("UI", "TOOLS", "HEADER", "TOOL_HEADER")
# px of the screen before the interface's scale that stay free around a picture that is fitted in.
MARGIN = 16.0


def lying_over(area: bpy.types.Area) -> list[bpy.types.Region]:
    """The regions of an editor that may lie over its picture, where they are open."""
    return [one for one in area.regions if one.type in OVER and one.width > 1 and one.height > 1]


def free_box(area: bpy.types.Area, region: bpy.types.Region) -> tuple[float, float, float, float]:
    """Left, bottom, right and top px of what no other region lies over of the one that shows the picture."""
    left, bottom, right, top = 0.0, 0.0, float(region.width), float(region.height)
    for one in lying_over(area):
        x, y = one.x - region.x, one.y - region.y
        if one.alignment == "RIGHT":
            right = min(right, x)
        elif one.alignment == "LEFT":
            left = max(left, x + one.width)
        elif one.alignment == "TOP":
            top = min(top, y)
        elif one.alignment == "BOTTOM":
            bottom = max(bottom, y + one.height)
    return left, bottom, right, top


def is_covered(area: bpy.types.Area, region: bpy.types.Region) -> bool:
    """Whether a side of the picture lies within its region, but beneath another one: nobody can point at it."""
    left, bottom, right, top = free_box(area, region)
    low, high = (region.view2d.view_to_region(share, share, clip=False) for share in (0.0, 1.0))
    return any(
        inner and beyond
        for end in (low, high)
        for inner, beyond in (
            (0 <= end[0] <= region.width, not left <= end[0] <= right),
            (0 <= end[1] <= region.height, not bottom <= end[1] <= top),
        )
    )


def fit_in(context: Any, image: bpy.types.Image) -> None:
    """The context's Image Editor shows an image, all of it where nothing lies over it, unless it is seen well."""
    area, space = context.area, context.space_data
    region = next(one for one in area.regions if one.type == "WINDOW")
    if space.image == image and not is_covered(area, region):
        return
    space.image = image
    left, bottom, right, top = free_box(area, region)
    margin = 2 * MARGIN * context.preferences.system.ui_scale
    ratio = min((right - left - margin) / image.size[0], (top - bottom - margin) / image.size[1])
    if ratio <= 0:  # the sidebar takes all
        return
    # px of the screen from the middle of the region to the middle of what is free
    off = ((left + right - region.width) / 2, (bottom + top - region.height) / 2)
    with context.temp_override(area=area, region=region):
        bpy.ops.image.view_all(fit_view=True)  # which puts the middle into the middle
        bpy.ops.image.view_zoom_ratio(ratio=ratio)
        bpy.ops.image.view_pan(offset=(-off[0] / ratio, -off[1] / ratio))
