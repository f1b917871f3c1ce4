"""Where one picture ends and the next begins: overlaps, things that moved, tore or are cut, what a seam costs, the cut.

The ways in: `seam.find_seam` and `cut_things.without_cut_things`. May import what compose may.
"""
