"""What was chosen for comparisons."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ComparisonOptions:
    """The page of a comparison and its pictures."""

    max_side_px: int = 1600
    """px of the longer side of the page's pictures at most; differences are taken before they are shrunk."""

    panorama_side_px: int = 8000
    """px of the longer side of its panoramas at most, which a loupe shows at 1:1: JPEG ends at 65535, and browsers
    decode them whole."""

    jpeg_quality: int = 88
    """Quality of the page's pictures, of 100."""

    difference_gain: int = 4
    """Factor by which differences are shown stronger than they are: a few levels would not be seen."""

    features: int = 4000
    """Features of a picture, at most, by which its epipolar lines with the others are found for measuring alone."""

    max_fields: int = 12
    """Fields that one page shows at most: each needs a rule of its own to be chosen without a script."""


COMPARISON = ComparisonOptions()
