"""From inlier matches to inverse depth d at every point: x' ~ H_inf p + d e'; and, on arrays, what a picture
cannot see and where its map folds.

Method: docs/method.md, 4. May import system, raster and cameras.
"""
