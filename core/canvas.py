"""The plane the panorama lives in: its size and where the reference lies in it; grids of nodes over it.

Canvas pixels are reference pixels moved by whole numbers, so that the reference is pasted exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import sgemm

from .epipolar import Array
from .errors import OutputTooLarge

# Fields are smooth: about this many nodes carry them at any picture size.
NODES = 20_000
MIN_STEP = 4
# Limits of what is worth showing: the target stretched more than 4× in length, or reaching further than three pictures
# away.
MAX_STRETCH = 4.0
MAX_REACH = 3.0
MAX_PIXELS = 1_000_000_000

# left, top, width, height in px
Box = tuple[int, int, int, int]


@dataclass(frozen=True)
class Canvas:
    """width, height px; offset: canvas pixel (x, y) of the reference's pixel (0, 0); cropped: part of the target runs
    off the canvas."""

    width: int
    height: int
    offset: tuple[int, int]
    cropped: bool = False


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
    def over(left: int, top: int, width: int, height: int, nodes: int = NODES) -> Grid:
        """The grid that covers a rectangle of pixels of the reference's plane with two cells of margin (bicubic needs
        them)."""
        step = max(MIN_STEP, int(np.sqrt(width * height / nodes)))
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

    def to_pixels(self, values: NDArray, left: int, top: int, width: int, height: int) -> NDArray[np.float32]:
        """Node values (rows, columns) as float32 pixels of a rectangle, by cubic convolution.

        Keys 1981 (a = −½), which reproduces affine and quadratic functions; OpenCV's own cubic (a = −¾) does not: it
        would put ripples on every plane.
        """
        down = _cubic_weights(self.start[1], self.step, self.rows, top, height)
        across = _cubic_weights(self.start[0], self.step, self.columns, left, width)
        strips = (down @ np.asarray(values, np.float64)).astype(np.float32)
        return sgemm(1.0, across.T.astype(np.float32), strips.T, trans_a=True).T


def _cubic_weights(start: int, step: int, nodes: int, first: int, count: int) -> Array:
    """Weights (count, nodes) of the nodes of one axis for the pixels first, first + 1, …"""
    at = (np.arange(first, first + count) - start - (step - 1) / 2) / step
    node = np.clip(np.floor(at).astype(int), 1, nodes - 3)
    u = at - node
    weights = np.zeros((count, nodes))
    each = np.arange(count)
    weights[each, node - 1] = ((-0.5 * u + 1.0) * u - 0.5) * u
    weights[each, node] = (1.5 * u - 2.5) * u * u + 1.0
    weights[each, node + 1] = ((-1.5 * u + 2.0) * u + 0.5) * u
    weights[each, node + 2] = (0.5 * u - 0.5) * u * u
    return weights


def bounding_canvas(
    target_at: Callable[[Grid], Array], reference_size: tuple[int, int], target_size: tuple[int, int], reach: Array
) -> Canvas:
    """A canvas, small to within a cell, that holds the reference and every well-behaved part of the target.

    target_at(grid) gives target pixels (rows, columns, 2), NaN behind the camera; sizes (W, H) px; reach (4,): left,
    top, right, bottom in px of the reference's plane that the target is expected to reach (see `expected_reach`).
    Raises OutputTooLarge.
    """
    width, height = reference_size
    left, top, right, bottom = reach
    cropped = False
    for _ in range(2):  # the second pass looks closer at what the first found
        grid = Grid.over(int(left), int(top), max(1, int(right - left)), max(1, int(bottom - top)), nodes=NODES // 10)
        target = target_at(grid)
        seen = _inside(target, target_size)
        stretched = seen & (_area_ratio(target, grid.step) < 1 / MAX_STRETCH**2)
        useful = seen & ~stretched
        if useful.any():
            rows, columns = np.flatnonzero(useful.any(axis=1)), np.flatnonzero(useful.any(axis=0))
            xs, ys, margin = grid.xs, grid.ys, grid.step
            # a node sees its own cell; the picture's edge lies between it and its neighbour
            new = np.array(
                [xs[columns[0]] - margin, ys[rows[0]] - margin, xs[columns[-1]] + margin, ys[rows[-1]] + margin]
            )
        else:
            new = np.array([0.0, 0.0, width, height])
        left, top, right, bottom = _union(new, width, height)
        cropped = cropped or bool(stretched.any())
    out_width, out_height = right - left, bottom - top
    if out_width * out_height > MAX_PIXELS:
        raise OutputTooLarge(
            f"the panorama would have {out_width}×{out_height} pixels, {MAX_PIXELS // 1_000_000} million at most: "
            "use smaller pictures"
        )
    return Canvas(out_width, out_height, (-left, -top), cropped)


def expected_reach(corners: Array, size: tuple[int, int], target_size: tuple[int, int]) -> tuple[Array, bool]:
    """A rectangle (left, top, right, bottom) that holds the reference and the target's corners, bounded; and whether it
    was cut.

    corners (N, 2): the target's outline in the reference's plane, NaN where it lies behind the reference camera.
    """
    width, height = size
    far = MAX_REACH * max(*size, *target_size)
    finite = corners[np.isfinite(corners).all(axis=1)]
    cut = len(finite) < len(corners)
    lowest = np.array([0.0, 0.0])
    highest = np.array([width, height], np.float64)
    if cut:  # the outline runs to infinity somewhere: look everywhere within reach
        lowest, highest = lowest - far, highest + far
    elif len(finite):
        margin = 0.1 * max(width, height)
        lowest, highest = (
            np.minimum(lowest, finite.min(axis=0) - margin),
            np.maximum(highest, finite.max(axis=0) + margin),
        )
    limit_low, limit_high = np.array([-far, -far]), np.array([width + far, height + far])
    cut = cut or bool((lowest < limit_low).any() or (highest > limit_high).any())
    return np.concatenate([np.maximum(lowest, limit_low), np.minimum(highest, limit_high)]), cut


def _union(box: Array, width: int, height: int) -> tuple[int, int, int, int]:
    return (
        min(0, int(np.floor(box[0]))), min(0, int(np.floor(box[1]))),
        max(width, int(np.ceil(box[2])) + 1), max(height, int(np.ceil(box[3])) + 1),
    )  # fmt: skip


def _inside(target: Array, size: tuple[int, int]) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        return (target >= 0).all(axis=-1) & (target[..., 0] <= size[0] - 1) & (target[..., 1] <= size[1] - 1)


def _area_ratio(target: Array, step: int) -> Array:
    """Target pixels per canvas pixel, from differences between nodes."""
    dx, dy = np.gradient(target, step, axis=1), np.gradient(target, step, axis=0)
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(np.abs(dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]), nan=np.inf)
