"""Inverse depth along straight edges: of a straight line in space it is affine along its picture.

Every pixel is matched by itself, and errors of a few tenths of a pixel bend what is straight. Where nearly all that was
found along a straight edge of the reference agrees on one line in space, it is put onto it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Plane
from .epipolar_lines import EpipolarLines
from .options import STRAIGHT_EDGES


def straightened(lines: EpipolarLines, along: Plane, edges: Array) -> Plane:
    """Moves (h, w) px along the lines by which straight edges of the reference stay straight.

    along (h, w): moves as found, px; edges (N, 2, 2): ends of straight edges, raw px of the reference. On an edge, and
    on either side of it, one affine function of d is fitted to the nodes (Huber's loss). Where most agree with it, they
    are moved onto it, and what lies next to them with them.
    """
    at, place, edge = _nodes_on(lines, edges)
    per_px = lines.depth_per_px[tuple(at)].astype(np.float64)
    depth = lines.inverse_depth[tuple(at)] + along[tuple(at)] * per_px
    known = np.isfinite(depth) & np.isfinite(per_px) & (per_px != 0)
    at, place, edge, per_px, depth = at[:, known], place[known], edge[known], per_px[known], depth[known]
    off_px, counts = _off_lines(place, edge, per_px, depth)
    agree = np.abs(off_px) < STRAIGHT_EDGES.agreeing_px
    share = np.bincount(edge, agree, len(counts)) / np.maximum(counts, 1)
    used = agree & ((share >= STRAIGHT_EDGES.min_share) & (counts >= STRAIGHT_EDGES.min_nodes))[edge]
    if not used.any():
        return along
    total, number = np.zeros((2, *along.shape), np.float32)
    np.add.at(total, tuple(at[:, used]), off_px[used].astype(np.float32))
    np.add.at(number, tuple(at[:, used]), np.float32(1))
    near = cv2.GaussianBlur((number > 0).astype(np.float32), (0, 0), STRAIGHT_EDGES.beside_nodes)
    total, number = (cv2.GaussianBlur(one, (0, 0), STRAIGHT_EDGES.beside_nodes) for one in (total, number))
    total /= np.maximum(number, np.float32(1e-9))
    total *= np.minimum(2 * near, np.float32(1))  # whole on the three nodes across an edge
    moved: Plane = total + along
    return moved


def _nodes_on(lines: EpipolarLines, edges: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Nodes (2, n), as rows and columns, that edges and their parallels a node to either side pass through; the place
    (n,) of each along it, from −½ to ½; and the number (n,) of its edge or parallel."""
    left, top, width, height = lines.box
    rows, columns = lines.shape
    ends = (edges - np.array([left, top]) + 0.5) * np.array([columns / width, rows / height]) - 0.5
    span = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(span, axis=1)
    ends, span, lengths = (one[lengths >= STRAIGHT_EDGES.min_nodes] for one in (ends, span, lengths))
    normals = np.column_stack([-span[:, 1], span[:, 0]]) / lengths[:, None]
    middles = np.concatenate([ends.mean(axis=1) + beside * normals for beside in (-1, 0, 1)])
    span, counts = np.tile(span, (3, 1)), np.tile(lengths.astype(np.intp) + 1, 3)
    edge = np.repeat(np.arange(len(counts)), counts)
    place = (np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)) / (counts[edge] - 1) - 0.5
    at = np.rint(middles[edge] + place[:, None] * span[edge]).astype(np.intp).T[::-1]
    inside = (at >= 0).all(axis=0) & (at < np.array([[rows], [columns]])).all(axis=0)
    return at[:, inside], place[inside], edge[inside]


def _off_lines(
    place: Array, edge: NDArray[np.intp], per_px: Array, depth: Array
) -> tuple[Array, NDArray[np.intp]]:
    """Moves (n,) px from the depths to the affine function that fits those of the same edge best, by reweighted least
    squares; and the nodes (N,) of each edge."""
    counts = np.bincount(edge)
    weight = np.ones(len(edge))
    off_px = np.zeros(len(edge))
    for _ in range(STRAIGHT_EDGES.fits):
        w = weight / per_px**2
        s0, s1, s2, d0, d1 = (
            np.bincount(edge, w * one, len(counts)) for one in (1.0, place, place**2, depth, depth * place)
        )
        determinant = np.maximum(s0 * s2 - s1**2, 1e-12 * s0 * s0) + 1e-300
        level, slope = (s2 * d0 - s1 * d1) / determinant, (s0 * d1 - s1 * d0) / determinant
        off_px = (level[edge] + slope[edge] * place - depth) / per_px
        weight = 1 / np.maximum(1, np.abs(off_px) / STRAIGHT_EDGES.huber_px)
    return off_px, counts
