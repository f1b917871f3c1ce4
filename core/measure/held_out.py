"""Held-out errors: how far a field misses matches that it was not fitted to.

Only the field is fitted again, with its own λ; the geometry stays. Errors are distances in target px, along and across
the epipolar lines. Matches that the fit to all of them dropped as outliers take no part.
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
    """Errors in target px; NaN where undefined.

    rms_px, median_px: over all matches, each predicted without its fold; towards_rms_px: RMS over the strip of matches
    nearest to what only the target shows, predicted without the strip.
    """

    rms_px: float
    median_px: float
    towards_rms_px: float


def held_out(field: Field, matches: Matches, shown: CoverageSamples, seed: int = 0) -> HeldOut:
    """Withholds matches, fits the field to the others and compares.

    Matches are withheld in random folds (Stone 1974); and, to judge extrapolation, the strip of matches that lies
    furthest in the direction from the middle of the overlap to the middle of what only the target shows. All withheld
    matches lie in the overlap, where no field fades.

    Parameters
    ----------
    field : Field
    matches : Matches
        The matches that the field was given, ideal px.
    shown : CoverageSamples
        Where the canvas shows the target.
    seed : int
        Of the folds.

    Returns
    -------
    HeldOut
    """
    used = matches.subset(field.fit.inliers_used)
    fold = np.random.default_rng(seed).permutation(len(used)) % HELD_OUT.folds
    error = np.full(len(used), np.nan)
    for i in range(HELD_OUT.folds):
        error[fold == i] = _errors(field, used, fold == i)
    strip = _furthest(used.x, shown)
    towards = _errors(field, used, strip)
    return HeldOut(_rms(error), float(np.median(error)) if error.size else float("nan"), _rms(towards))


def _errors(field: Field, used: Matches, out: NDArray[np.bool_]) -> Array:
    """Errors (n,) px at the matches that the mask `out` (N,) withholds, of the field fitted to the others."""
    withheld = used.subset(out)
    if not len(withheld):
        return np.empty(0)
    try:
        predicted = field.refitted(used.subset(~out)).predict(withheld.x)
    except DegenerateGeometry:  # the others are too few, or on a line
        return np.full(len(withheld), np.nan)
    return np.asarray(np.linalg.norm(predicted - withheld.y, axis=1))


def _furthest(x: Array, shown: CoverageSamples) -> NDArray[np.bool_]:
    """Mask (N,) of the points (N, 2) px furthest towards what only the target shows; empty where that is next to
    nothing."""
    furthest = np.zeros(len(x), bool)
    if shown.overlap.any() and np.mean(~shown.overlap) >= HELD_OUT.min_beyond_share:
        direction = shown.points[~shown.overlap].mean(axis=0) - shown.points[shown.overlap].mean(axis=0)
        order = np.argsort(-(x @ direction), kind="stable")
        furthest[order[: round(HELD_OUT.strip_share * len(x))]] = True
    return furthest


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2))) if error.size else float("nan")
