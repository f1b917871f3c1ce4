"""Depths that go on from a point to its neighbour as seen from a place: they tie parts of a rig that no points tie."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from ...raster.arrays import Array
from .bundle_options import CONTINUITY
from .tracks import Index, Tracks

# Blocks of rows: pictures (M,) and how the rows depend on their places (M, k, 3).
Blocks = list[tuple[Index, Array]]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Observations first, second (M,) that are neighbours as seen from a place and belong to points of two parts of the
    rig; share (M,): how much each counts."""

    first: Index
    second: Index
    share: Array


def neighbours_of(
    tracks: Tracks, part: Index, measured: NDArray[np.bool_], place: Index, directions: Array
) -> Neighbours:
    """Among observations of points whose depth is measured (P,); part (P,): see `parts`; place (N,): numbers of the
    places where pictures were taken; directions (O, 3): of the observations, in the world.

    The nearest of each two parts, however far apart they are: nothing else tells their proportion. Of a place that has
    one picture that is by px, else by directions: parts may meet in none of its pictures.
    """
    chosen = np.flatnonzero(measured[tracks.point])
    none = np.zeros(0, np.intp)
    found: list[tuple[Index, Index]] = []
    at = place[tracks.picture[chosen]]
    for j in np.unique(at):
        mine = chosen[at == j]
        own = part[tracks.point[mine]]
        sides = [mine[own == one] for one in np.unique(own)]
        where = tracks.pixels if (place == j).sum() == 1 else directions
        found += [_nearest(where, *two) for two in combinations(sides, 2)]
    counts = [len(first) for first, _ in found]
    share = np.repeat([CONTINUITY.weight / CONTINUITY.log_sigma**2 / max(count, 1) for count in counts], counts)
    first, second = (np.concatenate([none, *(two[side] for two in found)]) for side in (0, 1))
    return Neighbours(first, second, share)


def _nearest(where: Array, first: Index, second: Index) -> tuple[Index, Index]:
    """Those of two sets of observations that are nearest to the other set, each paired with another one, by where
    (O, k) they are: across a gap a single one at its rim would be the nearest of all."""
    near = []
    for mine, others in ((first, second), (second, first)):
        gaps, _ = cKDTree(where[others]).query(where[mine])
        near.append(mine[np.argsort(gaps, kind="stable")[: CONTINUITY.most]])
    u, v = near
    rows, columns = linear_sum_assignment(np.linalg.norm(where[u][:, None] - where[v], axis=2))
    return u[rows], v[columns]


def equal_logs(near: Neighbours, depth: Array, of_depth: Blocks) -> tuple[Blocks, Array, Array]:
    """Rows ln z_first − ln z_second = 0 where both are positive: blocks, weights (M,) that make squares an L1 norm
    beyond σ, residuals (M, 1).

    depth (O,): of every observation; of_depth: how depths depend on the places.
    """
    ahead = (depth[near.first] > 0) & (depth[near.second] > 0)
    u, v = near.first[ahead], near.second[ahead]
    off = np.log(depth[u] / depth[v])
    blocks = [(p[u], J[u] / depth[u][:, None, None]) for p, J in of_depth] + [
        (p[v], -J[v] / depth[v][:, None, None]) for p, J in of_depth
    ]
    rough = 1 / np.maximum(np.abs(off) / CONTINUITY.log_sigma, 1)
    return blocks, near.share[ahead] * rough, off[:, None]


def log_sizes(near: Neighbours, place: Index, part: Index, depth: Array) -> Array:
    """By how much parts have to grow (K,), in logs about 0, for depths to go on between them.

    place, part (O,): of every observation, parts numbered from 0; depth (O,).
    """
    off = np.log(np.abs(depth[near.first] / depth[near.second]))
    groups, number = np.unique([place[near.first], part[near.first], part[near.second]], axis=1, return_inverse=True)
    told = np.array([np.median(off[number.ravel() == k]) for k in range(groups.shape[1])])
    one = np.eye(int(part.max()) + 1)
    sizes: Array = np.linalg.lstsq(one[groups[2]] - one[groups[1]], told, rcond=None)[0]
    return sizes
