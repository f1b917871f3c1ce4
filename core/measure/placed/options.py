"""What was chosen for figures of placed pictures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlacedOptions:
    """Figures that are taken alike from the results of all programs."""

    px_per_radian: float = 900.0
    """px per radian in the middle of the panorama at which programs are compared: finer results are shrunk to it, for
    alignment is harder to keep in a larger picture."""

    least_share: float = 0.03
    """Share of the smaller of two pictures that both must show for them to be compared: less is mostly rim."""

    least_pixels: int = 500
    """px of an overlap below which it is not compared."""

    margin_px: int = 2
    """px left out along the border of an overlap, where interpolation mixes in what lies beyond."""

    line_length: float = 0.06
    """Share of the picture's longer side from which a straight line is judged: bends of shorter ones are not seen."""

    line_step_px: float = 3.0
    """px of the picture between the points at which a line is looked up."""

    line_shown: float = 0.8
    """Share of a line's points that the panorama must show for the line to be judged."""

    line_points: int = 8
    """Points below which a line is not judged."""

    least_lines: int = 5
    """Lines below which nothing is said of them: a percentile of fewer is one line's."""

    off_line_samples: int = 2000
    """Places of an overlap, evenly spread, that are held against the epipolar lines."""

    inner_margin_px: int = 4
    """px left out along the border of what one picture alone shows, where its map's derivative is not known."""


PLACED = PlacedOptions()
