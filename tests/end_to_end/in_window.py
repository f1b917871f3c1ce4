"""What walks in a Blender with a window share: editors, regions and the pointer."""

from __future__ import annotations

import subprocess

import bpy


def image_editor() -> bpy.types.Area:
    """The largest area, as an Image Editor with its sidebar open."""
    area = max(bpy.context.window_manager.windows[0].screen.areas, key=lambda one: one.width * one.height)
    area.type = "IMAGE_EDITOR"
    area.spaces.active.show_region_ui = True
    return area


def sidebar(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "UI")


def window_region(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "WINDOW")


def in_editor(area: bpy.types.Area):
    return bpy.context.temp_override(
        window=bpy.context.window_manager.windows[0], area=area, region=window_region(area)
    )  # fmt: skip


def show(area: bpy.types.Area, image: bpy.types.Image) -> None:
    """An image, fitted into what the sidebar leaves free."""
    area.spaces.active.image = image
    with in_editor(area):
        bpy.ops.image.view_all(fit_view=True)


def point_at(area: bpy.types.Area, x: float, y: float) -> None:
    """The mouse, at a share of the area from its lower left."""
    height = bpy.context.window_manager.windows[0].height
    for step in (0, 3):  # Blender hears of a pointer that moves
        place = area.x + x * area.width + step, height - area.y - y * area.height + step
        subprocess.run(["xdotool", "mousemove", *(str(round(value)) for value in place)], check=True)


def in_area(area: bpy.types.Area, x: float, y: float) -> tuple[float, float]:
    """Where a px of the shown picture lies, as a share of the area."""
    region, (width, height) = window_region(area), area.spaces.active.image.size
    across, up = region.view2d.view_to_region((x + 0.5) / width, 1 - (y + 0.5) / height, clip=False)
    return (region.x + across - area.x) / area.width, (region.y + up - area.y) / area.height
