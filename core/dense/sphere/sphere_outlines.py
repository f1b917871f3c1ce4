"""Puts the edges of depth on a patch where the pictures have an edge: `outlines`, for many pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane
from ..edge_aware_smoothing import Smoother, Weights
from ..options import OUTLINES
from .choice import Compared
from .hiding import hidden_from, nearest_on
from .options import SPHERE_OUTLINES
from .sweep import difference

if TYPE_CHECKING:
    from .search import Found


def with_outlines(compared: Compared, found: Found, along: Plane, edges: Weights) -> Plane:
    """Moves along (h, w) px whose jumps lie on edges of the pictures.

    Near a jump each node may have what was found nearest or farthest around it, where the pictures are clearly more
    alike then; found: what is an example for others; edges: see `edge_weights`.
    """
    around = np.ones((2 * SPHERE_OUTLINES.reach + 1,) * 2, np.uint8)
    few = np.ones((OUTLINES.jump_nodes,) * 2, np.uint8)
    smoother = Smoother.of(edges, OUTLINES.smoothness, passes=1)
    none = np.finfo(np.float32).max
    for _ in range(SPHERE_OUTLINES.rounds):
        rough = cv2.medianBlur(along, OUTLINES.median_nodes)
        jumps = cv2.dilate(rough, few) - cv2.erode(rough, few) > OUTLINES.jump_px
        if not jumps.any():
            return along
        band = cv2.dilate(jumps.astype(np.uint8), around) > 0
        near = cv2.dilate(np.where(found.where, rough, -none), around)
        far = cv2.erode(np.where(found.where, rough, none), around)
        near, far = np.where(near > -none, near, along), np.where(far < none, far, along)
        nearest = nearest_on(compared, compared.at(along))
        own, seen = _costs(compared, along, nearest)
        sure = own[found.where & seen]
        usual = float(np.percentile(sure, OUTLINES.usual_percentile)) if sure.size else 0.0
        behind = np.float32(max(OUTLINES.min_behind, SPHERE_OUTLINES.behind * usual))
        own = np.where(seen, own, behind)
        # a guess is no better than the surface behind
        own = np.where(found.where, own, np.maximum(own, behind) + 2 * np.float32(OUTLINES.least_gain))
        gains = []
        for other in (near, far):
            cost, seen = _costs(compared, other, nearest)
            gains.append(np.where(band, own - np.where(seen, cost, behind), np.float32(0)))
        gains = smoother.averaged(gains)
        chosen = np.where(gains[0] > gains[1], near, far)
        clearly = band & (np.maximum(*gains) > OUTLINES.least_gain) & (np.abs(chosen - along) > OUTLINES.least_px)
        along = np.where(clearly, chosen, along)
    return along


def _costs(compared: Compared, along: Plane, nearest: list[Plane]) -> tuple[Plane, NDArray[np.bool_]]:
    """Gray levels (h, w) by which pictures differ after moves (h, w), and where (h, w) any other picture sees that."""
    d = compared.at(along)
    apart, count = difference(compared, compared.sampled(d), hidden=hidden_from(compared, d, nearest))
    return apart.astype(np.float32), count > 0
