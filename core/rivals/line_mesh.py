"""A mesh over the target whose nodes are sought on the reference's plane, by points, lines and the shape to be kept.

What SPW and LPC have in common (see `line_fields`). Unknown are the nodes' ways U from where a homography G has them; a
point p of the target lies at π(G p) and the bilinear mean of its cell's ways, so that a cell follows G exactly (in the
papers it is the mean of the nodes' places). All terms are linear in U: one sparse least-squares problem settles them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ..cameras.projective import homogeneous, project
from ..raster.arrays import Array
from ..system.errors import DegenerateGeometry
from .options import LINE_MESH


@dataclass(frozen=True, eq=False)
class Mesh:
    """Nodes over a target of `size` (W, H) px, `columns` × `rows` of them; G (3, 3): the homography that the shape is
    taken from, target to reference, its sign such that the target's middle is in front."""

    size: tuple[int, int]
    columns: int
    rows: int
    G: Array

    @staticmethod
    def over(size: tuple[int, int], G: Array, cell_px: float) -> Mesh:
        """Cells of about cell_px. Raises DegenerateGeometry where the homography sends part of the target to infinity:
        the papers have no mesh then."""
        cell = max(cell_px, np.sqrt(size[0] * size[1] / LINE_MESH.max_nodes))
        corners = np.array([[0, 0], [size[0] - 1, 0], [0, size[1] - 1], [size[0] - 1, size[1] - 1]], np.float64)
        ahead = homogeneous(np.vstack([corners, corners.mean(axis=0)])) @ G[2]
        if not (ahead * ahead[-1] > LINE_MESH.least_ahead * ahead[-1] ** 2).all():
            raise DegenerateGeometry(
                "the homography of the whole picture sends part of the target to infinity, and a mesh of lines starts "
                "from it; choose another field"
            )
        return Mesh(size, int(np.ceil(size[0] / cell)) + 1, int(np.ceil(size[1] / cell)) + 1, G * np.sign(ahead[-1]))

    @property
    def cell(self) -> Array:
        """Sides (2,) of a cell, px of the target."""
        return (np.array(self.size) - 1.0) / (np.array([self.columns, self.rows]) - 1.0)

    @cached_property
    def nodes(self) -> Array:
        """Places (n, 2) of the nodes on the target, row by row."""
        counts = self.columns, self.rows
        xs, ys = (np.linspace(0, side - 1, count) for side, count in zip(self.size, counts, strict=True))
        nodes: Array = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        return nodes

    @cached_property
    def start(self) -> Array:
        """Where (n, 2) the homography has them on the reference's plane."""
        return self.shown(self.nodes)

    def shown(self, points: Array) -> Array:
        """Where (N, 2) the homography has points (N, 2) of the target."""
        places: Array = project(homogeneous(points) @ self.G.T)
        return places

    def weights(self, points: Array) -> Any:
        """A sparse matrix (N, n) of bilinear weights of points (N, 2) of the target."""
        at = points / self.cell
        corner = np.clip(np.floor(at).astype(int), 0, [self.columns - 2, self.rows - 2])
        u, v = (at - corner).T
        first = corner[:, 1] * self.columns + corner[:, 0]
        index = np.stack([first, first + 1, first + self.columns, first + self.columns + 1], axis=1)
        share = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
        rows = np.repeat(np.arange(len(points)), 4)
        shape = len(points), self.columns * self.rows
        return scipy.sparse.csr_matrix((share.ravel(), (rows, index.ravel())), shape=shape)

    def along(self, ends: Array) -> tuple[Array, NDArray[np.intp]]:
        """Points (N, 2) along segments (K, 2, 2), a few in each cell, and the number (N,) of each one's segment."""
        step = self.cell.min() / LINE_MESH.samples_per_cell
        counts = np.maximum(np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / step).astype(int) + 1, 3)
        parts = [start + np.linspace(0, 1, n)[:, None] * (end - start)
                 for (start, end), n in zip(ends, counts, strict=True)]  # fmt: skip
        return np.concatenate([np.zeros((0, 2)), *parts]), np.repeat(np.arange(len(ends)), counts)

    def cross_lines(self) -> tuple[Array, Array]:
        """Segments (K, 2, 2) and (L, 2, 2) across the target in the two directions that a homography tells apart (Li,
        Xu and Wang, Quasi-homography warps, IEEE TMM 2018): along u all its lines stay parallel and evenly divided,
        along v they converge."""
        way = self.G[2, :2]
        v = way / np.linalg.norm(way) if np.linalg.norm(way) * max(self.size) > 1e-6 * abs(self.G[2, 2]) else [1.0, 0.0]
        v = np.asarray(v)
        u = np.array([-v[1], v[0]])
        return self._across(u, v), self._across(v, u)

    def _across(self, way: Array, spread: Array) -> Array:
        """Lines of a direction, evenly along another, cut to the target."""
        corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (np.array(self.size) - 1.0)
        apart = self.cell.min() / LINE_MESH.samples_per_cell
        low, high = (corners @ spread).min(), (corners @ spread).max()
        found = []
        for offset in np.arange(low + apart / 2, high, apart):
            base = offset * spread
            near, far = -np.inf, np.inf
            for axis in (0, 1):
                limit = self.size[axis] - 1.0
                if abs(way[axis]) < 1e-9:
                    if not 0 <= base[axis] <= limit:
                        near, far = 1.0, 0.0
                    continue
                ends = sorted(((0 - base[axis]) / way[axis], (limit - base[axis]) / way[axis]))
                near, far = max(near, ends[0]), min(far, ends[1])
            if far - near > apart:
                found.append([base + near * way, base + far * way])
        return np.array(found).reshape(-1, 2, 2)


@dataclass(eq=False)
class Terms:
    """Rows of a least-squares problem in the ways U of a mesh's nodes, x of all before y of all."""

    mesh: Mesh
    _rows: list[Any] = field(default_factory=list)
    _values: list[Array] = field(default_factory=list)

    def points(self, target: Array, reference: Array, weight: Array) -> None:
        """Points (N, 2) of the target lie at points of the reference; weight (N,)."""
        B, root = self.mesh.weights(target), np.sqrt(weight)
        B = scipy.sparse.diags(root) @ B
        self._add(scipy.sparse.block_diag([B, B]), ((reference - self.mesh.shown(target)) * root[:, None]).T.ravel())

    def on_lines(self, ends: Array, lines: Array, weight: float) -> None:
        """Both ends of segments (K, 2, 2) of the target lie on lines (K, 3) of the reference's plane."""
        if len(ends):
            points, twice = ends.reshape(-1, 2), np.repeat(lines, 2, axis=0)
            off = np.sum(twice[:, :2] * self.mesh.shown(points), axis=1) + twice[:, 2]
            self._across(self.mesh.weights(points), twice[:, :2], -off, weight)

    def straight(self, ends: Array, weight: float) -> None:
        """Segments (K, 2, 2) of the target keep the direction in which the homography shows them, and so stay straight
        and at their slope."""
        points, number = self.mesh.along(ends)
        if not len(points):
            return
        shown = self.mesh.shown(ends.reshape(-1, 2)).reshape(-1, 2, 2)
        along = shown[:, 1] - shown[:, 0]
        lengths = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
        normals = np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None]
        same = np.flatnonzero(number[1:] == number[:-1])
        B = self.mesh.weights(points)
        self._across(B[same + 1] - B[same], normals[number[same]], np.zeros(len(same)), weight)

    def evenly_divided(self, ends: Array, weight: float, beyond: tuple[int, int] | None = None) -> None:
        """Points at even steps along segments (K, 2, 2) stay at even steps; beyond: of those only that the homography
        has outside a reference of (W, H) px."""
        points, number = self.mesh.along(ends)
        if len(points) < 3:
            return
        same = np.flatnonzero(number[2:] == number[:-2])
        shown = self.mesh.shown(points)
        if beyond is not None:
            middle = shown[same + 1]
            same = same[((middle < 0) | (middle > np.array(beyond) - 1.0)).any(axis=1)]
        B, root = self.mesh.weights(points), np.sqrt(weight)
        change = root * (B[same + 2] - 2 * B[same + 1] + B[same])
        uneven = root * (shown[same + 2] - 2 * shown[same + 1] + shown[same])
        self._add(scipy.sparse.block_diag([change, change]), -uneven.T.ravel())

    def solved(self) -> Array:
        """Places (n, 2) of the nodes that fit best; those that nothing speaks of stay where the homography has them."""
        A = scipy.sparse.vstack(self._rows).tocsr()
        normal = (A.T @ A + LINE_MESH.ridge * scipy.sparse.eye(A.shape[1])).tocsc()
        places: Array = self.mesh.start + splu(normal).solve(A.T @ np.concatenate(self._values)).reshape(2, -1).T
        return places

    def _across(self, B: Any, normals: Array, values: Array, weight: float) -> None:
        """normals (N, 2) · B U = values (N,)."""
        root = np.sqrt(weight)
        rows = [scipy.sparse.diags(root * normals[:, axis]) @ B for axis in (0, 1)]
        self._add(scipy.sparse.hstack(rows), root * values)

    def _add(self, rows: Any, values: Array) -> None:
        self._rows.append(rows)
        self._values.append(values)
