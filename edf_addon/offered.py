"""What each choice of the panel offers: identifier, name, tooltip. Nothing is imported here.

A file keeps a choice by its number. Where the order has changed since a release, the number stands behind the tooltip,
so that a file of then still says what it said.
"""

from __future__ import annotations

CAMERA_SOURCES = (
    ("AUTOMATIC", "Automatic", "From the photographs' EXIF; without it, estimated from the matches"),
    ("FOCAL", "Focal Length", "The lens's focal length in millimetres, with the width of the sensor"),
    ("FOCAL35", "35 mm Equivalent", "The focal length that would show as much on a 36 × 24 mm frame"),
    ("FOCAL_PX", "Pixels", "The focal length in pixels of the full picture, as calibration tools give it"),
    ("CAMERAS", "Scene Cameras", "Two cameras of the scene give lens, shift and place; only the field is fitted"),
)
FIELDS = (
    ("SLACK", "Slack", "Along the epipolar lines, with a little slack for what lens distortion does", 0),
    ("STRICT", "Strict", "Exactly along the epipolar lines: every point of the panorama is geometrically right", 1),
    ("PAPER", "Paper", "As published: free to leave the epipolar lines", 2),
    ("REW", "Elastic Warp", "For comparison: one homography, bent freely towards the matches; no depth, no cameras", 3),
    ("APAP", "As-Projective-As-Possible", "For comparison: a homography for each cell; no depth, no cameras", 4),
    ("SPW", "Single Perspective", "For comparison: a mesh that keeps the homography's slopes; no depth, no cameras", 6),
    ("LPC", "Line-Point Consistence", "For comparison: a mesh that keeps straight lines; no depth, no cameras", 7),
    ("HOMOGRAPHY", "Homography", "For comparison: what every other stitcher starts from; no depth, no cameras", 5),
)
GUIDES = (
    ("VERTICAL", "Vertical", "The line is upright, as the edge of a house"),
    ("HORIZONTAL", "Horizontal", "Both ends of the line are equally high, as on the horizon"),
)
# Those that round panoramas can be made of.
ROUND_FIELDS = ("SLACK", "STRICT")
FADES = (
    ("CONTINUE", "Continue", "Outside the overlap each picture goes on as it does where the overlap ends", 2),
    ("PLANE", "Plane", "Outside the overlap the scene carries on as the plane that fits it best", 0),
    ("INFINITY", "Infinity", "Outside the overlap the scene is taken as infinitely far", 1),
)
PROJECTIONS = (
    ("AUTO", "Automatic", "Level and centred; flat where little is in view, rounder the more there is", 3),
    ("REFERENCE", "Reference", "The reference's own plane and place, with every pixel of it kept: for plates", 0),
    ("PERSPECTIVE", "Perspective", "Flat, level and centred: straight lines stay straight, wide views stretch", 4),
    ("PANNINI", "Panini", "Between flat and round: lines up and down and those that run away stay straight", 5),
    ("CYLINDRICAL", "Cylindrical", "Round, for wide panoramas: upright lines stay straight", 1),
    ("EQUIRECTANGULAR", "Equirectangular", "The whole sphere, as a World's environment texture wants it", 2),
)
LEVELS = (
    ("AUTO", "Automatic", "The horizon is found by how the cameras were held"),
    ("NONE", "As Taken", "The reference looks straight ahead"),
    ("ANGLES", "Angles", "Yaw, pitch and roll of the reference in the panorama"),
)
BLENDS = (
    ("MULTIBAND", "Multiband", "Light is evened out across the seam, detail is cut at it: what hides a seam best"),
    ("FEATHER", "Feather", "A soft change from one picture to the other, across the whole overlap"),
    ("LINEAR", "Average", "The plain average of both: doubled edges show where they do not fit"),
)
EXPOSURES = (
    ("AUTO", "Automatic", "Both pictures meet at one exposure, and nothing that they show unclipped is blown", 2),
    ("REFERENCE", "Reference", "The target's exposure and white balance are matched to the reference's", 1),
    ("NONE", "As Taken", "The light of both pictures stays as it is", 0),
)
HOLES = (
    ("AUTO", "Automatic", "Small ones are filled smoothly, large ones left open", 2),
    ("TRANSPARENT", "Transparent", "Left open, to be painted or filled with another picture", 0),
    ("INPAINT", "Inpaint", "Filled smoothly from what lies behind; no detail is made up", 1),
)
SEAMS = (
    ("GRAPHCUT", "Best Cut", "Where the two pictures look most alike, around things rather than through them"),
    ("NONE", "Midway", "Midway between the borders of the two pictures"),
)
CROPS = (
    ("AUTO", "Automatic", "The largest full rectangle where it holds most of what is shown, else everything", 4),
    ("FULL", "Full", "All that either picture shows; transparent elsewhere", 0),
    ("INSCRIBED", "Inscribed", "The largest rectangle without transparent parts", 1),
    ("REFERENCE", "Reference", "Only the reference's own frame", 2),
    ("BOX", "Box", "A rectangle in pixels of the full panorama", 3),
)
EXR_DEPTHS = (
    ("FLOAT", "Float", "32 bits a channel: every value as it is"),
    ("HALF", "Half", "16 bits a channel: three digits, light up to 65504; half as large"),
)
EXR_COMPRESSIONS = (
    ("ZIP", "ZIP", "Without loss"),
    ("DWAB", "DWAB", "Much smaller, with a loss that is not seen"),
)
MATCH_STATES = (
    ("USED", "Used", "The field stands on it"),
    ("LEFT_OUT", "Left Out", "It contradicts the others and was not used"),
    ("ADDED", "Added", "Set by hand since the last stitch"),
)
PICTURE_STATES = (
    ("NEW", "New", "No stitch has used it as it is now"),
    ("USED", "Used", "The panorama shows it, or was made with its help"),
    ("LEFT_OUT", "Left Out", "The panorama was made without it"),
)
OVERLAYS = (
    ("NONE", "None", "The picture alone"),
    ("DIFFERENCE", "Difference", "How much the two pictures differ where both show something; black is the same"),
    ("DISPLACEMENT", "Displacement", "How far each point slides because it is near: blue little, red much"),
)
