"""The fields that ours is measured against: the paper's, REW, APAP, one homography.

May import system, raster, cameras, pose and field.
"""
