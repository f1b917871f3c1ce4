"""Runs with bpy: renders through Blender's own panoramic camera, or a World, and a gray ball in it, through a camera.
Arguments: JOB.json."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bpy
from edf_stitch.synthetic_scenes.camera_render import prepare
from edf_stitch.synthetic_scenes.stage import Stage
from edf_stitch.synthetic_scenes.worlds import WORLDS
from mathutils import Matrix

job = json.loads(Path(sys.argv[1]).read_text("utf-8"))
stage = Stage(job["seed"])
prepare(job["samples"])
scene, render = bpy.context.scene, bpy.context.scene.render
render.image_settings.file_format = "OPEN_EXR"
data = bpy.data.cameras.new("camera")
camera = bpy.data.objects.new("camera", data)
scene.collection.objects.link(camera)
scene.camera = camera
camera.matrix_world = Matrix(job["matrix_world"])
render.resolution_x, render.resolution_y = job["size"]
render.resolution_percentage = 100
if "world" in job:  # what a panoramic camera sees of it, within a border
    WORLDS[job["world"]](stage)
    scene.collection.objects.link(camera) if camera.name not in scene.collection.objects else None
    data.type = "PANO"
    (data if hasattr(data, "panorama_type") else data.cycles).panorama_type = "EQUIRECTANGULAR"
    data.clip_start, data.clip_end = 0.01, 1000.0
    render.use_border = render.use_crop_to_border = True
    left, top, width, height = job["box"]
    render.border_min_x, render.border_max_x = left / job["size"][0], (left + width) / job["size"][0]
    render.border_max_y, render.border_min_y = 1 - top / job["size"][1], 1 - (top + height) / job["size"][1]
else:  # what a camera sees of a panorama that surrounds it
    data.lens, data.sensor_width, data.sensor_fit = job["lens"], job["sensor_width"], "HORIZONTAL"
    data.shift_x, data.shift_y = job["shift_x"], job["shift_y"]
    scene.world = bpy.data.worlds.new("surroundings")
    scene.world.use_nodes = True
    tree = scene.world.node_tree
    tree.nodes.clear()
    kinds = ("ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeTexEnvironment", "ShaderNodeBackground",
             "ShaderNodeOutputWorld")  # fmt: skip
    where, mapping, texture, background, output = (tree.nodes.new(kind) for kind in kinds)
    texture.image = bpy.data.images.load(job["image"])
    texture.image.colorspace_settings.name = "Non-Color"
    mapping.inputs["Rotation"].default_value = Matrix(job["rotation"]).to_euler("XYZ")
    for source, entry in (
        (where.outputs["Generated"], mapping.inputs["Vector"]), (mapping.outputs[0], texture.inputs["Vector"]),
        (texture.outputs[0], background.inputs["Color"]), (background.outputs[0], output.inputs["Surface"]),
    ):  # fmt: skip
        tree.links.new(source, entry)
if "ball" in job:  # where it lies
    scene.render.engine = "CYCLES"
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=job["ball"])
    bpy.ops.object.shade_smooth()
    gray = bpy.data.materials.new("gray")
    gray.use_nodes = True
    gray.node_tree.nodes.clear()
    surface, shown = (gray.node_tree.nodes.new(kind) for kind in ("ShaderNodeBsdfDiffuse", "ShaderNodeOutputMaterial"))
    surface.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1.0)
    gray.node_tree.links.new(surface.outputs[0], shown.inputs["Surface"])
    bpy.context.object.data.materials.append(gray)
render.filepath = job["out"]
bpy.context.view_layer.update()
bpy.ops.render.render(write_still=True)
