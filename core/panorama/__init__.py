"""From cameras and a field to a canvas, the maps of all pictures, and their layers.

May import system, raster, pictures, cameras, field and the names of choices.
"""
