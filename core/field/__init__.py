"""From inlier matches to inverse depth d at every point: x' ~ H_inf p + d e'.

Method: docs/method.md, 4. May import system, raster and cameras.
"""
