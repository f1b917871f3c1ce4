"""From a field and two pictures to a refined inverse depth at every pixel of the overlap.

Method: docs/method.md, 5. May import system, raster, pictures, cameras and field.
"""
