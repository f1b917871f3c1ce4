"""A grid of nodes over pixels, and cubic interpolation from nodes to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Array
from .options import GRID


@dataclass(frozen=True)
class Grid:
    """Nodes at the centres of square cells of `step` px, cell (0, 0) starting at pixel `start` (x, y) of the
    reference's plane.

    A cell covers whole pixels; its centre lies at start + (step − 1) / 2.
    """

    start: tuple[int, int]
    step: int
    columns: int
    rows: int

    @staticmethod
    def over(left: int, top: int, width: int, height: int, nodes: int = GRID.nodes) -> Grid:
        """The grid that covers a rectangle of pixels of the reference's plane with two cells of margin (bicubic needs
        them)."""
        step = max(GRID.least_step, int(np.sqrt(width * height / nodes)))
        columns, rows = -(-width // step) + 4, -(-height // step) + 4
        return Grid((left - 2 * step, top - 2 * step), step, columns, rows)

    @property
    def xs(self) -> Array:
        """x of the nodes, px of the reference's plane."""
        return self.start[0] + (self.step - 1) / 2 + self.step * np.arange(self.columns, dtype=np.float64)

    @property
    def ys(self) -> Array:
        """y of the nodes, px of the reference's plane."""
        return self.start[1] + (self.step - 1) / 2 + self.step * np.arange(self.rows, dtype=np.float64)

    @property
    def points(self) -> Array:
        """All nodes (rows, columns, 2)."""
        return np.stack(np.meshgrid(self.xs, self.ys), axis=-1)

    def to_pixels(
        self, values: NDArray[Any], left: int, top: int, width: int, height: int, every: int = 1
    ) -> NDArray[np.float32]:
        """Node values (rows, columns) as float32 pixels of a rectangle, by cubic convolution; every: of so many a side
        only the first.

        Keys 1981 (a = −½), which reproduces affine and quadratic functions; OpenCV's own cubic (a = −¾) does not: it
        would put ripples on every plane.
        """
        down, near = _cubic_weights(self.start[1], self.step, self.rows, range(top, top + height, every))
        lines = (down @ np.asarray(values, np.float64)[near]).astype(np.float32)
        out = np.empty((len(lines), -(-width // every)), np.float32)
        for part, near, across in _across(self.start[0], self.step, self.columns, range(left, left + width, every)):
            np.matmul(lines[:, near], across, out=out[:, part])
        return out

    def at(self, values: NDArray[Any], points: Array) -> Array:
        """Node values (rows, columns) at points (…, 2), by the same convolution; 0 where a point is NaN or lies beyond
        the cells that have neighbours."""
        place = (points - np.array(self.start) - (self.step - 1) / 2) / self.step
        with np.errstate(invalid="ignore"):
            inside = (place >= 1).all(axis=-1) & (place < np.array([self.columns, self.rows]) - 2).all(axis=-1)
        node = np.floor(place[inside]).astype(int)
        weights, (column, row) = _keys(place[inside] - node), node.T
        out = np.zeros(points.shape[:-1])
        out[inside] = sum(
            weights[i][:, 0] * weights[j][:, 1] * values[row + j - 1, column + i - 1]
            for j in range(4) for i in range(4)
        )  # fmt: skip
        return out


@lru_cache(maxsize=8)  # strip after strip asks for the same
def _across(start: int, step: int, nodes: int, pixels: range) -> list[tuple[slice, slice, NDArray[np.float32]]]:
    """Some pixels of one axis after the other, the nodes that count for them, and their weights (n, pixels): so that
    what is not near is not multiplied."""
    some = max(1, GRID.cells_at_once * step // pixels.step)
    out = []
    for first in range(0, len(pixels), some):
        part = slice(first, first + some)
        weights, near = _cubic_weights(start, step, nodes, pixels[part])
        out.append((part, near, np.ascontiguousarray(weights.T, np.float32)))
    return out


def _cubic_weights(start: int, step: int, nodes: int, pixels: range) -> tuple[Array, slice]:
    """Weights (len(pixels), n) of the nodes of one axis for pixels, and which n they are: those that count."""
    at = (np.arange(pixels.start, pixels.stop, pixels.step) - start - (step - 1) / 2) / step
    node = np.clip(np.floor(at).astype(int), 1, nodes - 3)
    near = slice(int(node[0]) - 1, int(node[-1]) + 3)
    weights = np.zeros((len(pixels), near.stop - near.start))
    each = np.arange(len(pixels))
    for k, weight in enumerate(_keys(at - node)):
        weights[each, node - node[0] + k] = weight
    return weights, near


def _keys(u: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the four nodes about a point u (0 to 1) past the second of them."""
    return (
        ((-0.5 * u + 1.0) * u - 0.5) * u,
        (1.5 * u - 2.5) * u * u + 1.0,
        ((-1.5 * u + 2.0) * u + 0.5) * u,
        (0.5 * u - 0.5) * u * u,
    )
