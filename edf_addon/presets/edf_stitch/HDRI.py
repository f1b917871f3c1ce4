"""A whole sphere with all its light, seen from one place: for a World."""
import bpy

bpy.context.scene.edf_stitch.projection = "EQUIRECTANGULAR"
bpy.context.scene.edf_stitch.slide_auto = False
bpy.context.scene.edf_stitch.slide = 0.0
bpy.context.scene.edf_stitch.level = "AUTO"
bpy.context.scene.edf_stitch.crop = "FULL"
bpy.context.scene.edf_stitch.holes = "INPAINT"
bpy.context.scene.edf_stitch.light = "AUTO"
bpy.context.scene.edf_stitch.scale = 1.0
bpy.context.scene.edf_stitch.take_layers = False
bpy.context.scene.edf_stitch.take_masks = False
bpy.context.scene.edf_stitch.take_depth = False
bpy.context.scene.edf_stitch.exr_depth = "FLOAT"
