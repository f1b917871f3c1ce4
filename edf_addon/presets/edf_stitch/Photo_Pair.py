"""Two photographs, or a few, to be kept as a picture."""
import bpy

bpy.context.scene.edf_stitch.projection = "AUTO"
bpy.context.scene.edf_stitch.slide_auto = True
bpy.context.scene.edf_stitch.level = "AUTO"
bpy.context.scene.edf_stitch.crop = "AUTO"
bpy.context.scene.edf_stitch.holes = "AUTO"
bpy.context.scene.edf_stitch.light = "AUTO"
bpy.context.scene.edf_stitch.scale = 1.0
bpy.context.scene.edf_stitch.take_layers = False
bpy.context.scene.edf_stitch.take_masks = False
bpy.context.scene.edf_stitch.take_depth = False
