"""From pictures to matches, and from matches to how the cameras stood.

Method: docs/method.md, 3. May import system, raster, pictures and cameras.
"""
