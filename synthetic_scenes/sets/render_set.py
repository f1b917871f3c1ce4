"""Renders a set inside Blender, or with bpy as a module: every camera's picture, and the sphere at the viewpoint.

The job names a world, a seed, the samples a pixel, cameras by name, the viewpoint's place, the sphere's width, and by
how much brighter, EV, the view AgX of each picture is saved; by nothing, none is.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from ..camera_render import camera_of, prepare, render_through
from ..stage import Stage
from .places import shown_name
from .sphere_camera import SphereCamera
from .worlds import SET_WORLDS

# Rays cast from the viewpoint; each hit is looked for from every camera too.
RAYS = 1500
# Edges of boxes and cards that are kept as the world's straight lines: corners and m of the smallest.
FLAT_CORNERS, SHORTEST = 8, 0.3


def render_set(job: dict[str, Any], folder: Path) -> None:
    """Into the folder go a multilayer EXR for each camera, its view AgX by each exposure, where asked for, the same of
    the sphere, and cameras.json, last: the cameras as Blender had them, rays cast through them, what rays from the
    viewpoint hit and which cameras see that, and the world's straight lines."""
    pose = SET_WORLDS[job["world"]](Stage(job["seed"])) or (lambda number: None)
    prepare(job["samples"])
    bpy.context.scene.cycles.max_bounces = 1  # what is glossy mirrors what emits
    cameras = {name: camera_of(entry) for name, entry in job["views"].items()}
    width = job["sphere"]["width"]
    sphere = SphereCamera(np.array(job["sphere"]["place"]), (width, width // 2))
    pose(None)
    entries: dict[str, Any] = {"sphere": _render_sphere(sphere, folder / "sphere.exr", len(cameras)), "views": {}}
    if job["exposures"]:
        _save_view(folder / "sphere.png", 0.0)
    entries["lines"] = _lines()
    hits = _cast(sphere)
    for number, (name, camera) in enumerate(cameras.items()):
        pose(number)
        entries["views"][name] = render_through(camera, folder / f"{name}.exr", number)
        for exposure in job["exposures"]:
            _save_view(folder / shown_name(name, exposure), exposure)
        for hit, free in zip(hits, _free(camera.place, sphere, hits), strict=True):
            hit.append(free)
    entries["sphere"]["rays"] = hits
    entries["blender"] = bpy.app.version_string
    (folder / "cameras.json").write_text(json.dumps(entries), "utf-8")


def _render_sphere(sphere: SphereCamera, path: Path, number: int) -> dict[str, Any]:
    """Renders all directions; returns the camera as Blender has it."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("sphere")
    made = bpy.data.objects.new("sphere", data)
    scene.collection.objects.link(made)
    data.type = "PANO"
    # a camera's own from Blender 5.0 on
    panoramic = data if hasattr(data, "panorama_type") else data.cycles
    panoramic.panorama_type = "EQUIRECTANGULAR"
    data.clip_start, data.clip_end = 0.01, 1000.0
    made.location, made.rotation_euler = sphere.place.tolist(), (math.pi / 2, 0.0, 0.0)
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = sphere.size
    scene.render.resolution_percentage = 100
    scene.cycles.seed = number
    scene.render.filepath = str(path)
    bpy.context.view_layer.update()
    bpy.ops.render.render(write_still=True)
    return {"place": list(made.matrix_world.translation), "size": list(sphere.size)}


def _save_view(path: Path, exposure: float) -> None:
    """Saves what was rendered last as the view AgX shows it, so much brighter, EV, at 16 bit."""
    scene = bpy.context.scene
    image = scene.render.image_settings
    wanted = {"file_format": "PNG", "color_depth": "16"}
    if hasattr(image, "media_type"):
        wanted = {"media_type": "IMAGE", **wanted}
    before = {name: getattr(image, name) for name in wanted}
    for name, value in wanted.items():
        setattr(image, name, value)
    scene.view_settings.view_transform, scene.view_settings.exposure = "AgX", exposure
    bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    for name, value in before.items():
        setattr(image, name, value)


def _lines() -> list[list[float]]:
    """Both ends, x, y, z each, of the straight edges of boxes and cards."""
    out = []
    for thing in bpy.context.scene.objects:
        if thing.type != "MESH" or len(thing.data.vertices) > FLAT_CORNERS:
            continue
        corners = [thing.matrix_world @ vertex.co for vertex in thing.data.vertices]
        for a, b in sorted({key for face in thing.data.polygons for key in face.edge_keys}):
            if (corners[a] - corners[b]).length >= SHORTEST:
                out.append([*corners[a], *corners[b]])
    return out


def _cast(sphere: SphereCamera) -> list[list[float]]:
    """[x, y, range] of pixels spread evenly over the sphere; rays that hit nothing are left out."""
    scene, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    random = np.random.default_rng(0)
    up = random.uniform(-1, 1, RAYS)
    level, turn = np.sqrt(1 - up**2), random.uniform(-np.pi, np.pi, RAYS)
    pixels = sphere.pixels(np.column_stack([level * np.sin(turn), level * np.cos(turn), up]))
    x, y = (np.mod(np.rint(part), float(side)) for part, side in zip(pixels, sphere.size, strict=True))
    out = []
    for row, direction in zip(np.column_stack([x, y]).tolist(), sphere.directions(x, y), strict=True):
        hit, point, *_ = scene.ray_cast(graph, Vector(sphere.place), Vector(direction))
        if hit:
            out.append([*row, float(np.linalg.norm(np.array(point) - sphere.place))])
    return out


def _free(place: Any, sphere: SphereCamera, hits: list[list[float]]) -> list[float]:
    """Share of the way from a place to what each ray from the sphere's hit that a ray gets; 1 where nothing is before
    it."""
    scene, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    x, y, away = np.array(hits).T[:3]
    out = []
    for way in sphere.place + away[:, None] * sphere.directions(x, y) - place:
        length = float(np.linalg.norm(way))
        hit, first, *_ = scene.ray_cast(graph, Vector(place), Vector(way / length))
        out.append(min(1.0, float(np.linalg.norm(np.array(first) - place)) / length) if hit else 1.0)
    return out
