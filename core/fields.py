"""The displacement fields by name, our own and the rivals."""

from __future__ import annotations

from collections.abc import Callable

from .cameras.matches import Matches
from .cameras.two_view import TwoView
from .field.field import Field
from .field.slack import fit_slack
from .field.strict import fit_strict
from .rivals.apap import fit_apap
from .rivals.homography import fit_one_homography
from .rivals.paper import fit_paper
from .rivals.rew import fit_rew


def fit_field(
    name: str, fade: str, two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int],
    seed: int = 0,
) -> Field:  # fmt: skip
    """Fits a displacement field to the inlier matches of a pair.

    Parameters
    ----------
    name : str
        One of FIELDS.
    fade : str
        What it fades to outside the overlap, one of FADES.
    two_view : TwoView
    matches : Matches
        Inliers, ideal px.
    size, target_size : (W, H)
        px of the reference and of the target.
    seed : int
        Of random choices.

    Returns
    -------
    Field
        Its `two_view` is what its map is built on: the given one, or what a rival knows of it.

    Raises
    ------
    DegenerateGeometry
        The matches determine no such field.
    """
    if name == "homography":
        return fit_one_homography(two_view, matches, seed)
    strict = fit_strict(two_view, matches, size, target_size, fade)
    on_top: dict[str, Callable[[], Field]] = {
        "strict": lambda: strict, "slack": lambda: fit_slack(strict, matches),
        "paper": lambda: fit_paper(strict, matches), "rew": lambda: fit_rew(strict, matches),
        "apap": lambda: fit_apap(strict, matches),
    }  # fmt: skip
    return on_top[name]()
