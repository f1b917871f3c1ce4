"""What was chosen in framing a panorama: each value with its unit, and why it is what it is.

Values without a source were chosen on photographs: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FramingOptions:
    """What of the world the panorama shows, and how (`framing`)."""

    side_px: int = 160
    """px of the coarse map's longest picture, and of the frames that are tried on it: a rectangle is then known to
    within a percent."""

    outermost_percent: float = 0.3
    """Percent of what is shown that may lie beyond the ends on each side: thin spikes of a map move no frame."""

    max_roll_deg: float = 10.0
    """Degrees of roll of the reference beyond which edges are not believed: nobody holds a camera so by mistake."""

    max_pitch_deg: float = 35.0
    """The same of pitch: so far up or down few edges are upright ones."""

    least_kept: float = 0.85
    """Share of the rectangle that the poses' own direction down leaves room for, which that by edges has to leave too:
    where edges are wrong, the frame leans and the rectangle collapses."""

    full_pitch_deg: float = 12.0
    """Degrees up or down that are levelled fully. What is beyond is kept: uprights that converge a little look better
    than a picture that is stretched at one end."""

    more_kept_deg: tuple[float, ...] = (0.0, 1.5, 3.0, 4.5)
    """Degrees of tilt that may be kept beside that, for a larger rectangle: at the sides uprights then lean by half of
    it."""

    least_room: float = 0.96
    """Share of the largest rectangle so found that a frame leaves room for; of those the one that keeps least tilt."""

    flat_fov_deg: float = 60.0
    """Degrees from left to right up to which a plane looks natural."""

    fov_per_distance_deg: float = 60.0
    """Degrees beyond that per unit of Pannini's distance."""

    max_distance: float = 0.7
    """Pannini's distance at most: beyond, level lines bow visibly."""

    cylinder_fov_deg: float = 130.0
    """Degrees from left to right beyond which Pannini's projection stretches its ends, and a cylinder is taken."""

    ring_fov_deg: float = 330.0
    """Degrees from left to right beyond which a panorama counts as a ring, and is drawn on a sphere: one that closes
    has no ends to be cut."""

    least_gap_deg: float = 2.0
    """Degrees of headings without any picture that count as a gap in such a ring, which then has its ends there."""

    sphere_elevation_deg: float = 60.0
    """Degrees up or down beyond which all of those stretch, and a sphere is taken."""

    frontal_distance: float = 0.15
    """Pannini's distance at most for a scene that is seen frontally, whose level lines may not bow."""

    frontal_length: float = 1.5
    """Sides of a picture of level lines square to the view, weighted by the sine of their elevation, beyond which a
    scene is frontal: façades and stadiums have 1.8 or more, others less than 1."""

    frontal_turn_deg: float = 20.0
    """Degrees to either side of ahead within which a frontal scene may face the camera."""

    frontal_step_deg: float = 2.0
    """Degrees between directions that are tried for that."""

    frontal_sine: float = 0.02
    """Sine of the angle by which such a line may be off level and off square."""

    frontal_elevation_deg: float = 4.0
    """Degrees above or below the horizon from which level lines count: on the horizon no projection bends them."""

    frontal_least_length: float = 0.04
    """Sides of a picture that such a line has at least."""

    max_enlarged: float = 1.35
    """Canvas px per px of the sharper picture, in length, that all but the most enlarged percent stay below."""

    max_reduction: float = 1.2
    """How many times smaller that may make the panorama: where the map itself is torn, size mends nothing."""

    enlarged_percent: float = 99.0
    """Percent of the canvas for which that holds."""

    widest_flat_deg: float = 144.0
    """Degrees to either side at which a frame on a plane, or by Pannini, ends at most: these have ended long before."""

    behind: float = 1e-4
    """Radians from straight behind at which a frame ends: less than a pixel, and to the side of it that is meant."""


FRAMING = FramingOptions()
