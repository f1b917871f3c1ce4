"""What is known of cameras, as data: intrinsics and their sources, lenses, matches, pairs, views.

Method: docs/method.md, 1 and 3. May import system, raster and pictures.
"""
