"""Results of other programs, placed as ours are: Hugin and OpenCV's Stitcher, run here, and what any program left.

May import what `compare` may.
"""
