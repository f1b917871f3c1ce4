"""What the frames of a clip share of what was decided about some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from .decided import Decided
from .seams.seam import find_seam
from .seams.seam_costs import averaged_costs
from .tone.exposure import pooled
from .wraparound import rolled


def pooled_decision(decisions: Sequence[Sequence[Decided]]) -> tuple[Decided, ...]:
    """One decision about each picture for several frames of the same cameras.

    Parameters
    ----------
    decisions : sequence of sequences of Decided
        Of each frame, about each picture, made with `keep`.

    Returns
    -------
    tuple of Decided
        The median of the exposures, and the seam that is cheapest on average over the frames.
    """
    return tuple(_pooled(about_one) for about_one in zip(*decisions, strict=True))


def _pooled(decisions: Sequence[Decided]) -> Decided:
    """The same about one picture, by the frames that overlap in the same box."""
    first = replace(decisions[0], exposure=pooled([one.exposure for one in decisions]))
    if first.known is None or first.costs is None:
        return first
    alike = [
        one.costs for one in decisions
        if one.costs is not None
        and (one.costs.box, one.roll, one.window) == (first.costs.box, first.roll, first.window)
    ]  # fmt: skip
    costs = averaged_costs(alike)
    chosen = rolled(find_seam(first.known, costs), -first.roll)
    chosen = chosen if first.window is None else first.window.closed(chosen)
    return replace(first, costs=costs, chosen=chosen)
