"""The names of everything that may be chosen: one list for the parser, the options and the window.

Nothing is imported here, so that the command line can offer the choices without loading NumPy.
"""

from __future__ import annotations

# Displacement fields. `strict` moves points along their epipolar lines only, `slack` also a little across them; `paper`
# is the published method's own. The rivals know no depth: they are what ours are measured against.
RIVALS = ("rew", "apap", "spw", "lpc", "homography")
# Of them, those that stand on straight lines as well.
LINE_FIELDS = ("spw", "lpc")
FIELDS = ("slack", "strict", "paper", *RIVALS)
# Fields that are defined on every ray, not only in the reference's image plane: a cylinder or sphere needs one.
ROUND_FIELDS = ("slack", "strict")
# What d becomes outside the overlap: what lies at its rim goes on as the picture does, or it fades to one plane of the
# scene, or to infinite distance.
FADES = ("continue", "plane", "infinity")
# The surface that the panorama lies on: chosen by its field of view, the reference's own image plane, a centred plane,
# Pannini's (with `pannini:D` of a given distance), a cylinder, or a sphere.
PROJECTIONS = ("auto", "reference", "perspective", "pannini", "cylindrical", "equirectangular")
# How far the viewpoint slides from the reference's place to the target's: chosen, or a share from 0 to 1; with two
# more, within the part of the way across the overlap from and to these shares of it.
Slide = str | float | tuple[float, float, float]
# The viewpoint that is the picture best connected with all others.
CENTRE = "centre"
# How a panorama that is not on the reference's plane is turned: one of LEVELS, or yaw, pitch, roll in degrees.
LEVELS = ("auto", "none")
Level = str | tuple[float, float, float]
# Lines that a user says are upright or level.
GUIDES = ("vertical", "horizontal")
# What of the panorama is kept: the inscribed rectangle where that holds most of it, else all that is shown, or what a
# name says; or a box (left, top, width, height) in px.
CROPS = ("auto", "full", "inscribed", "reference")
Crop = str | tuple[int, int, int, int]
# Band by band across the seam; by weights that fade towards the pictures' borders or the seam; or a plain average.
BLENDS = ("multiband", "feather", "linear")
# Where the pictures look most alike, or midway between their borders.
SEAMS = ("graphcut", "none")
# What becomes of pixels that no camera saw: small closed holes are filled and larger ones left out, all are left out,
# or all that something near hid are filled smoothly.
HOLES = ("auto", "transparent", "inpaint")
# What becomes of the pictures' light: both meet at one exposure, the target comes to the reference's, or all stays as
# it is; or a number of stops by which all gets brighter than at the common exposure.
EXPOSURES = ("auto", "reference", "none")
Exposing = str | float
# Exposures of one view: looked for and merged, or left as they are; or how many in a row are one bracket.
BRACKETS = ("auto", "off")
Brackets = str | int
# How an EXR file of colours holds its numbers: 32 bits, or 16 with three digits and light up to 65504.
EXR_DEPTHS = ("float", "half")
# How it is packed: as it is, or smaller by a loss that is not seen.
EXR_COMPRESSIONS = ("zip", "dwab")
