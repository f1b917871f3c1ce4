"""What is decided about a picture before pixels are mixed, and what the frames of a clip share of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .exposure import Exposure, pooled
from .seam import find_seam
from .seam_costs import SeamCosts, averaged_costs
from .window import Window
from .wraparound import rolled


@dataclass(frozen=True)
class Decided:
    """What was decided about one picture; the frames of a clip share it.

    Attributes
    ----------
    hidden : (H, W) bool array
        What the picture cannot see, or would show mirrored.
    hidden_by_depth : (H, W) bool array
        The part of it that the depth order alone tells, which the seam avoids: with all of it, foliage would leave the
        seam no way through. `hidden` itself if not kept.
    exposure : Exposure
    chosen : (h, w) bool array or None
        What comes from this picture and not from those before, in the window; None without a seam.
    window : Window or None
        Where it was added; None for the first.
    known, costs : (h, w) int8 array and SeamCosts, or None
        What the seam was cut by (see `find_seam`), if it was and is kept.
    roll : int
        Columns by which these are rolled in the window (see `wraparound`).
    holes : int
        Pixels that the picture cannot see and none before it shows. They are transparent or filled.
    folds : float
        Share of the picture's map that is folded, away from what is hidden (see `folding.folds`).
    """

    hidden: NDArray[np.bool_]
    hidden_by_depth: NDArray[np.bool_]
    exposure: Exposure
    chosen: NDArray[np.bool_] | None = None
    window: Window | None = None
    known: NDArray[np.int8] | None = None
    costs: SeamCosts | None = None
    roll: int = 0
    holes: int = 0
    folds: float = 0.0


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
    return replace(first, costs=costs, chosen=chosen)
