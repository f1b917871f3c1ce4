"""What is known of cameras, as data: intrinsics and their sources, lenses, matches, the geometry of a pair.

May import system, raster and pictures.
"""
