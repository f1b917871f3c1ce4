"""What is shown where the geometry is too wrong for dense depth, or the picture is torn by how the viewpoint slides:
something simpler, which less can go wrong in."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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


def least_torn(first: StitchResult, others: Iterable[Callable[[], StitchResult]]) -> StitchResult:
    """The stitch by the slide that costs least, or where that is torn another that costs about as much and leaves much
    less to look at: the choice among them sees a coarse map only.

    Parameters
    ----------
    first : StitchResult
    others : iterable of callables
        Each makes one. They are made until there is nothing to look at.

    Returns
    -------
    StitchResult
        Its seconds are those of all that were made.
    """
    if not any(place["what"] == TORN for place in first.report["verdict"]["places"]):
        return first
    best, made = first, [first]
    for make in others:
        made.append(make())
        less = _px_to_look_at(made[-1]) <= VERDICT.much_less * _px_to_look_at(best)
        # what a crop leaves out is not mended
        if less and _is_usable(made[-1]) and _px_kept(made[-1]) >= VERDICT.least_kept * _px_kept(first):
            best = made[-1]
        if not _px_to_look_at(best):
            break
    stages = {stage: None for one in made for stage in one.seconds}
    return replace(best, seconds={stage: sum(one.seconds.get(stage, 0.0) for one in made) for stage in stages})


def _px_to_look_at(result: StitchResult) -> int:
    """px of the places to look at."""
    return sum(place["box"][2] * place["box"][3] for place in result.report["verdict"]["places"])


def _px_kept(result: StitchResult) -> int:
    """px of the panorama as it is cropped."""
    return result.canvas.width * result.canvas.height


def _is_usable(result: StitchResult) -> bool:
    return bool(result.report["verdict"]["is"] != NOT_USABLE)
