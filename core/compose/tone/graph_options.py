"""What was chosen in composing more than two pictures: each value with its unit, and why it is what it is."""

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

    blocks_of_overlap: int = 1500
    """Blocks of an overlap that vignetting is fitted on, at most."""

    min_blocks: int = 400
    """Blocks of all overlaps below which no vignetting is fitted: one pair of pictures could not tell it from light."""


@dataclass(frozen=True)
class PlacingOptions:
    """By how much pictures are expected to be misplaced, and what that is worth (`placing`)."""

    samples: int = 10_000
    """Pixels of a picture that the order is decided by: more take time and change nothing."""

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


GRAPH_EXPOSURE = GraphExposureOptions()
PLACING = PlacingOptions()
WINDOW = WindowOptions()
