"""From what a user names to the pictures of one panorama: read, in one colour space, scaled, without what is masked,
exposures of one view merged.

May import system, raster, pictures, cameras and the options.
"""
