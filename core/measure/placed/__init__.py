"""What any program's panorama is worth, from where it places each picture: overlaps, straight lines, epipolar lines,
and what of it can be kept.

May import what `measure` may.
"""
