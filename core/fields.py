"""The displacement fields by name."""

from __future__ import annotations

from .displacement import Field, fit_strict
from .features import Matches
from .paper import fit_paper
from .slack import fit_slack
from .two_view import TwoView

FIELDS = ("slack", "strict", "paper")


def fit_field(
    name: str, fade: str, two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int]
) -> Field:
    """The field called `name` (one of FIELDS), fitted to inlier matches; sizes (W, H) px; fade: `plane` or `infinity`.

    Raises DegenerateGeometry.
    """
    strict = fit_strict(two_view, matches, size, target_size, fade)
    if name == "strict":
        return strict
    return fit_slack(strict, matches) if name == "slack" else fit_paper(strict, matches)
