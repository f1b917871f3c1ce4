"""What was chosen in matching the light of pictures: each value with its unit, and why it is what it is.

Light is scene-linear, 1 at white. Values without a source were chosen on photographs: around them the result hardly
changes.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ToneOptions:
    """Fitting what two pictures' light differs by, and one exposure for both (`tone_fit`, `toned`)."""

    reference_share: float = 0.35
    """Share of the difference in exposure that the reference goes towards the target: half way looks flat."""

    most_reference_stops: float = 0.7
    """Stops that it goes at most: beyond two stops of difference one of the two is wrong, and it may be the target."""

    worse_exposed: float = 0.1
    """By how much more of what both show has to be clipped in the reference alone than in the target alone, as a share,
    for the panorama to have the target's white balance: what is clipped has none, and the target's light in its place
    would be tinted."""

    max_gain: float = 64.0
    """Factor (six stops) beyond which it is no exposure: of 8 bits hardly anything is left."""

    fitted_blocks: int = 6000
    """Blocks that are fitted on, at most: more take time and change nothing."""

    min_blocks: int = 60
    """Blocks below which gains alone are fitted."""

    tile_blocks: int = 12
    """Blocks of the side of the tiles of a chessboard: what is fitted on the black tiles is tried on the white."""

    rounds: int = 12
    """Rounds of reweighting."""

    robust_log: float = 0.02
    """Differences of log light from which on they count less: noise of 8 bits in the middle tones."""

    prior: float = 0.0003
    """Weight of no vignetting and no curve, beside all blocks: they are as good as unknown where little tells them."""

    min_improvement: float = 0.07
    """Share by which vignetting or a curve must lower what is left of the difference on blocks not fitted on."""

    min_third_improvement: float = 0.05
    """The same, for a curve, in the darkest and in the brightest third alike."""

    most_corner: float = -0.05
    """Logarithm of the light left in the corners above which it is no vignetting."""

    least_corner: float = -1.0
    """The same below which it is none: lenses take off less."""

    max_rise: float = 0.03
    """By how much that logarithm may rise anywhere: vignetting only takes off."""

    max_slope: float = 0.8
    """Slope of a curve in log light against the mean of both pictures, at most: exponents from 0.43 to 2.3."""

    curve_ends: tuple[float, float] = (2.0, 98.0)
    """Percentiles of the blocks' log light between which a curve was seen."""

    knee: float = 0.5
    """Light from which highlights roll off: below, two pictures have to meet."""

    below_white: float = 0.947
    """Light that what is just not clipped comes to at most: level 249 of 255."""

    display_gamma: float = 2.2
    """About that of a display."""

    steepest: float = 2.0
    """How many times as steep tones may become between near white and white."""

    least_near_white: float = 0.35
    """Light from which on white is kept, at least: level 160."""

    most_near_white: float = 0.84
    """The same at most, level 235: so that no edge is seen."""

    pixels_at_once: int = 1 << 14
    """Pixels whose tones are worked out at once: more leave the processor's cache, fewer cost calls."""


@dataclass(frozen=True)
class ClippedOptions:
    """What clipped channels were (`clipped`)."""

    least_share: float = 0.005
    """Share of what both pictures show that is clipped in one alone, from which that is asked."""

    begins: float = 0.88
    """Light from which a channel may be clipped in parts, as where a picture was made smaller: level 241."""

    cells: int = 16
    """Cells of a side of the table."""

    fineness: int = 8
    """Cells of a side into which a cell is divided, so that none is seen."""

    min_pixels: int = 50
    """Clipped pixels of a channel in these bands, below which nothing is learnt."""

    cell_px: int = 64
    """px of a side of the cells of the canvas in which white is learnt."""

    band_rows: int = 8
    """Rows of each cell that are looked at: all of them take eight times as long and tell the same."""

    min_unclipped_share: float = 0.5
    """Share of what is clipped in all channels that the other picture has unclipped, above which it takes that light.
    """

    least_light: float = 1e-3
    """Light that counts as black where logarithms are taken."""

    sure_pixels: float = 20.0
    """Pixels of a cell from which it counts for more than its neighbours."""


@dataclass(frozen=True)
class HighlightOptions:
    """Which clipped light of camera RAW is taken from another picture (`raw_highlights`)."""

    window_px: int = 9
    """px a side of the square around a pixel of which most has to be clipped."""

    least_share: float = 0.5
    """The share of it that has to be."""

    margin_px: int = 5
    """px around it that are left out as well: the other half of the window, and what interpolation mixes."""


TONE = ToneOptions()
CLIPPED = ClippedOptions()
HIGHLIGHTS = HighlightOptions()
