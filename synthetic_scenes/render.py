"""Runs inside Blender, or with bpy as a module: builds a world and renders it through given cameras.

The command line ends with `-- JOB.json FOLDER` (`blender_process` writes it). The job names a world, a seed, the
samples a pixel and two cameras; that of a set, which names more, is `sets.render_set`'s. Into the folder go, for the
reference, the target and the wide reference camera, a multilayer EXR (Combined, Depth, Position, object index) each,
and cameras.json: the cameras as Blender had them, and some rays cast through them. What is true of the pictures is
computed elsewhere, without bpy, from these files alone.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.cameras.projective import homogeneous, project
from .camera_render import camera_of, depths_of, prepare, render_through
from .scene_camera import SceneCamera
from .sets.render_set import render_set
from .stage import Stage
from .worlds import WORLDS

# How far beyond each side the wide picture reaches at most, in sides of the reference.
WIDEST = 1.0


def main() -> None:
    """Renders a job."""
    job_file, folder = map(Path, sys.argv[sys.argv.index("--") + 1 :])
    job = json.loads(job_file.read_text("utf-8"))
    if "sphere" in job:
        render_set(job, folder)
    else:
        _render_pair(job, folder)


def _render_pair(job: dict[str, Any], folder: Path) -> None:
    WORLDS[job["world"]](Stage(job["seed"]))
    prepare(job["samples"])
    reference, target = (camera_of(entry) for entry in job["cameras"])
    box = _reach(reference, target)
    views = {"reference": reference, "target": target, "wide": reference.widened(*box)}
    entries: dict[str, Any] = {"box": box}
    for number, (name, camera) in enumerate(views.items()):
        entries[name] = render_through(camera, folder / f"{name}.exr", number)
    entries["blender"] = bpy.app.version_string
    (folder / "cameras.json").write_text(json.dumps(entries), "utf-8")


def _reach(reference: SceneCamera, target: SceneCamera) -> tuple[int, int, int, int]:
    """left, top, width, height in the reference's pixels that hold the reference and, within WIDEST, what the target
    sees."""
    bpy.context.view_layer.update()
    width, height = target.size
    x, y = np.meshgrid(np.linspace(0, width - 1, 25), np.linspace(0, height - 1, 25))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    depths = np.minimum(depths_of(target, pixels), 1e4)
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
