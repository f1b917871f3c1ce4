"""What was chosen in showing a finished stitch: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InspectionOptions:
    """What a window shows of a finished stitch (`inspection`)."""

    longest_side: int = 1600
    """px along the longer side of the pictures that lie over the panorama: as many as a window has."""

    longest_grid: int = 160
    """Nodes along the longer side of the depth grid: a mesh this fine is still edited without delay."""

    colour_range: tuple[float, float] = (1.0, 99.0)
    """Percentiles of the displacement that the two ends of the colour scale stand for: a few gross errors do not
    bleach the rest."""

    min_range_px: float = 1e-6
    """px between the two ends at least, so that nothing is divided by 0."""

    shown: float = 0.5
    """Alpha, or covered share of a reduced pixel, above which something is shown."""

    compared: float = 0.999
    """Share of a reduced pixel that both pictures must cover to be compared: all of it, but for rounding."""


INSPECTION = InspectionOptions()
