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


@dataclass(frozen=True)
class OverlayOptions:
    """What is taken for burnt into pictures: dates, logos (`overlays`)."""

    least_side: int = 64
    """px of a picture's shorter side, at least."""

    side: int = 1200
    """px of the longer side that is looked at: strokes of a date have 0.2 % of it and more."""

    steep: float = 140.0
    """Sobel's response that makes an outline, levels of 255 over all channels: a step of 20 levels in gray has 140."""

    same_level: float = 9.0
    """Levels of 255, standard deviation over the pictures, of what is the same: compression, beside an outline."""

    outlined: float = 0.7
    """Share of the pictures that have an outline there, at least: the scene behind may have the overlay's colour."""

    reach: float = 0.03
    """Share of the longer side within which outlines are one thing: letters, and lines of them."""

    margin: float = 0.015
    """The same by which it is left out around: shadows of letters, and what compression spreads."""

    rim: int = 4
    """px along the borders in which nothing is sought: scans and exports leave lines there."""

    least_outline: int = 200
    """px beside outlines that are the same, at least: dates have 216 and more, what meets by chance 172 at most."""

    least_further: int = 40
    """The same of further parts where something is burnt in: a word, the time beside a date."""

    least_width: int = 5
    """px of its height and width, at least: a line along a border is no date."""

    dense_of_two: float = 0.2
    """Share of its place that they take, of two pictures, at least: dates 0.24 and more, what meets by chance 0.12."""

    dense: float = 0.1
    """The same of more pictures, in which hardly anything meets by chance."""

    least_alike: float = 0.42
    """Correlation of what is there, at least; between letters the scene shows."""

    most_agree: float = 0.25
    """As many as that of outlines beside it, and all over, at most: else nothing moves, and it may be scene."""

    most_share: float = 0.12
    """Share of the picture that is left out, at most: what is larger is no date."""


OVERLAYS = OverlayOptions()
