"""Rendering through given cameras, inside Blender or with bpy as a module: the passes, and rays cast beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..core.cameras.blender_camera import lens_for, matrix_world_of
from ..core.cameras.projective import homogeneous
from .scene_camera import SceneCamera

# How many rays are cast through a camera's pixels.
RAYS = 400


def prepare(samples: int) -> None:
    """Sets Cycles up for as many samples a pixel, and files for all passes that the truth needs."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = "CPU", samples, False, False
    cycles.max_bounces = 0  # everything emits its own light
    scene.world = scene.world or bpy.data.worlds.new("world")
    scene.render.film_transparent = False
    scene.render.use_compositing = scene.render.use_sequencer = False
    scene.render.use_persistent_data = True
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_position = layer.use_pass_object_index = True
    image = scene.render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth, image.exr_codec = "32", "ZIP"
    if hasattr(image, "use_exr_interleave"):
        image.use_exr_interleave = True


def camera_of(entry: dict[str, Any]) -> SceneCamera:
    """A job's camera."""
    width, height = entry["size"]
    return SceneCamera(np.array(entry["K"]), np.array(entry["R"]), np.array(entry["t"]), (width, height))


def render_through(camera: SceneCamera, path: Path, number: int) -> dict[str, Any]:
    """Renders through a camera; returns it as Blender has it, and what rays through some of its pixels hit."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    made = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(made)
    lens = lens_for(camera.K, camera.size)
    data.lens, data.sensor_width, data.sensor_fit = lens.lens, lens.sensor_width, lens.sensor_fit
    data.shift_x, data.shift_y = lens.shift_x, lens.shift_y
    data.clip_start, data.clip_end = 0.01, 1000.0
    made.matrix_world = Matrix(matrix_world_of(camera.R, camera.t).tolist())
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = camera.size
    scene.render.resolution_percentage = 100
    scene.cycles.seed = number
    scene.render.filepath = str(path)
    bpy.context.view_layer.update()
    bpy.ops.render.render(write_still=True)
    return {
        "lens": data.lens, "sensor_width": data.sensor_width, "sensor_height": data.sensor_height,
        "sensor_fit": data.sensor_fit, "shift_x": data.shift_x, "shift_y": data.shift_y,
        "resolution": [scene.render.resolution_x, scene.render.resolution_y],
        "matrix_world": [list(row) for row in made.matrix_world],
        "rays": _cast(camera),
    }  # fmt: skip


def _cast(camera: SceneCamera) -> list[list[float]]:
    """[x, y, depth] of what rays through whole pixels hit first, in the scene's own geometry."""
    random = np.random.default_rng(0)
    pixels = np.column_stack([random.integers(0, side, RAYS) for side in camera.size])
    return [[int(x), int(y), depth] for (x, y), depth in zip(pixels, depths_of(camera, pixels), strict=True)]


def depths_of(camera: SceneCamera, pixels: np.ndarray) -> list[float]:
    """Depths of what rays through pixels (N, 2) hit first, in the scene's own geometry."""
    graph = bpy.context.evaluated_depsgraph_get()
    rays = homogeneous(pixels) @ np.linalg.inv(camera.K).T @ camera.R
    out = []
    for ray in rays:
        hit, where, *_ = bpy.context.scene.ray_cast(graph, Vector(camera.place), Vector(ray).normalized())
        out.append(float((camera.R @ np.array(where) + camera.t)[2]) if hit else 1e10)
    return out
