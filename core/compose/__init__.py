"""From layers to one picture: exposure, seam, bands, holes, crop.

Method: docs/method.md, 8. May import system, raster, pictures, cameras, field, panorama, the options and their names.
"""
