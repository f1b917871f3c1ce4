"""From matches between N pictures to all their cameras at once, in no order: pairs, rotations, places, one bundle.

The way in: `registration.register`. Method: docs/method.md. May import system, raster, pictures, cameras and pose.
"""
