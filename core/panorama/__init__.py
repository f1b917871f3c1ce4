"""From cameras and a field to a canvas, its map, its layers, and what each picture cannot see.

Method: docs/method.md, 6 and 7. May import system, raster, pictures, cameras, field and the names of choices.
"""
