"""Where in the scene the rig of a panorama stands, and how large all is that hangs on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
from mathutils import Matrix, Vector

# Where a rig can be put: identifier, name, tooltip. Nothing of the engine is loaded for this.
PLACES = (
    ("AUTO", "Automatic", "Where the rig stands already. A new one stands where the scene's cameras took the pictures, "
     "else at the 3D cursor"),
    ("CAMERA", "Scene Camera", "The viewpoint is the scene camera's place, and its heading is ahead; what is level "
     "stays level"),
    ("CURSOR", "3D Cursor", "The viewpoint is at the 3D cursor"),
    ("ORIGIN", "World Origin", "The viewpoint is at the origin"),
)  # fmt: skip
# Sine of the angle to the vertical below which a camera's heading is that of its upper edge.
LEAST_HEADING = 0.05


@dataclass(frozen=True)
class Standing:
    """baseline: as in `scene_geometry.placed_cameras`; place: of PLACES; height: of the viewpoint above z = 0, or 0
    for the height that the place has. Lengths in the scene's units."""

    baseline: float = 1.0
    place: str = "AUTO"
    height: float = 0.0


def matrix(
    rig: bpy.types.Object | None, scene: bpy.types.Scene, known: dict[str, Any], standing: Standing
) -> Matrix:
    """Where a rig is to stand, None for a new one. Raises ValueError where the scene has no such place."""
    from . import scene_geometry

    here = Vector(scene_geometry.viewpoint_in_world(known, standing.baseline).tolist())
    if standing.place != "AUTO":
        out = _at(rig, scene, standing.place, here)
    elif rig is not None:
        out = rig.matrix_world.copy()
    elif known["cameras"] is None:
        out = _at(rig, scene, "CURSOR", here)
    else:
        out = _as_taken(known, known["cameras"][0]["matrix_world"])
    if standing.height > 0:
        out.translation.z += standing.height - (out @ here).z
    return out


def rescale(rig: bpy.types.Object, factor: float) -> None:
    """Makes all that hangs on a rig so much larger, seen the same from the rig's place."""
    rig["baseline"] *= factor
    rig.empty_display_size *= factor
    for child in rig.children:
        stands = child.matrix_basis.copy()
        stands.translation *= factor
        child.matrix_basis = stands
        if child.type == "CAMERA":
            child.data.clip_start, child.data.clip_end = factor * child.data.clip_start, factor * child.data.clip_end
        elif child.type == "MESH":
            child.data.transform(Matrix.Scale(factor, 4))
            child.data.update()


def marked_distance(context: Any) -> float:
    """How far apart the two vertices are that are selected in Edit Mode, or the two objects in Object Mode. Raises
    ValueError."""
    if context.mode == "EDIT_MESH":
        context.edit_object.update_from_editmode()
        mesh, to_world = context.edit_object.data, context.edit_object.matrix_world
        points = [to_world @ vertex.co for vertex in mesh.vertices if vertex.select]
    else:
        points = [one.matrix_world.translation for one in context.selected_objects]
    if len(points) != 2 or (points[0] - points[1]).length == 0:
        raise ValueError(
            "Select two things whose distance is known: two cameras, or in Edit Mode two vertices of the depth mesh"
        )
    return float((points[0] - points[1]).length)


def _at(rig: bpy.types.Object | None, scene: bpy.types.Scene, place: str, here: Vector) -> Matrix:
    """The rig's matrix that brings the viewpoint, which is `here` in the rig, to a place."""
    if place == "CAMERA":
        camera = scene.camera
        if camera is None:
            raise ValueError("The scene has no camera: choose another place, or make a camera the scene's")
        if rig is not None and camera.parent == rig:
            raise ValueError("The scene's camera is one of this panorama's own: choose another place")
        heading, away = _heading(camera.matrix_world), camera.matrix_world.translation.copy()
    else:
        heading, away = 0.0, scene.cursor.location.copy() if place == "CURSOR" else Vector()
    return Matrix.Translation(away) @ Matrix.Rotation(heading, 4, "Z") @ Matrix.Translation(-here)


def _heading(camera: Matrix) -> float:
    """Where a camera looks, as an angle about z from +y."""
    rotation = camera.normalized().to_3x3()
    ahead = rotation @ Vector((0, 0, -1))
    if ahead.xy.length < LEAST_HEADING:  # straight down: its upper edge is ahead; straight up: its lower one
        ahead = (rotation @ Vector((0, 1, 0))) * (-1 if ahead.z > 0 else 1)
    return math.atan2(-ahead.x, ahead.y)


def _as_taken(known: dict[str, Any], taken_from: Any) -> Matrix:
    """The rig's matrix that brings its reference camera to where the scene's own stood that took the picture."""
    from . import scene_geometry

    here = scene_geometry.in_world(*scene_geometry.ORIGIN, scene_geometry.axes(known))
    return Matrix(taken_from).normalized() @ Matrix(here.tolist()).inverted()
