"""Whether posts and other thin things look like themselves in a panorama and stand straight."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.measure.metrics import ssim
from ...core.raster.arrays import Array, dilated
from .set_measures import Found, percentile
from .set_things import REACH_PX, SMALLEST_PX, shown_things

# px of the sphere across which a circle fits into no thing that is thin: five degrees.
THIN_PX = 21
# px of the sphere beside a thin thing that are judged with it, and half the side of the windows of SSIM.
BESIDE_PX, WINDOW_PX = 8, 5
# Rows over which a post's middle is averaged, for its outlines are whole pixels, and how many it must be seen on.
ROWS, FEWEST_ROWS = 9, 40
# Share of a post's rows that may be bent by more than what is said.
WORST_SHARE = 95.0


def thin_figures(found: Found, exposed: NDArray[np.uint8], where: NDArray[np.bool_]) -> dict[str, float]:
    """thin_ssim: SSIM of a panorama as the true sphere lies (H, W, 3), exposed like it, within BESIDE_PX of thin
    things, where (H, W) it shows what is seen; thin_bend_px, thin_bend_worst_px: how far the middles of those that
    stand upright are off the straight line that fits best, beside the true ones' middles, px of the sphere, on all but
    the worst twentieth of their rows (median and worst of the posts)."""
    things = found.truth.rendered.things
    if not things:
        return {}
    true, shown = np.where(where, things[-1], 0), np.where(where, shown_things(found), 0)
    numbers, areas = np.unique(true[true > 0], return_counts=True)
    thin = [number for number in numbers[areas >= SMALLEST_PX] if is_thin(true == number)]
    near = dilated(np.isin(true, thin), BESIDE_PX + WINDOW_PX) & where
    bends = [bend_px(shown == number, true == number) for number in thin]
    known = np.array([bend for bend in bends if not math.isnan(bend)])
    return {
        "thin_ssim": ssim(exposed, found.truth.picture, near) if thin else math.nan,
        "thin_bend_px": percentile(known, 50), "thin_bend_worst_px": percentile(known, 100),
    }  # fmt: skip


def is_thin(mask: NDArray[np.bool_]) -> bool:
    """Whether no circle of THIN_PX fits into a mask (H, W)."""
    circle = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (THIN_PX, THIN_PX))
    return not cv2.erode(mask.astype(np.uint8), circle, borderValue=0).any()


def bend_px(shown: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """How far an upright thing is bent (see `thin_figures`), of where (H, W) it is shown and where it truly is; NaN if
    it does not stand upright, or is seen on too few rows."""
    near = shown & dilated(true, REACH_PX)
    rows = np.flatnonzero(_once(true) & near.any(axis=1))
    if len(rows) < FEWEST_ROWS:
        return math.nan
    off = _middles(near)[rows] - _middles(true)[rows]
    smooth = np.convolve(off, np.ones(ROWS) / ROWS, mode="valid")
    along = rows[ROWS // 2 : len(rows) - ROWS // 2].astype(np.float64)
    line = np.polynomial.Polynomial.fit(along, smooth, 1)
    return percentile(np.abs(smooth - line(along)), WORST_SHARE)


def _once(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows (H,) in which a mask (H, W) is one run of pixels, no longer than a thin thing is wide."""
    steps = np.diff(mask.astype(np.int8), axis=1, prepend=0, append=0)
    once: NDArray[np.bool_] = ((steps == 1).sum(axis=1) == 1) & (mask.sum(axis=1) <= THIN_PX)
    return once


def _middles(mask: NDArray[np.bool_]) -> Array:
    """The mean column of each row (H,) of a mask (H, W), 0 of none."""
    count = mask.sum(axis=1)
    middles: Array = (mask * np.arange(mask.shape[1])).sum(axis=1) / np.maximum(count, 1)
    return middles
