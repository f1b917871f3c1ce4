"""The first half: from matches to what each pair says, and to rotations and a focal length that agree with all pairs.

The way in: `averaging.hypotheses`. May import system, raster, pictures, cameras and pose.
"""
