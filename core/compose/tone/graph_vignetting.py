"""The vignetting of lenses, fitted on all overlaps of a set of pictures at once.

    ln L_i − ln L_j = V_a(r_i) − V_b(r_j) + g_j − g_i

per block, of the mean of all channels: V_a, V_b of the lenses that pictures i and j were taken with, g of each picture.
Robust least squares, by reweighting; kept only if it earns it on blocks that it was not fitted on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from .graph_options import GRAPH_EXPOSURE
from .picture_blocks import SharedBlocks
from .tone_blocks import log_ratios, weighted_median
from .tone_fit import is_lens
from .tone_options import TONE
from .toned import NO_VIGNETTING, Vignetting


@dataclass(frozen=True)
class _Rows:
    """One row for each block (M): the difference of log light, weights, tiles black or white, and columns (M, K) of
    gains and then of r² and r⁴ of each lens."""

    values: Array
    weights: Array
    black: NDArray[np.bool_]
    gains: Array
    lenses: Array

    def fitted(self, chosen: NDArray[np.bool_], with_lenses: bool) -> Array:
        """The solution on the chosen rows; 0 for lenses that are left out."""
        columns = np.hstack([self.gains, self.lenses]) if with_lenses else self.gains
        columns, values, weights = columns[chosen], self.values[chosen], self.weights[chosen]
        prior = np.diag([1e-9] * self.gains.shape[1] + [TONE.prior] * (columns.shape[1] - self.gains.shape[1]))
        prior *= weights.sum()
        now, found = weights, np.zeros(columns.shape[1])
        for _ in range(TONE.rounds):
            found = np.linalg.solve(columns.T @ (columns * now[:, None]) + prior, columns.T @ (now * values))
            now = weights * TONE.robust_log / np.maximum(np.abs(values - columns @ found), TONE.robust_log)
        return np.pad(found, (0, self.gains.shape[1] + self.lenses.shape[1] - len(found)))

    def held_out(self, with_lenses: bool) -> float:
        """What is left of the difference on blocks not fitted on."""
        left = np.zeros(len(self.values))
        everything = np.hstack([self.gains, self.lenses])
        for here in (self.black, ~self.black):
            left[here] = np.abs(self.values[here] - everything[here] @ self.fitted(~here, with_lenses))
        return weighted_median(left, self.weights)


def fit_vignetting(overlaps: Sequence[SharedBlocks], lenses: Sequence[int | None]) -> tuple[Vignetting, ...]:
    """Fit the vignetting of each picture's lens.

    Parameters
    ----------
    overlaps : sequence of SharedBlocks
    lenses : sequence of (int or None)
        For each picture the number of its lens; None where none took off light.

    Returns
    -------
    tuple of Vignetting
        Of each picture: none where it does not lower what is left, or where no lens takes off light like this.
    """
    nothing = (NO_VIGNETTING,) * len(lenses)
    rows = _rows(overlaps, lenses)
    if rows is None or rows.black.all() or not rows.black.any():
        return nothing
    if rows.held_out(True) >= (1 - TONE.min_improvement) * rows.held_out(False):
        return nothing
    found = rows.fitted(np.ones(len(rows.values), bool), True)[len(lenses) :].reshape(-1, 2)
    fitted = [Vignetting(float(a / 2 + b / 4), float(a + b)) for a, b in found]
    if not all(is_lens(one) for number, one in enumerate(fitted) if number in lenses):
        return nothing
    return tuple(NO_VIGNETTING if lens is None else fitted[lens] for lens in lenses)


def _rows(overlaps: Sequence[SharedBlocks], lenses: Sequence[int | None]) -> _Rows | None:
    """The equations of all overlaps, None if there are too few, or no lens."""
    parts = [one.thinned(GRAPH_EXPOSURE.blocks_of_overlap) for one in overlaps]
    total = sum(len(one.blocks) for one in parts)
    count = 1 + max((lens for lens in lenses if lens is not None), default=-1)
    if total < GRAPH_EXPOSURE.min_blocks or not count:
        return None
    gains, taken_off = np.zeros((total, len(lenses))), np.zeros((total, 2 * count))
    start = 0
    for one in parts:
        rows = slice(start, start + len(one.blocks))
        start = rows.stop
        gains[rows, one.j] += 1
        gains[rows, one.i] -= 1
        for picture, radii, sign in ((one.i, one.radii[0], 1), (one.j, one.radii[1], -1)):
            lens = lenses[picture]
            if lens is not None:
                taken_off[rows, 2 * lens : 2 * lens + 2] += sign * np.column_stack([radii, radii**2])
    values = np.concatenate([log_ratios(one.blocks.means).mean(axis=1) for one in parts])
    weights = np.concatenate([one.weights for one in parts])
    black = np.concatenate([(one.blocks.at // TONE.tile_blocks).sum(axis=1) % 2 == 0 for one in parts])
    return _Rows(values, weights, black, gains, taken_off)
