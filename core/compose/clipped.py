"""What a picture's clipped channels were, learnt from what the other picture shows in their place.

A sky that clips in blue alone turns green once its exposure is matched: blue stays at the most that the sensor told.
Where both pictures show it, the other tells by how much more there was. That is kept in a table over the colour in the
two channels that are not clipped, and so it is known for sky that the other picture does not show, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, bounds
from ..raster.lazy import AnyImage
from ..raster.pull_push import filled
from .options import CLIPPED, EXPOSURE


@dataclass(frozen=True)
class ClippedColours:
    """By how much more light than was told there is in a channel that is clipped.

    Attributes
    ----------
    factors : tuple of (n, n) float32 array or None
        For each channel, from 1 up, by the square roots of the next channel's and the one after that's own light; None
        where too little is known.
    """

    factors: tuple[NDArray[np.float32] | None, ...]

    def restore(self, own: NDArray[np.float32], light: NDArray[np.float32]) -> None:
        """Raise the channels of light (h, w, C) that are clipped in a picture's own light (h, w, C), in place."""
        if own.max(initial=0) <= CLIPPED.begins:
            return
        owns, lights = own.reshape(-1, own.shape[2]), light.reshape(-1, own.shape[2])
        for k, factors in enumerate(self.factors):
            if factors is None:
                continue
            clipped = np.flatnonzero(owns[:, k] > CLIPPED.begins)
            if not clipped.size:
                continue
            colours, told = owns[clipped], lights[clipped, k]
            weight = colours[:, k] - np.float32(CLIPPED.begins)
            weight *= np.float32(1 / (EXPOSURE.clipped_light - CLIPPED.begins))
            np.minimum(weight, 1, out=weight)
            weight *= weight * (3 - 2 * weight)
            raised = told * factors.reshape(-1)[_cells(colours, k, len(factors))]
            np.minimum(raised, np.float32(CLIPPED.most), out=raised)
            lights[clipped, k] = told + weight * np.maximum(raised - told, 0)


def clipped_colours(
    own: AnyImage, light: AnyImage, other: AnyImage, shown: NDArray[np.bool_]
) -> ClippedColours | None:
    """Learn what clipped channels were.

    Parameters
    ----------
    own : (H, W, 3) image
        A picture's own light.
    light : (H, W, 3) image
        The same with its exposure matched to the other's.
    other : (H, W, 3) image
        What the other picture shows there, with its exposure matched.
    shown : (H, W) bool array
        Where both show the same.

    Returns
    -------
    ClippedColours or None
        None where nothing is known.
    """
    box, channels = bounds(shown), own.shape[2]
    if box is None or channels != 3:
        return None
    size = CLIPPED.cells
    sums, counts = np.zeros((2, channels, size * size))
    rows, columns = box
    for top in range(rows.start, rows.stop, CLIPPED.bands_apart):
        part = slice(top, min(rows.stop, top + CLIPPED.band_rows)), columns
        before, after, told, both = own[part], light[part], other[part], shown[part]
        for k in range(channels):
            clipped = both & (before[..., k] >= EXPOSURE.clipped_light)
            cells = _cells(before[clipped], k, size)
            ratio = np.log(np.maximum(told[..., k][clipped], CLIPPED.least_light) / after[..., k][clipped])
            sums[k] += np.bincount(cells, ratio, size * size)
            counts[k] += np.bincount(cells, minlength=size * size)
    factors = tuple(_factors(*one) for one in zip(sums, counts, strict=True))
    return ClippedColours(factors) if any(one is not None for one in factors) else None


def _cells(colours: NDArray[np.float32], channel: int, size: int) -> NDArray[np.intp]:
    """Cells (N,) of a channel's table of `size` a side, row by row, for colours (N, 3)."""
    row, column = (
        np.minimum(np.sqrt(np.maximum(colours[:, (channel + k) % 3], 0)) * size, size - 1).astype(np.intp)
        for k in (1, 2)
    )
    cells: NDArray[np.intp] = row * size + column
    return cells


def _factors(sums: Array, counts: Array) -> NDArray[np.float32] | None:
    """A fine table of factors (m, m) by the sums of logarithms (n²,) and counts in a coarse one; None with too few."""
    if counts.sum() < CLIPPED.min_pixels:
        return None
    sums, counts = (one.reshape(CLIPPED.cells, CLIPPED.cells) for one in (sums, counts))
    means, known = sums / np.maximum(counts, 1), counts / (counts + CLIPPED.sure_pixels)
    logs = filled(means.astype(np.float32)[..., None], known.astype(np.float32))[..., 0]
    fine = cv2.resize(logs, None, fx=CLIPPED.fineness, fy=CLIPPED.fineness, interpolation=cv2.INTER_LINEAR)
    factors: NDArray[np.float32] = np.exp(np.maximum(fine, 0))
    return factors
