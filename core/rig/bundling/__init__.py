"""The second half: from averaged rotations to tracks, places, and one bundle of everything.

The way in: `solving.solve`. May import system, raster, cameras, pose and rig.averaging.
"""
