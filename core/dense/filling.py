"""What was found is smoothed, and continued into what was not, along the edges of a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .edge_aware_smoothing import Smoother, Weights, cut_edges, edge_weights, strengthen
from .options import REFINE


@dataclass(frozen=True, eq=False)
class Filled:
    """Moves along (h, w) px everywhere; edges: connections of neighbours in the picture; weights: the same where moves
    jump, and where there is no texture; known (h, w): 0..1, how surely each was found, a guess a little."""

    along: Plane
    edges: Weights
    weights: Weights
    known: Plane


def filled(guide: NDArray[np.float32], along: Plane, found: Plane, plain: Plane) -> Filled:
    """Fill and smooth moves.

    Parameters
    ----------
    guide : (h, w, C) float32 array
        The picture whose edges count, without noise.
    along : (h, w) float32 array
        Moves, px; the field's where none was found.
    found : (h, w) float32 array
        0..1, how surely.
    plain : (h, w) float32 array
        0..1, lack of texture: nothing there is sure.

    Returns
    -------
    Filled
    """
    edges = edge_weights(guide, REFINE.edge_levels)
    weights = strengthen(cut_edges(edges, along, found > 0, REFINE.depth_edge_px), plain, REFINE.plain_strength)
    weight = np.maximum(found * (1 - np.float32(REFINE.plain_doubt) * plain), np.float32(REFINE.field_confidence))
    along = Smoother.of(weights, REFINE.smoothness).smoothed(along, weight)
    return Filled(along, edges, weights, np.maximum(found, np.float32(REFINE.field_confidence)))
