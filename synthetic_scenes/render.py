"""Runs inside Blender, or with bpy as a module: builds a world and renders it through given cameras.

The command line ends with `-- JOB.json FOLDER` (`blender_process` writes it). The job names a world, a seed, the
samples a pixel and two cameras. Into the folder go, for the reference, the target and the wide reference camera, a
multilayer EXR (Combined, Depth, Position, object index) each, and cameras.json: the cameras as Blender had them, and
some rays cast through them. What is true of the pictures is computed elsewhere, without bpy, from these files alone.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..core.cameras.blender_camera import lens_for, matrix_world_of
from ..core.cameras.projective import homogeneous, project
from .scene_camera import SceneCamera
from .stage import Stage
from .worlds import WORLDS

RAYS = 400
# How far beyond each side the wide picture reaches at most, in sides of the reference.
WIDEST = 1.0


def main() -> None:
    """Renders a job."""
    job_file, folder = map(Path, sys.argv[sys.argv.index("--") + 1 :])
    job = json.loads(job_file.read_text("utf-8"))
    WORLDS[job["world"]](Stage(job["seed"]))
    _settings(job["samples"])
    reference, target = (_camera(entry) for entry in job["cameras"])
    box = _reach(reference, target)
    views = {"reference": reference, "target": target, "wide": reference.widened(*box)}
    entries: dict[str, Any] = {"box": box}
    for number, (name, camera) in enumerate(views.items()):
        entries[name] = _render(camera, folder / f"{name}.exr", number)
    entries["blender"] = bpy.app.version_string
    (folder / "cameras.json").write_text(json.dumps(entries), "utf-8")


def _settings(samples: int) -> None:
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


def _camera(entry: dict[str, Any]) -> SceneCamera:
    width, height = entry["size"]
    return SceneCamera(np.array(entry["K"]), np.array(entry["R"]), np.array(entry["t"]), (width, height))


def _render(camera: SceneCamera, path: Path, number: int) -> dict[str, Any]:
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
        "rays": _cast(camera, RAYS),
    }  # fmt: skip


def _cast(camera: SceneCamera, count: int) -> list[list[float]]:
    """[x, y, depth] of what rays through whole pixels hit first, in the scene's own geometry."""
    random = np.random.default_rng(0)
    pixels = np.column_stack([random.integers(0, side, count) for side in camera.size])
    return [[int(x), int(y), depth] for (x, y), depth in zip(pixels, _depths(camera, pixels), strict=True)]


def _depths(camera: SceneCamera, pixels: np.ndarray) -> list[float]:
    graph = bpy.context.evaluated_depsgraph_get()
    rays = homogeneous(pixels) @ np.linalg.inv(camera.K).T @ camera.R
    out = []
    for ray in rays:
        hit, where, *_ = bpy.context.scene.ray_cast(graph, Vector(camera.place), Vector(ray).normalized())
        out.append(float((camera.R @ np.array(where) + camera.t)[2]) if hit else 1e10)
    return out


def _reach(reference: SceneCamera, target: SceneCamera) -> tuple[int, int, int, int]:
    """left, top, width, height in the reference's pixels that hold the reference and, within WIDEST, what the target
    sees."""
    bpy.context.view_layer.update()
    width, height = target.size
    x, y = np.meshgrid(np.linspace(0, width - 1, 25), np.linspace(0, height - 1, 25))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    depths = np.minimum(_depths(target, pixels), 1e4)
    world = (homogeneous(pixels) @ np.linalg.inv(target.K).T * depths[:, None] - target.t) @ target.R
    seen = (world @ reference.R.T + reference.t) @ reference.K.T
    points = project(seen[seen[:, 2] > 0])
    size = np.array(reference.size)
    margin = 0.03 * size
    first = np.clip(np.floor(points.min(axis=0) - margin), -WIDEST * size, 0).astype(int)
    last = np.clip(np.ceil(points.max(axis=0) + margin), size, (1 + WIDEST) * size).astype(int)
    left, top = first.tolist()
    width, height = (last - first).tolist()
    return left, top, width, height


if __name__ == "__main__":
    main()
