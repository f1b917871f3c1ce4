"""From cameras and a field to a canvas, the maps of all pictures, and their layers.

Method: docs/method.md, 6 and 7. May import system, raster, pictures, cameras, field and the names of choices.
"""
