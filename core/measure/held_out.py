"""Held-out errors: how far a field misses matches that it was not fitted to.

Only the field is fitted again, at its own λ; the geometry stays as it is. The errors are in target px and have both
components: along the epipolar line and across it. Matches that the whole fit dropped as outliers take no part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..field.field import Field
from ..raster.arrays import Array
from ..system.errors import DegenerateGeometry
from .metrics import CoverageSamples
from .options import HELD_OUT


@dataclass(frozen=True)
class HeldOut:
    """Errors in target px: RMS and median over all matches, each predicted without its fold; and the RMS of the strip
    nearest to what only the target shows, predicted without the strip. NaN where that means nothing."""

    rms_px: float
    median_px: float
    towards_rms_px: float


def held_out(field: Field, matches: Matches, shown: CoverageSamples, seed: int = 0) -> HeldOut:
    """Holds matches back, fits the field to the others and compares.

    matches: those the field was fitted to, ideal px, `field.fit.inliers_used` among them; shown: where the canvas
    shows the target. Five random folds (Stone 1974); and the fifth of the matches that lie furthest in the
    direction from the middle of the overlap to the middle of what only the target shows, which tells how the field goes
    on beyond its matches. Held-out matches lie in the overlap, where no field fades: its extrapolation is judged as
    it is shown.
    """
    kept = matches.subset(field.fit.inliers_used)
    fold = np.random.default_rng(seed).permutation(len(kept)) % HELD_OUT.folds
    error = np.full(len(kept), np.nan)
    for i in range(HELD_OUT.folds):
        error[fold == i] = _errors(field, kept, fold == i)
    beyond = _furthest(kept.x, shown)
    towards = _errors(field, kept, beyond)
    return HeldOut(_rms(error), float(np.median(error)) if error.size else float("nan"), _rms(towards))


def _errors(field: Field, kept: Matches, out: NDArray[np.bool_]) -> Array:
    """Distances (px) from where the field sends the matches marked by `out` (N,) when fitted to the others."""
    held = kept.subset(out)
    if not len(held):
        return np.empty(0)
    try:
        sent = field.refitted(kept.subset(~out)).predict(held.x)
    except DegenerateGeometry:  # the others are too few, or on a line
        return np.full(len(held), np.nan)
    return np.linalg.norm(sent - held.y, axis=1)


def _furthest(x: Array, shown: CoverageSamples) -> NDArray[np.bool_]:
    """Which points (N, 2) are the fifth furthest towards what only the target shows; none where that is nothing or a
    sliver."""
    furthest = np.zeros(len(x), bool)
    if shown.overlap.any() and np.mean(~shown.overlap) >= HELD_OUT.min_beyond_share:
        direction = shown.points[~shown.overlap].mean(axis=0) - shown.points[shown.overlap].mean(axis=0)
        order = np.argsort(-(x @ direction), kind="stable")
        furthest[order[: round(HELD_OUT.strip_share * len(x))]] = True
    return furthest


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")
