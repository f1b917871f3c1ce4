"""Puts the edges of depth on a patch where the pictures have an edge: `outlines`, for many pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane
from ..edge_aware_smoothing import Smoother, Weights
from ..jumps import Jumps
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
    smoother = Smoother.of(edges, OUTLINES.smoothness, passes=1)
    for _ in range(SPHERE_OUTLINES.rounds):
        jumps = Jumps.of(along, found.where, SPHERE_OUTLINES.reach)
        if jumps is None:
            return along
        nearest = nearest_on(compared, compared.at(along))
        own, seen = _costs(compared, along, nearest)
        sure = own[found.where & seen]
        usual = float(np.percentile(sure, OUTLINES.usual_percentile)) if sure.size else 0.0
        behind = np.float32(max(OUTLINES.min_behind, OUTLINES.behind * usual))
        own = np.where(seen, own, behind)
        # a guess is no better than the surface behind
        own = np.where(found.where, own, np.maximum(own, behind) + 2 * np.float32(OUTLINES.least_gain))
        gains = []
        for other in (jumps.nearest, jumps.farthest):
            cost, seen = _costs(compared, other, nearest)
            gains.append(np.where(jumps.near, own - np.where(seen, cost, behind), np.float32(0)))
        along = jumps.settled(along, gains, smoother)
    return along


def _costs(compared: Compared, along: Plane, nearest: list[Plane]) -> tuple[Plane, NDArray[np.bool_]]:
    """Gray levels (h, w) by which pictures differ after moves (h, w), and where (h, w) any other picture sees that."""
    d = compared.at(along)
    apart, count = difference(compared, compared.sampled(d), hidden=hidden_from(compared, d, nearest))
    return apart.astype(np.float32), count > 0
