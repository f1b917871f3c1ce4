"""From pictures to matches, and from matches to how the cameras stood.

May import system, raster, pictures and cameras.
"""
