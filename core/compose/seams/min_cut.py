"""A minimal cut on a grid of pixels: two labels with the cheapest border between them.

Graph cuts for seams: Kwatra et al., Graphcut Textures, SIGGRAPH 2003.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from ..options import MIN_CUT

# What is known of a pixel: comes from the first picture, from the second, is to be decided, or lies in neither.
FIRST, SECOND, FREE, NOWHERE = -1, 1, 0, 2


def min_cut(
    cost: NDArray[np.float32], known: NDArray[np.int8], price: NDArray[np.float32] | None = None
) -> NDArray[np.bool_]:
    """Minimise the cost of the border between two pictures plus the price of what is shown.

    A border between two of 4 neighbours costs their mean cost. Time grows with the free pixels to the power of about
    1.5: keep them below 20 000 in a block, or in a narrow band.

    Parameters
    ----------
    cost : (H, W) float32 array
        In [0, 1].
    known : (H, W) int8 array
        FIRST, SECOND, FREE or NOWHERE.
    price : (H, W) float32 array, optional
        Of each free pixel that comes from the second picture; a negative one is paid if it comes from the first.

    Returns
    -------
    (H, W) bool array
        True for the second picture, False for the first and for NOWHERE. Of equally cheap cuts, the one that shows
        most of the first picture.
    """
    free = np.flatnonzero(known == FREE)
    out: NDArray[np.bool_] = known == SECOND
    if not free.size:
        return out
    count, (source, sink) = free.size, (free.size, free.size + 1)
    width = known.shape[1] + 2
    states = np.pad(known, 1, constant_values=NOWHERE).ravel()
    costs = np.pad(cost, 1).ravel()
    at = free + width + 1 + 2 * (free // known.shape[1])
    node = np.full(states.size, -1, np.int32)
    node[at] = np.arange(count, dtype=np.int32)
    tails: list[NDArray[Any]] = []
    heads: list[NDArray[Any]] = []
    capacities: list[NDArray[Any]] = []

    def connect(tail: NDArray[Any] | int, head: NDArray[Any] | int, units: NDArray[Any]) -> None:
        for ends, end in ((tails, tail), (heads, head)):
            ends.append(np.broadcast_to(np.asarray(end, np.int32), units.shape))
        capacities.append(units.astype(np.int32))

    for step in (1, -1, width, -width):
        there = states[at + step]
        units = 1 + np.rint((MIN_CUT.units / 2) * (costs[at] + costs[at + step]))
        connect(node[at[there == FREE]], node[at[there == FREE] + step], units[there == FREE])
        connect(source, node[at[there == FIRST]], units[there == FIRST])
        connect(node[at[there == SECOND]], sink, units[there == SECOND])
    if price is not None:
        units = np.rint(MIN_CUT.units * price.ravel()[free])
        connect(source, np.flatnonzero(units > 0), units[units > 0])
        connect(np.flatnonzero(units < 0), sink, -units[units < 0])
    edges = np.concatenate(tails), np.concatenate(heads)
    graph = csr_matrix((np.concatenate(capacities), edges), shape=(count + 2, count + 2), dtype=np.int32)
    if not (graph.indices == sink).any():  # nothing belongs to the second picture
        return out
    residual = csr_matrix(graph - maximum_flow(graph, source, sink).flow)
    residual.eliminate_zeros()
    reached = breadth_first_order(residual.T.tocsr(), sink, return_predecessors=False)
    second = np.zeros(count + 2, bool)
    second[reached] = True
    out.ravel()[free] = second[:count]
    return out
