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
    """Cells around a thing in which the pictures have to agree, and across which its parts are joined."""

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
class SeamOptions:
    """Where the seam runs (`seam`). Prices are in units of a border between opposite tones, a pixel long."""

    coarse_cells: int = 12_000
    """Free cells of the coarsest cut at most: a cut takes time with their number to the power of 1.5."""

    band_pixels: int = 80_000
    """Free pixels of the band in which a finer cut is looked for, at most; a longer seam stays as the coarser found it.
    """

    band_half_width_px: int = 3
    """px of a level to either side of the coarser seam that the band takes in: a cell of the coarser level, and half.
    """

    surrounded_share: float = 0.1
    """Share of the panorama so far that the added picture must leave alone, or it is taken for surrounded: the cheapest
    seam would leave nothing of it."""

    kept_depth: float = 0.2
    """If surrounded, pixels deeper than this share of the largest distance to its border are kept."""

    length_price: float = 0.004
    """Price of a pixel of seam for its length alone: low, since a longer way where nobody sees it is worth it."""

    added_price: float = 0.1
    """Price of showing the added picture from corner to corner of the overlap, for each pixel of its diagonal: the
    reference is exact, the others are resampled by uncertain maps. Dearer, and the seam keeps to the border."""

    found_px: float = 450
    """Cells along a picture's longer side, about, in which the seam is found: what the eye takes for a step. A price
    per area against one per length also needs one size."""

    rim_price: float = 0.01
    """Price of a pixel near the overlap's rim, on top: beyond it there is nothing to blend with."""

    rim_width: int = 2
    """Pixels, or cells, that count as near."""

    hidden_price: float = 0.4
    """Price of a cell of what the added picture cannot see, or of what moved: what is thin costs more to go around than
    to show. A quarter melted the steps of a stair."""

    least_hidden_price: float = 0.01
    """The same where the tones are alike."""

    behind_price: float = 0.25
    """Price of a cell of what the panorama before cannot see, likewise: lower, as its own place is only filled in."""

    least_behind_price: float = 0.005
    """The same where the tones are alike."""


@dataclass(frozen=True)
class RoughSeamOptions:
    """What a seam would cut through, in small pictures (`rough_seam`)."""

    visible_tone: float = 0.1
    """Tones by which the pictures differ at a seam that is seen: blending evens out less."""

    hidden_by_contrast: float = 2.0
    """Times the contrast around a seam, of the picture that has less of it, by which they may differ more: a seam is
    lost in foliage and gravel."""


@dataclass(frozen=True)
class TearOptions:
    """Where a small picture is torn within itself (`tears`)."""

    jump_px: float = 2.0
    """px from one pixel to the next by which a map jumps: twice the usual."""

    visible_tone: float = 0.1
    """Tones by which what comes after a jump differs from what the picture shows there, on either side of it."""

    contrast_px: int = 7
    """px, side of the square in which contrast is looked at."""

    aside_px: float = 4.0
    """px from a jump, on either side, at which it is."""

    hidden_by_contrast: float = 2.0
    """Times the contrast, of the side that has less of it, by which the tones may differ more."""


@dataclass(frozen=True)
class CutThingsOptions:
    """Things that a picture's border cuts (`cut_things`). Shares are of a picture's longer side."""

    min_difference: float = 0.1
    """Tones by which the pictures differ in such a thing: the one shows it, the other what is behind."""

    joined: float = 0.004
    """Share across which parts are joined: leaves of one branch."""

    min_cells: int = 8
    """Cells below which something is too small to be seen."""

    near: float = 0.02
    """Share from the border within which such a thing begins."""

    deepest: tuple[float, ...] = (0.25, 0.08)
    """Shares of the overlap's shorter side beyond which nothing is refilled, one tried after the other: what is further
    from the border is no longer cut by it, and what hangs together there may be more than one thing."""

    grown: float = 0.01
    """Share by which a thing is taken to be larger than it looks."""

    ring: float = 0.03
    """Share around it in which its background is looked for."""

    least_ring: int = 15
    """Cells of background at least."""

    far_percentile: float = 30.0
    """Percentile of inverse depth around it up to which, and a cell of parallax more, something counts as background.
    """

    near_weight: float = 1e-3
    """Weight of all else around it: it decides only where nothing counts as background."""

    zone: float = 0.006
    """Share around a refilled part in which it is judged."""

    window: float = 0.025
    """Share of the side of the window in which the worst place of a seam is looked for."""

    jump_cells: float = 2.0
    """Cells from one to the next by which a map jumps where a picture is cut within itself: twice the usual."""

    much_less: float = 0.6
    """Share of what was seen of a seam that may be left."""

    least_gain: float = 1.0
    """What is to be gained at least: a cell of seam between black and white."""

    gain_per_cell: float = 0.001
    """And more for each cell that is refilled: in all of it both pictures are shown with a depth that was not found."""

    hardly_seen: float = 0.12
    """Tones, over a window, below which the worst place is hardly seen."""

    less_at_worst: float = 0.8
    """Or the share of the worst place before."""


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


@dataclass(frozen=True)
class CropOptions:
    """What of the panorama is kept (`crop`)."""

    least_kept: float = 0.7
    """Share of what is shown that the inscribed rectangle keeps at least to be taken: below, too much would be lost."""


EXPOSURE = ExposureOptions()
OVERLAP = OverlapOptions()
MOVING_THINGS = MovingThingsOptions()
MIN_CUT = MinCutOptions()
SEAM = SeamOptions()
ROUGH_SEAM = RoughSeamOptions()
TEARS = TearOptions()
CUT_THINGS = CutThingsOptions()
BANDS = BandOptions()
INPAINT = InpaintOptions()
CROP = CropOptions()
