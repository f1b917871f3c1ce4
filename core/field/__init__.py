"""From inlier matches to inverse depth d at every point: x' ~ H_inf p + d e'.

May import system, raster and cameras.
"""
