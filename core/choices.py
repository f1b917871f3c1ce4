"""The names of everything that may be chosen: one list for the parser, the options and the window.

Nothing is imported here, so that the command line can offer the choices without loading NumPy.
"""

from __future__ import annotations

# Displacement fields: our own, and the rivals that they are measured against.
RIVALS = ("rew", "apap", "homography")
FIELDS = ("slack", "strict", "paper", *RIVALS)
# Fields that mean something on every ray, not only in the reference's plane.
ROUND_FIELDS = ("slack", "strict")
# What a field ends in outside the overlap.
FADES = ("plane", "infinity")
PROJECTIONS = ("perspective", "cylindrical", "equirectangular")
# How a cylindrical or equirectangular panorama is turned: one of LEVELS, or yaw, pitch, roll in degrees.
LEVELS = ("auto", "none")
Level = str | tuple[float, float, float]
# What of the panorama is kept: one of CROPS, or a box (left, top, width, height) in px.
CROPS = ("full", "inscribed", "reference")
Crop = str | tuple[int, int, int, int]
BLENDS = ("multiband", "feather", "linear")
SEAMS = ("graphcut", "none")
# What becomes of pixels that neither camera saw.
HOLES = ("transparent", "inpaint")
