"""Cameras and lenses of other programs: to what a camera file of ours holds.

Names in these files are data: they are compared with those of the pictures, and never opened. May import system,
raster, and the lenses of cameras.
"""
