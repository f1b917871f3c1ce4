"""Between Blender's data and the engine's: images, photographs' files, cameras, and what a panorama's image
carries. From `bpy` to files and JSON that the worker reads, and back. Imports no other room.
"""
