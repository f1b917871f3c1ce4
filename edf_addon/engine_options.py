"""What an artist decides, in the engine's words: the settings as fields of StitchOptions. No bpy."""

from __future__ import annotations

import math
from typing import Any

# The properties that are options of the engine under the same name: one word of several, or a plain value.
CHOICES = ("field", "fade", "seam", "blend", "holes")
VALUES = ("dense", "seed")
# Projections whose frame is neither moved nor narrowed.
WHOLE = ("REFERENCE", "EQUIRECTANGULAR")
# Degrees below which no frame can be as narrow, and all is shown.
LEAST_FOV = 1.0


def options_of(settings: Any, scale: float | None = None, is_set: bool = False) -> dict[str, Any]:
    """The settings as fields of StitchOptions, JSON-ready; `camera` holds those of CameraRequest. What needs images or
    scene cameras (masks, matches, viewpoint, CAMERAS) is added by whoever has them. scale: instead of the settings'
    own; is_set: of more than two pictures, which one lens took."""
    options: dict[str, Any] = {name: getattr(settings, name).lower() for name in CHOICES}
    options |= {name: getattr(settings, name) for name in VALUES}
    options["exposure"] = _exposure_of(settings)
    options["scale"] = settings.scale if scale is None else scale
    options |= frame_of(settings, options["scale"])
    if is_set and isinstance(options["slide"], list):
        options["slide"] = options["slide"][0]
    options["camera"] = _camera_of(settings, is_set)
    return options


def look_of(settings: Any) -> dict[str, Any]:
    """All that decides how a panorama looks once matches are known: from where it is seen, its frame, and how it is
    composed."""
    composed = {name: getattr(settings, name).lower() for name in ("blend", "seam", "holes")}
    seen_from = settings.seen_from
    return {**frame_of(settings), **composed, "exposure": _exposure_of(settings), "seen_from": seen_from}


def frame_of(settings: Any, scale: float = 1.0) -> dict[str, Any]:
    """What of the scene the panorama shows, and from where: the options of the engine that need no new matches, field
    or depth. scale: of the pictures, for a box in px."""
    is_reference = settings.projection == "REFERENCE"
    frame: dict[str, Any] = {"projection": settings.projection.lower(), "crop": settings.crop.lower()}
    if settings.projection == "PANNINI":
        frame["projection"] = f"pannini:{settings.pannini_distance:.3g}"
    if settings.crop == "BOX":
        frame["crop"] = [int(side * scale) for side in settings.crop_box]
    elif is_reference and settings.crop == "AUTO":
        frame["crop"] = "full"
    frame["slide"] = 0.0 if is_reference else "auto" if settings.slide_auto else _slide_of(settings)
    frame["level"] = "auto" if is_reference else settings.level.lower()
    if frame["level"] == "angles":
        frame["level"] = [math.degrees(angle) for angle in settings.level_angles]
    is_whole = settings.projection in WHOLE
    is_moved = not is_whole and any(settings.centre)
    # Blender's single floats reach a little beyond half a turn and a whole one
    centre = [max(-180.0, min(180.0, math.degrees(angle))) for angle in settings.centre]
    frame["centre"] = centre if is_moved else None
    fov = min(360.0, math.degrees(settings.fov))
    frame["fov"] = fov if fov >= LEAST_FOV and not is_whole else None
    return frame


def _slide_of(settings: Any) -> float | list[float]:
    """How far the viewpoint slides by hand, and within which part of the way, where that is not all of it."""
    part = [round(share, 6) for share in sorted(settings.slide_part)]
    return settings.slide if part == [0.0, 1.0] else [settings.slide, *part]


def exr_form_of(settings: Any) -> dict[str, str]:
    """How a panorama of float pictures is written: the fields of ExrForm."""
    return {"depth": settings.exr_depth.lower(), "compression": settings.exr_compression.lower()}


def _exposure_of(settings: Any) -> str | float:
    """The exposure by name, or the stops that are added to it."""
    if settings.light == "AUTO" and settings.light_stops:
        return float(settings.light_stops)
    return str(settings.light.lower())


def _camera_of(settings: Any, is_set: bool) -> dict[str, Any]:
    def of(name: str) -> list[float]:
        further = [getattr(settings, f"target_{name}")] if settings.own_lens and not is_set else []
        return [getattr(settings, name), *further]

    if settings.camera == "FOCAL":
        return {"focal_mm": of("focal"), "sensor_mm": of("sensor")}
    if settings.camera == "FOCAL35":
        return {"focal35": of("focal35")}
    if settings.camera == "FOCAL_PX":
        return {"focal_px": of("focal_px")}
    return {}
