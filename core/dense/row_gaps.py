"""What a matcher leaves open along epipolar rows because something nearer hides it in the other picture.

Beside a near thing the reference shows background that the target does not: as wide as the disparity jumps, and on one
side only. It goes on as far away as what lies on its other side (Hirschmüller, IEEE TPAMI 2008, 2.6).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .options import MATCHING


def hidden_gaps(disparity: Plane, found: NDArray[np.bool_], nearer: float) -> tuple[Plane, NDArray[np.bool_]]:
    """Disparities (h, w) with such gaps filled, and the mask of the gaps.

    found (h, w): where there is a disparity; nearer: sign of the change of disparity towards what is nearer.
    """
    width = disparity.shape[1]
    columns = np.arange(width, dtype=np.int32)
    before = np.maximum.accumulate(np.where(found, columns, np.int32(-1)), axis=1)
    after = np.minimum.accumulate(np.where(found, columns, np.int32(width))[:, ::-1], axis=1)[:, ::-1]
    row, column = np.nonzero(~found & (before >= 0) & (after < width))
    before, after = before[row, column], after[row, column]
    left, right = disparity[row, before], disparity[row, after]
    # a point of column u lies at u - disparity in the target: there what is hidden takes no room
    jump = right - left
    gap = (jump > MATCHING.hidden_jump_px) & (after - before <= MATCHING.hidden_width * jump + MATCHING.hidden_rest_px)
    row, column = row[gap], column[gap]
    filled, mask = disparity.copy(), np.zeros(found.shape, bool)
    filled[row, column] = np.where(nearer > 0, left[gap], right[gap])
    mask[row, column] = True
    return filled, mask
