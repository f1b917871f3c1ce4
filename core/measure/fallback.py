"""What is shown where the geometry is too wrong for dense depth, or the picture is torn by how the viewpoint slides:
something simpler, which less can go wrong in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..system.errors import Cancelled, StitchError
from .options import VERDICT
from .verdict import NOT_USABLE, TORN

if TYPE_CHECKING:
    from ..options import StitchOptions
    from ..pipeline import StitchResult

SIMPLER: dict[str, dict[str, Any]] = {
    "the smooth field alone, without dense depth": {"dense": False},
    "one homography with a seam": {"dense": False, "field": "homography"},
}


def first_usable(made: Callable[[StitchOptions], StitchResult], options: StitchOptions) -> StitchResult:
    """The stitch by these options, or a simpler one where that is not usable and the simpler one is.

    Parameters
    ----------
    made : callable
        Stitches by options.
    options : StitchOptions
        Those without dense depth are simple already.

    Returns
    -------
    StitchResult
        A simpler one says so, and its report holds that of the first (`fallback`).
    """
    first = made(options)
    if _is_usable(first) or not options.dense:
        return first
    because = first.report["verdict"]["because"]
    for how, changes in SIMPLER.items():
        try:
            other = made(replace(options, **changes))
        except Cancelled:
            raise
        except StitchError:  # there is none by these options
            continue
        if _is_usable(other):
            told = f"fell back to {how}, since with dense depth the panorama is not usable: {because}"
            warnings = (told, *other.warnings)
            fallback = {"to": how, "because": because, "instead_of": first.report}
            report = {**other.report, "warnings": list(warnings), "fallback": fallback}
            return replace(other, warnings=warnings, report=report)
    return first


def least_torn(first: StitchResult, all_the_way: Callable[[], StitchResult]) -> StitchResult:
    """The stitch whose viewpoint slides within a part of the overlap, or the one in which it slides all the way where
    that leaves much less torn: the choice among them looks at a coarse map only.

    Parameters
    ----------
    first : StitchResult
    all_the_way : callable
        Makes the other.
    """
    torn = _torn_px(first)
    if not torn:
        return first
    other = all_the_way()
    if not _is_usable(other) or _torn_px(other) > VERDICT.much_less_torn * torn:
        return first
    took = first.seconds, other.seconds
    return replace(other, seconds={stage: sum(one.get(stage, 0.0) for one in took) for stage in {**took[0], **took[1]}})


def _torn_px(result: StitchResult) -> int:
    """px of the places where the panorama is torn."""
    places = result.report["verdict"]["places"]
    return sum(place["box"][2] * place["box"][3] for place in places if place["what"] == TORN)


def _is_usable(result: StitchResult) -> bool:
    return bool(result.report["verdict"]["is"] != NOT_USABLE)
