"""Where moves jump from one surface to another, and the surface on either side that nodes nearby may belong to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .edge_aware_smoothing import Smoother
from .options import OUTLINES


@dataclass(frozen=True, eq=False)
class Jumps:
    """near (h, w): the nodes within reach of a jump; nearest, farthest (h, w): of the moves, px, that were found within
    reach of each, and the moves themselves where none was."""

    near: NDArray[np.bool_]
    nearest: Plane
    farthest: Plane

    @staticmethod
    def of(along: Plane, found: NDArray[np.bool_], reach: int) -> Jumps | None:
        """The jumps of moves (h, w) px, of which some were found; None if there are none."""
        rough = cv2.medianBlur(along, OUTLINES.median_nodes)
        few, around = (np.ones((side,) * 2, np.uint8) for side in (OUTLINES.jump_nodes, 2 * reach + 1))
        jumps = cv2.dilate(rough, few) - cv2.erode(rough, few) > OUTLINES.jump_px
        if not jumps.any():
            return None
        none = np.finfo(np.float32).max
        nearest = cv2.dilate(np.where(found, rough, -none), around)
        farthest = cv2.erode(np.where(found, rough, none), around)
        return Jumps(
            cv2.dilate(jumps.view(np.uint8), around) > 0,
            np.where(nearest > -none, nearest, along), np.where(farthest < none, farthest, along),
        )  # fmt: skip

    def settled(self, along: Plane, gains: Sequence[Plane], smoother: Smoother) -> Plane:
        """Moves (h, w) px, those near a jump on the side that is clearly better; gains: gray levels (h, w) by which the
        nearest and the farthest are, 0 away from jumps, which are averaged along the edges of a picture."""
        nearer, farther = smoother.averaged(gains)
        chosen = np.where(nearer > farther, self.nearest, self.farthest)
        clearly = self.near & (np.maximum(nearer, farther) > OUTLINES.least_gain)
        clearly &= np.abs(chosen - along) > OUTLINES.least_px
        return np.where(clearly, chosen, along)
