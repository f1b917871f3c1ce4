"""The cameras that were found, in the forms of other programs: COLMAP, Hugin, transforms.json, Nuke's .chan.

What they read back is in `cameras/programs`. May import what output may.
"""
