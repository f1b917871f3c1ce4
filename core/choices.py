"""The names of everything that may be chosen: one list for the parser, the options and the window.

Nothing is imported here, so that the command line can offer the choices without loading NumPy.
"""

from __future__ import annotations

# Displacement fields. `strict` moves points along their epipolar lines only, `slack` also a little across them; `paper`
# is the published method's own. The rivals know no depth: they are what ours are measured against.
RIVALS = ("rew", "apap", "homography")
FIELDS = ("slack", "strict", "paper", *RIVALS)
# Fields that are defined on every ray, not only in the reference's image plane: a cylinder or sphere needs one.
ROUND_FIELDS = ("slack", "strict")
# What a field fades to outside the overlap: a plane of the scene that goes on there, or infinite distance.
FADES = ("plane", "infinity")
# The surface that the panorama lies on: the reference's image plane, a cylinder, or a sphere.
PROJECTIONS = ("perspective", "cylindrical", "equirectangular")
# How a cylindrical or equirectangular panorama is turned: one of LEVELS, or yaw, pitch, roll in degrees.
LEVELS = ("auto", "none")
Level = str | tuple[float, float, float]
# What of the panorama is kept: one of CROPS, or a box (left, top, width, height) in px.
CROPS = ("full", "inscribed", "reference")
Crop = str | tuple[int, int, int, int]
# Band by band across the seam; by weights that fade towards the pictures' borders or the seam; or a plain average.
BLENDS = ("multiband", "feather", "linear")
# Where the pictures look most alike, or midway between their borders.
SEAMS = ("graphcut", "none")
# What becomes of pixels that neither camera saw, because something near hid them: left out, or filled smoothly.
HOLES = ("transparent", "inpaint")
