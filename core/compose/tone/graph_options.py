"""What was chosen in matching the light of many pictures: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GraphExposureOptions:
    """Exposure over the graph of all overlaps (`graph_exposure`, `graph_vignetting`)."""

    min_block_share: float = 0.9
    """Share of a block that a picture must show unclipped. Pictures are measured one by one, so that two of them may
    count different parts of a block: nearly all of it, and that makes no difference."""

    least_spread: float = 0.02
    """Spread of log ratios that an overlap has at least: as good as 8 bits can tell in the middle tones."""

    max_gain: float = 64.0
    """Factor (six stops) between two pictures beyond which it is no exposure: of 8 bits hardly anything is left."""

    outlier_logs: tuple[float, ...] = (2.0, 1.0, 0.5, 0.25)
    """Logarithms of light, round after round, from which on an overlap that contradicts the others counts less: what it
    shows is not the same thing twice. The last is more than a ring of overlaps fails to close by."""

    worse_exposed: float = 0.1
    """Share of what a picture and others show that is clipped in it alone from which on its exposure and white balance
    count for nothing: the light that only the others tell would be blown, or tinted."""

    middle: float = 0.1
    """Share of the pictures, by what they count, whose mean is their median: of nine or fewer that count alike it is
    the middle one."""

    blocks_of_overlap: int = 1500
    """Blocks of an overlap that vignetting is fitted on, at most."""

    min_blocks: int = 400
    """Blocks of all overlaps below which no vignetting is fitted: one pair of pictures could not tell it from light."""


GRAPH_EXPOSURE = GraphExposureOptions()
