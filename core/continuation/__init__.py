"""Inverse depth beyond the overlap, for what the target alone shows: as its planes, straight lines and uprights go on.

From a field, its dense refinement, the target's colours and edges, and which way is down, to `Continuation`, which has
an inverse depth for every ray. May import system, raster, cameras and field.
"""
