"""What was chosen in making pictures ready: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PreviewOptions:
    """A panorama that is only looked at (`preview`)."""

    pixels: float = 1.4e6
    """px of the panorama: as many as a window shows, and a second or two of work."""

    least_pixels: float = 1.0e6
    """px below which it is made again, larger: how large it becomes is only guessed before it is framed and cropped."""

    most_pixels: float = 2.0e6
    """The same above which it is made again, smaller."""

    tries: int = 2
    """Times that it is made at most: the crop may take another part of it at another size."""

    border_points: int = 16
    """Points along each side of a picture that its outline is guessed by."""


PREVIEW = PreviewOptions()


@dataclass(frozen=True)
class FlatnessOptions:
    """What tells a sphere and a fisheye's circle from flat photographs (`flatness`)."""

    least_side: int = 64
    """px of a picture's shorter side, at least: in less, nothing is told apart."""

    sphere_aspect: float = 0.01
    """Share of its width by which a sphere's may differ from twice its height."""

    sphere_columns: int = 512
    """px that a sphere is looked at with."""

    ends_beside: float = 2.0
    """Times that its ends may differ as much as neighbouring columns do; compression makes them differ a little."""

    ends_apart: float = 0.5
    """The same of columns half a turn apart: in fog and at night all are alike."""

    pole_spread: float = 0.5
    """The same of how much the first and the last row vary, which are one point each, and the rows in the middle."""

    circle_side: int = 360
    """px of the longer side that a circle is looked for with."""

    double_aspect: float = 0.1
    """Share of its width by which a picture of two circles beside each other may differ from twice its height."""

    black: int = 20
    """Levels of 255 that are black: compression and shrinking leave some light there."""

    bright_rim: int = 44
    """Levels of 255 just inside the rim, at least: in the dark corners of a lens light falls off slowly."""

    inside: float = 0.96
    """Radii from the centre to where that is looked at."""

    outside: float = 1.03
    """Radii from the centre beyond which all has to be black."""

    black_outside: float = 0.98
    """Share of that which is: dust and lettering are not."""

    least_outside: float = 0.05
    """Share of the picture that lies there, at least: a circle in a square has 0.21."""

    circle_share: float = 0.15
    """Share of the picture that shows something, at least."""

    least_radius: float = 0.2
    """Radius as a share of the longer side, at least: a lamp or the moon at night is smaller."""

    on_circle: float = 0.012
    """Share of the longer side by which the outline may be off the circle."""

    share_on_circle: float = 0.75
    """Share of the outline that is on it, at least: where it is dark in the picture, the outline dents."""

    covered_deg: float = 150.0
    """Degrees of the circle that have an outline, at least: many circles are cut above and below."""

    sector_deg: float = 10.0
    """Degrees that are counted together for that."""

    least_points: int = 40
    """Points of an outline, at least."""

    fits: int = 4
    """Times that the circle is fitted to what lies near it."""


FLATNESS = FlatnessOptions()
