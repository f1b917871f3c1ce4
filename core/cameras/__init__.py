"""What is known of cameras, as data: intrinsics and their sources, lenses, matches, pairs, views.

May import system, raster and pictures.
"""
