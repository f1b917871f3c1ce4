"""Where one picture ends and the next begins: overlaps, things that moved, tore or are cut, what a seam costs, the cut.

The ways in: `seam.find_seam`, `cut_things.without_cut_things` and `torn_things.without_torn_things`.
May import what compose may.
"""
