"""From layers to one picture: exposure, seam, bands, holes, crop.

May import system, raster, pictures, cameras, field, panorama, the options and their names.
"""
