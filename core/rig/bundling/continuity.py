"""Depths that continue from a point to its neighbour in a picture: what ties places where no point is seen by three."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...raster.arrays import Array
from .bundle_options import CONTINUITY
from .tracks import Index, Tracks

# Blocks of rows: pictures (M,) and how the rows depend on their places (M, k, 3).
Blocks = list[tuple[Index, Array]]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Observations first, second (M,) that are neighbours in a picture and belong to points that other pictures see;
    share (M,): how much each counts."""

    first: Index
    second: Index
    share: Array


def neighbours_of(tracks: Tracks, measured: NDArray[np.bool_], pictures: int) -> Neighbours:
    """Among observations of points whose depth is measured (P,)."""
    chosen = np.flatnonzero(measured[tracks.point])
    kind = tracks.kind[tracks.point]
    none = np.zeros(0, np.intp)
    first, second, share = [none], [none], [np.zeros(0)]
    for j in range(pictures):
        mine = chosen[tracks.picture[chosen] == j]
        if len(mine) < CONTINUITY.least_points or (kind[mine] == kind[mine[0]]).all():
            continue
        pixels = tracks.pixels[mine]
        gaps, near = cKDTree(pixels).query(pixels, k=min(CONTINUITY.neighbours + 1, len(mine)))
        u, v = np.repeat(mine, near.shape[1] - 1), mine[near[:, 1:].ravel()]
        other = np.flatnonzero(kind[u] != kind[v])
        other = other[np.argsort(gaps[:, 1:].ravel()[other], kind="stable")[: CONTINUITY.most]]
        first.append(u[other])
        second.append(v[other])
        share.append(np.full(len(other), CONTINUITY.weight / max(len(other), 1)))
    return Neighbours(np.concatenate(first), np.concatenate(second), np.concatenate(share) / CONTINUITY.log_sigma**2)


def equal_depths(near: Neighbours, depth: Array, of_depth: Blocks) -> tuple[Blocks, Array]:
    """Rows z_first − z_second = 0 in units of their mean, and weights (M,) that make their squares an L1 norm.

    depth (O,): of every observation; of_depth: how depths depend on the places.
    """
    first, second = depth[near.first], depth[near.second]
    size = np.maximum((np.abs(first) + np.abs(second)) / 2, 1e-9)
    blocks = [(p[near.first], J[near.first]) for p, J in of_depth] + [
        (p[near.second], -J[near.second]) for p, J in of_depth
    ]
    rough = CONTINUITY.flat / np.maximum(np.abs(first - second) / size, CONTINUITY.flat)
    return blocks, near.share * rough / size**2


def equal_logs(near: Neighbours, depth: Array, of_depth: Blocks) -> tuple[Blocks, Array, Array]:
    """Rows ln z_first − ln z_second = 0 where both are positive: blocks, weights (M,), residuals (M, 1)."""
    ahead = (depth[near.first] > 0) & (depth[near.second] > 0)
    u, v = near.first[ahead], near.second[ahead]
    off = np.log(depth[u] / depth[v])
    blocks = [(p[u], J[u] / depth[u][:, None, None]) for p, J in of_depth] + [
        (p[v], -J[v] / depth[v][:, None, None]) for p, J in of_depth
    ]
    rough = 1 / np.maximum(np.abs(off) / CONTINUITY.log_sigma, 1)
    return blocks, near.share[ahead] * rough, off[:, None]
