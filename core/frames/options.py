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
    """Times that its size is looked at: the crop may take another part of it at another size."""

    border_points: int = 16
    """Points along each side of a picture that its outline is guessed by."""


@dataclass(frozen=True)
class BracketOptions:
    """Exposures of one view: how they are told from other pictures (`brackets`, `exposures`)."""

    thumbnail_px: int = 32
    """px along the longer side of the copies by which exposures of one view are looked for among all pictures."""

    alike: float = 0.75
    """Correlation of the logarithms of their light from which on they may show one view: a shift in the hand costs a
    tenth."""

    working_px: int = 1600
    """px along the longer side at which exposures are aligned: points are found to a twentieth of a pixel there."""

    least_stops: float = 0.6
    """Stops by which two exposures of a bracket differ at least: cameras vary by a third by themselves."""

    usable: tuple[float, float] = (10 / 255, 240 / 255)
    """Share of white, display-encoded, between which a picture tells how bright something is."""

    least_usable: float = 0.01
    """Share of the pixels that both exposures must show so."""

    least_points: int = 30
    """Points that must be found in both for one view to be told by them."""

    most_points: int = 1500
    """Points that are looked for: as many as a homography can use."""

    point_quality: float = 0.002
    """Of the best corner's quality, that of the worst that is taken: dark corners of a room have weak ones only."""

    point_distance_px: float = 8.0
    """px between points at the working size at least, so that they cover the picture."""

    window_px: int = 21
    """px a side that a point is followed by; OpenCV's default."""

    levels: int = 4
    """Halvings at which points are followed first: 16 × 10 px of shift."""

    back_px: float = 0.5
    """px by which a point that is followed there and back may miss itself."""

    mean_px: int = 9
    """px a side of the means of light that are compared: more than what a hand or a resampling blurs."""

    mean_share: float = 0.8
    """Share of such a mean that both exposures must show well."""

    same_stops: float = 0.02
    """Stops by which a gain may be off for points to be followed by it: beyond, it is measured again where the
    pictures were aligned by it, and they are aligned again."""

    inlier_px: float = 0.7
    """px within which the homography has to explain a point, at the working size."""

    least_inliers: float = 0.85
    """Share of the points that it explains in one view: the rest may have moved. Parallax of a step to the side leaves
    less."""

    least_inliers_given: float = 0.65
    """The same where the user says which pictures are one view."""

    most_shift: float = 0.02
    """Share of the diagonal by which a corner may move between two exposures from the hand, which follow each other
    within a second."""

    most_shift_given: float = 0.1
    """The same where the user says so."""

    still_px: float = 0.15
    """px at the working size by which half of the points move less on a tripod: then nothing is resampled."""

    blank_levels: tuple[float, float] = (3.0, 10.0)
    """Levels of 255, median and 90th percentile, by which pictures without points, brought to one exposure, may differ
    and still show one view: noise."""

    exif_agrees: float = 0.26
    """Stops by which the gain that is seen may differ from the one that EXIF tells: its numbers are rounded by up to a
    tenth; beyond, the camera's curve is at work, and EXIF is believed."""


@dataclass(frozen=True)
class MergeOptions:
    """How exposures of one view become one picture (`merging`)."""

    clipping: tuple[float, float] = (217 / 255, 250 / 255)
    """Share of white, display-encoded, from which on an exposure counts less, and from which on it does not count: a
    sensor clips, and curves bend, a little below white."""

    darkness: tuple[float, float] = (5 / 255, 25 / 255)
    """The same from which on it counts at all, and counts fully: a level of 5 may be 10 % off by rounding."""

    clipped: float = 254.5 / 255
    """Share of white that is clipped."""

    last_resort: float = 1e-4
    """Weight of the middle exposure where no other counts: what is beyond another's border is still shown."""

    moved_stops: float = 0.4
    """Stops by which an exposure may differ from all around the same place in the next one: noise of 2 levels at the
    darkest that is compared is 0.25."""

    compared_levels: int = 32
    """Steps of the display-encoded range for each of which the usual difference of two exposures is found: cameras'
    curves differ from sRGB's, and that is no movement."""

    least_compared: int = 50
    """px of such a step, at least, for a median."""

    curve_stops: float = 0.3
    """Stops by which the medians of steps may lie off the parabola through them before they count by half: one is
    another where something moved over all that has its brightness."""

    curve_rounds: int = 10
    """Rounds of weighted least squares, at which the parabola no longer moves."""

    least_moved: float = 1e-4
    """Share of the pixels that something which moved has at least: below, it is noise."""

    moved_margin_px: int = 7
    """px around it, at the working size, that are taken from the same exposure: its soft edge."""

    moved_edge_px: float = 2.0
    """Width (σ) of the change from that exposure to the others, px at the working size."""

    well_exposed: float = 0.9
    """Share of what moved that the middle exposure has to show well to be the one that is taken; else the one that
    shows most of it."""


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

    ends_in: int = 2
    """px of those inwards from each end at which the columns are compared too: a frame is wider."""

    ends_further: float = 0.05
    """Share of what columns half a turn apart differ by that those differ by, at least: of spheres 0.15 and more, of
    frames and backdrops next to nothing."""

    ends_along: float = 0.2
    """Share of how much columns vary that those at the ends vary, at least: of spheres 0.85 and more, of frames
    nothing."""

    least_spread: float = 0.5
    """Levels of 255, standard deviation, by which rows in the middle and the columns at the ends vary, at least: what
    is plain has less, compressed too; a sphere of a dark night may have 1."""

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


@dataclass(frozen=True)
class SphereOptions:
    """The flat views that spheres are worked with as (`spheres`)."""

    ring_deg: tuple[float, float] = (84.0, 110.0)
    """Degrees across and down of the six views around, 60° apart: neighbours share 24°, enough for bands to blend in,
    and where they meet they reach 51° up and down."""

    pole_deg: tuple[float, float] = (100.0, 100.0)
    """Degrees of the views up and down: they begin at 40°."""

    own_share: float = 0.75
    """Share of a view's columns, those in its middle, of which its neighbours do not show all: 68° of 84°."""

    least_shown: float = 0.02
    """Share of a view that must show something there for it to be worked with."""

    least_of_own: float = 0.25
    """The same of a small part of a sphere, as a share of its own px: it fills no view."""

    most_times: float = 1000.0
    """Times its longer side that the sphere may be wide of which a picture is said to be a part: 0.4°, less than any
    lens shows."""

    most_empty: float = 8.0
    """Times as many px as the picture has that a view's box around what it shows may have: of a whole sphere 0.26, of
    thin rings around a pole many."""

    small_px: int = 10_000_000
    """px that such a box may always have."""

    grid: int = 256
    """Points a side by which it is found where a view shows a part of a sphere."""

    grid_margin: float = 6.0
    """Distances of such points by which that is widened: in the corners views stretch them fourfold."""

    least_ahead: float = 0.1
    """Cosine of the angle from a view's axis, at least, of such points: its corners have 0.5."""

    margin_px: int = 3
    """px beyond the borders that cubic interpolation may take."""

    black: int = 4
    """Levels of 255 that are black where nothing is shown in files without transparency, after compression."""

    least_missing: float = 0.005
    """Share of the sphere that such a black part has, at least, at a pole."""

    missing_margin_px: int = 8
    """px by which such a part is widened: compression spreads its edge over a block."""


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


PREVIEW = PreviewOptions()
BRACKETS = BracketOptions()
MERGE = MergeOptions()
FLATNESS = FlatnessOptions()
SPHERES = SphereOptions()
OVERLAYS = OverlayOptions()
