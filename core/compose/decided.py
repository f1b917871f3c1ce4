"""What is decided about a picture before pixels are mixed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .seams.seam_costs import SeamCosts
    from .tone.exposure import Exposure
    from .window import Window


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
