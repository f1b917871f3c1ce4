"""What was chosen in finding seams, and around what a border cuts: each value with its unit, and why it is what it is.

Tones are log-encoded light (see `raster.log_encoding`), about 1 from black to white.
"""

from __future__ import annotations

from dataclasses import dataclass


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

    found_px: float = 500
    """Cells along a picture's longer side, about, in which the seam is found: what the eye takes for a step. A price
    per area against one per length also needs one size."""

    rim_price: float = 0.04
    """Price of a pixel near the overlap's rim, on top: beyond it there is nothing to blend with."""

    rim_width: int = 3
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

    least_px: int = 4
    """px that a tear has at least: fewer are rounding of a coarse map."""

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

    margin_cells: int = 8
    """Cells beyond the overlap in which that is looked for, too: about as far as a refill is judged."""

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
class TornThingsOptions:
    """Things that the map tears (`torn_things`). Shares are of a picture's longer side."""

    jump: float = 6.0
    """Times the median area of the picture that a cell shows: the map jumps there. As in the verdict."""

    least_cells: int = 3
    """Cells of a jump or fold at least: fewer are rounding of a coarse map."""

    near: float = 0.02
    """Share from a tear within which places where the pictures differ are of the same thing."""

    joined: float = 0.01
    """Share across which parts are joined: arms and legs of one person."""

    percentiles: tuple[tuple[float, float], ...] = ((0.0, 100.0), (0.0, 30.0), (70.0, 100.0))
    """Percentiles of inverse depth around a thing that it may take: all of it, the far, or the near part."""

    rounds: int = 2
    """How often what is still torn is looked for: parts grow together."""

    least_step: float = 0.4
    """px of a small picture from one cell to the next, below which it is drawn out. Usual: 1."""

    most_smeared: float = 0.01
    """Share of a part's cells by which more may be drawn out than before."""


SEAM = SeamOptions()
ROUGH_SEAM = RoughSeamOptions()
TEARS = TearOptions()
CUT_THINGS = CutThingsOptions()
TORN_THINGS = TornThingsOptions()
