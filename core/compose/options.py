"""What was chosen in composing a panorama, stage by stage: each value with its unit, and why it is what it is.

Tones are log-encoded light (see `raster.log_encoding`), about 1 from black to white. Values without a source were
chosen on photographs and rendered scenes: around them the result hardly changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExposureOptions:
    """Matching exposure and white balance (`exposure`)."""

    block_px: int = 8
    """px of the side of the blocks whose means are compared: they forgive an alignment that is a pixel or two off."""

    clipped_light: float = 0.956
    """Light (white is 1) from which pictures of 8 and 16 bits count as clipped: that level, since JPEG rings around
    white."""

    clipped_level: int = 250
    """The same as a level of 8 bits."""

    min_brightness: float = 0.05
    """Share of the median block's light below which a block is left out: noise and flare tell more than exposure there.
    """

    min_block_share: float = 0.5
    """Share of a block that must be seen in both pictures."""

    min_blocks: int = 20
    """Blocks below which exposure counts as unknown: a median of fewer is chance."""

    max_gain: float = 16.0
    """Factor (four stops) beyond which it is no exposure but a different light, and nothing is changed."""


@dataclass(frozen=True)
class OverlapOptions:
    """Where two layers show the same (`overlap`)."""

    opaque_alpha: float = 1 - 1 / 255
    """Alpha from which a pixel counts as opaque: all but the last level of 8 bits."""

    same_tone: float = 0.06
    """Tones by which what is the same may differ from the general difference of the pictures: noise and sharpness."""

    same_sigmas: float = 4.0
    """The same in robust standard deviations of the difference; the larger of the two holds."""

    hidden_margin_px: int = 3
    """px around what the added picture cannot see in which nothing counts as the same: occlusion is known to this much.
    """

    sample_pixels: int = 100_000
    """Pixels that the general difference is measured on: more take time and change nothing."""


@dataclass(frozen=True)
class MovingThingsOptions:
    """Finding what moved between the pictures (`moving_things`)."""

    side_cells: int = 1000
    """Cells along the overlap's longer side in which things are looked for, at most."""

    min_width_cells: int = 4
    """Cells below which something is too narrow to be a thing: misaligned edges are narrower."""

    min_difference: float = 0.15
    """Tones by which a thing differs at least."""

    max_same_difference: float = 0.08
    """Tones below which the pictures agree."""

    surroundings_cells: int = 5
    """Cells around a thing in which the pictures have to agree, and across which parts side by side are joined."""

    joined_rows: int = 25
    """Cells across which parts one above the other are joined: people are upright, and a quarter of one may look like
    what is behind, or like another."""

    min_agreeing: float = 0.7
    """Share of these surroundings that must agree: people walk past one another, too."""

    min_widths_of_parallax: float = 2.0
    """A thing is so many times as wide as the parallax around it: what it hides is at most once as wide."""

    max_area: float = 0.25
    """Share of the overlap beyond which it is no thing but two different scenes."""


@dataclass(frozen=True)
class MinCutOptions:
    """The minimal cut (`min_cut`)."""

    units: int = 10_000
    """Steps from the cheapest to the dearest edge: SciPy's maximum flow takes whole numbers of 32 bits."""


@dataclass(frozen=True)
class BandOptions:
    """Blending in bands (`multiband`; Burt and Adelson, ACM TOG 1983), and feathering as widely."""

    coarsest_width: float = 1 / 50
    """Share of the canvas's diagonal of the coarsest band's width: light is evened out over that."""

    min_bands: int = 3
    """Bands at least: 8 px."""

    max_bands: int = 7
    """Bands at most: 128 px. Wider, a difference of light that is local spreads to where there was none."""

    margin_widths: int = 4
    """Widths of the coarsest band around the seam that are blended: beyond, a pyramid's weights have ended."""

    negligible_tone: float = 1e-5
    """Tones below which a change is dropped, so that what is far from the seam keeps its bits."""

    max_relative_change: float = 0.5
    """Share of its own tone by which blending may change a pixel: brighter neighbours' difference is too much for the
    dark."""

    max_dark_change: float = 0.02
    """Tones by which it may do so in any case."""


@dataclass(frozen=True)
class InpaintOptions:
    """Filling holes (`inpaint`)."""

    reach_px: int = 12
    """px around a hole that it is filled from: enough to lie beyond the rims of what hid it."""

    near_weight: float = 1e-3
    """Weight of what lies nearer than halfway to the thing that hid the hole, beside what lies behind: it decides only
    where nothing lies behind."""

    small_share: float = 1e-3
    """Share of the canvas up to which a closed hole is small: filled, it is hardly seen, and left open it would cut the
    inscribed rectangle in two."""

    plain_share: float = 0.01
    """The same of a hole in plain surroundings, which a smooth continuation matches."""

    plain_tones: float = 0.04
    """By how much tones, 0 to 1, lie off a plane at most in plain surroundings: ten of 255 levels, a soft cloud."""

    plain_percentile: float = 95.0
    """Percentile of these differences that counts."""


@dataclass(frozen=True)
class CropOptions:
    """What of the panorama is kept (`crop`)."""

    least_kept: float = 0.7
    """Share of what is shown that the inscribed rectangle keeps at least to be taken: below, too much would be lost."""

    least_kept_of_many: float = 0.6
    """The same of more than two pictures: with each one the outline has more corners, and a frame in steps is no
    picture."""


@dataclass(frozen=True)
class PlacingOptions:
    """By how much pictures are expected to be misplaced, and what that is worth (`placing`)."""

    samples: int = 10_000
    """Pixels of a picture that the order is decided by: more take time and change nothing."""

    whole_px: int = 1 << 18
    """Pixels up to which all of a part is read, although not all are needed: a line by itself costs about as much as
    ten times its pixels."""

    step_px: int = 8
    """px from one place to the next at which that is worked out for labels: it changes slowly."""

    price: float = 0.3
    """Price of showing what is misplaced by one px more, from corner to corner of the overlap, for each pixel of its
    diagonal. Borders between opposite tones cost 1 a pixel."""

    max_px: float = 4.0
    """px of difference beyond which more costs no more: neither fits."""


@dataclass(frozen=True)
class WindowOptions:
    """The part of the canvas that a picture is added in (`window`)."""

    seam_margin_px: int = 32
    """px around a picture that are looked at in any case: what the seam is held by."""


@dataclass(frozen=True)
class ContradictedOptions:
    """Places that depth says are hidden, and the picture shows are not (`contradicted`)."""

    smooth_tone: float = 0.05
    """Step of tones across the border of such a place below which a picture goes on there: texture has that."""

    least_smooth: float = 0.8
    """Share of the border at which the picture itself goes on, at least."""

    most_smooth_elsewhere: float = 0.4
    """The same of what the others show there beside what the picture shows around it, at most."""

    least_px: int = 4
    """px of border, at least: of less there is no telling."""


EXPOSURE = ExposureOptions()
OVERLAP = OverlapOptions()
MOVING_THINGS = MovingThingsOptions()
MIN_CUT = MinCutOptions()
BANDS = BandOptions()
INPAINT = InpaintOptions()
CROP = CropOptions()
PLACING = PlacingOptions()
WINDOW = WindowOptions()
CONTRADICTED = ContradictedOptions()
