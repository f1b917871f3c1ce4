"""Cameras of the scene, as the worker takes them (core/commands/worker.py): lens and place, at any size."""

from __future__ import annotations

from typing import Any

import bpy

from .images import Unusable


def describe(camera: bpy.types.Object, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> dict[str, Any]:
    """One camera: `lens`, fields of core's BlenderLens but the resolution, which is the picture's; `matrix_world`
    (4, 4). As animated and constrained at the current frame. Raises Unusable."""
    seen = camera.evaluated_get(depsgraph)
    data = seen.data
    if data.type != "PERSP":
        kind = {"ORTHO": "orthographic", "PANO": "panoramic"}.get(data.type, data.type.lower())
        raise Unusable(f"the camera “{camera.name}” is {kind}: only perspective cameras take flat photographs")
    names = ("lens", "sensor_width", "sensor_height", "sensor_fit", "shift_x", "shift_y")
    aspect = [scene.render.pixel_aspect_x, scene.render.pixel_aspect_y]
    return {
        "lens": {**{name: getattr(data, name) for name in names}, "aspect": aspect},
        "matrix_world": [list(row) for row in seen.matrix_world],
    }


def is_as_described(
    camera: bpy.types.Object, then: dict[str, Any], scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph
) -> bool:
    """Whether a camera has the lens and stands in the place that `describe` told of it `then`."""
    try:
        now = describe(camera, scene, depsgraph)
    except Unusable:
        return False
    differ = [abs(a - b) for a, b in zip(_numbers(now), _numbers(then), strict=True)]
    return now["lens"]["sensor_fit"] == then["lens"]["sensor_fit"] and max(differ) < 1e-5


def _numbers(told: dict[str, Any]) -> list[float]:
    lens = [value for _, value in sorted(told["lens"].items()) if isinstance(value, float)]
    return [*lens, *told["lens"]["aspect"], *(value for row in told["matrix_world"] for value in row)]


def describe_both(settings: Any, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[dict[str, Any]]:
    """The reference's and the target's camera, as the settings name them. Raises Unusable."""
    chosen = {"reference": settings.reference_camera, "target": settings.target_camera}
    for side, camera in chosen.items():
        if camera is None:
            raise Unusable(f"no {side} camera is chosen: pick one of the scene, or take the camera from elsewhere")
    if chosen["reference"] == chosen["target"]:
        raise Unusable(f"“{chosen['target'].name}” is chosen for both pictures: each needs the camera that took it")
    return [describe(camera, scene, depsgraph) for camera in chosen.values()]
