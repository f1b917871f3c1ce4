"""Where a map turns over (docs/method.md, 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import dilated
from ..raster.picture_map import PictureMap
from ..system.threads import each
from .options import FOLDING

# In place of -1, 0 or 1: see `turning`.
NO_TURN = 2


def folds(turns: NDArray[np.int8], hidden: NDArray[np.bool_] | None = None) -> float:
    """How much of a map is folded.

    Parameters
    ----------
    turns : (H, W) int8 array
        See `turning`.
    hidden : (H, W) bool array, optional
        What the picture cannot see. Neither that nor its rim counts: one thing ends in front of another there.

    Returns
    -------
    float
        Share of the pixels that show the picture where the sign of the map's Jacobian is not the usual one.
    """
    counts = turns != NO_TURN
    if hidden is not None:
        counts &= ~dilated(hidden, FOLDING.hidden_margin_px)
    back, flat, on = (int(np.count_nonzero(counts & (turns == way))) for way in (-1, 0, 1))
    total = back + flat + on
    # the median of the signs is the usual one
    usual = back if 2 * back >= total else on if 2 * on >= total else flat
    return (total - usual) / total if total else 0.0


def turning(picture_map: PictureMap) -> NDArray[np.int8]:
    """The sign (H, W) of a map's Jacobian: 1 upright, −1 mirrored, 0 flattened.

    NO_TURN where the map does not show its picture, or nothing is known to the right or below.
    """
    height, width = picture_map.shape
    out = np.full((height, width), NO_TURN, np.int8)
    rows = max(1, FOLDING.strip_pixels // width)

    def put(top: int) -> None:
        bottom = min(top + rows, height - 1)
        strip = picture_map.within((0, top, width, bottom + 1 - top))
        with np.errstate(invalid="ignore", over="ignore"):
            area = cell_areas(strip.x, strip.y)
            counts = strip.inside()[:-1, :-1] & np.isfinite(area)
            out[top:bottom, :-1] = np.where(counts, np.sign(area), NO_TURN)

    each(put, range(0, height - 1, rows))
    return out


def turned_over(turns: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Where (H, W) a map would show its picture mirrored, which no visible surface does; turns (H, W): see `turning`.

    A map does so where it jumps back from the rim of a near thing and too little is known of what the rim hides.
    """
    mirrored: NDArray[np.bool_] = turns == -1
    # of a mirrored picture, what is not mirrored stands out
    if 2 * int(mirrored.sum()) <= int((turns != NO_TURN).sum()):
        return mirrored
    unmirrored: NDArray[np.bool_] = turns == 1
    return unmirrored


def breaks(picture_map: PictureMap, shown: NDArray[np.bool_], jump: float) -> NDArray[np.bool_]:
    """Where (H, W) a map, as far as it is shown (H, W), is turned over, or jumps: a pixel takes up more than `jump`
    times the area of the picture that the median pixel does."""
    turns = turning(picture_map)
    counts: NDArray[np.bool_] = shown & (turns != NO_TURN)
    if not counts.any():
        return counts
    areas = np.zeros(shown.shape, np.float32)
    areas[:-1, :-1] = np.abs(cell_areas(picture_map.x, picture_map.y))
    found: NDArray[np.bool_] = (counts & (areas > jump * np.median(areas[counts]))) | (turned_over(turns) & shown)
    return found


def jacobian(x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Area (H, W) that a map's (x, y) takes up for each of its pixels, by central differences; its sign changes where
    the map turns over. NaN beside what is not finite."""
    area: NDArray[Any] = np.gradient(x, axis=1) * np.gradient(y, axis=0)
    area -= np.gradient(x, axis=0) * np.gradient(y, axis=1)
    return area


def cell_areas(x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """Signed area (H − 1, W − 1) that a map (x, y) (H, W) spans between each pixel and its right and lower neighbours;
    its sign changes where the map turns over. NaN beside what is not finite."""
    area: NDArray[Any] = (x[:-1, 1:] - x[:-1, :-1]) * (y[1:, :-1] - y[:-1, :-1])
    area -= (x[1:, :-1] - x[:-1, :-1]) * (y[:-1, 1:] - y[:-1, :-1])
    return area
