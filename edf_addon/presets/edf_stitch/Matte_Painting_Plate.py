"""The first photograph, every pixel of it, and around it what the others show: with layers, masks and depth."""
import bpy

bpy.context.scene.edf_stitch.projection = "REFERENCE"
bpy.context.scene.edf_stitch.slide_auto = False
bpy.context.scene.edf_stitch.slide = 0.0
bpy.context.scene.edf_stitch.level = "AUTO"
bpy.context.scene.edf_stitch.crop = "FULL"
bpy.context.scene.edf_stitch.holes = "TRANSPARENT"
bpy.context.scene.edf_stitch.light = "REFERENCE"
bpy.context.scene.edf_stitch.scale = 1.0
bpy.context.scene.edf_stitch.take_layers = True
bpy.context.scene.edf_stitch.take_masks = True
bpy.context.scene.edf_stitch.take_depth = True
