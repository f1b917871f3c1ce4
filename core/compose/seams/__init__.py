"""Where one picture ends and the next begins: overlaps, things that moved, tore or are cut, what a seam costs, the cut.

The ways in: `seam.find_seam`, and `refills.improved` with the ways of `cut_things` and `torn_things`.
May import what compose may.
"""
