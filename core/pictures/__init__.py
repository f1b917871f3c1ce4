"""From a file or array to a Picture, and back to a file.

May import system, raster and the choices.
"""
