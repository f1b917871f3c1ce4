"""The nodes over the target picture at which its inverse depth δ = 1 / Z' is solved for (docs/method.md, 5)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..cameras.projective import homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..raster.arrays import Array
from ..raster.grid import Grid
from .options import GRID


@dataclass(frozen=True)
class TargetGrid:
    """Nodes over the target and a margin around it.

    Attributes
    ----------
    view : View
        Of the target.
    grid : Grid
        Nodes in ideal px of the target.
    down : (3,) array
        Unit vector along gravity in the target camera's frame.
    """

    view: View
    grid: Grid
    down: Array

    @staticmethod
    def over(view: View, down: Array) -> TargetGrid:
        """The grid over a view's picture; down (3,) in that camera's frame."""
        width, height = view.size
        step = max(1, -(-max(width, height) // GRID.nodes))
        margin = int(np.ceil(GRID.margin * GRID.nodes))
        columns, rows = (-(-(side - 1) // step) + 1 + 2 * margin for side in (width, height))
        return TargetGrid(view, Grid((-margin * step - (step - 1) // 2,) * 2, step, columns, rows), down)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of nodes."""
        return self.grid.rows, self.grid.columns

    @property
    def first_px(self) -> tuple[int, int]:
        """The pixel (x, y) of the target at or just before the first node."""
        return int(np.floor(self.grid.xs[0])), int(np.floor(self.grid.ys[0]))

    @cached_property
    def numbers(self) -> NDArray[np.intp]:
        """Numbers (rows, columns) of the unknowns, counted along the shorter side: neighbours are close in them."""
        rows, columns = self.shape
        if columns <= rows:
            return np.arange(rows * columns).reshape(rows, columns)
        return np.arange(rows * columns).reshape(columns, rows).T

    @cached_property
    def rays(self) -> Array:
        """Rays r' = K'⁻¹ x' (rows, columns, 3) of the nodes."""
        return self.rays_of(self.grid.points)

    @cached_property
    def sensitivity(self) -> Array:
        """px (rows, columns) that a node moves in the panorama per unit of δ, bounded from below."""
        return self.bounded_sensitivity(self.rays)

    @cached_property
    def level_range(self) -> Array:
        """λ = |r' − (r'·g) g| (rows, columns): δ / λ is constant along what is upright."""
        return self.level_range_of(self.rays)

    @cached_property
    def in_picture(self) -> NDArray[np.bool_]:
        """Nodes (rows, columns) that lie in the target."""
        points = self.grid.points
        inside: NDArray[np.bool_] = ((points >= 0) & (points <= np.array(self.view.size) - 1.0)).all(axis=-1)
        return inside

    def by_number(self, values: Array) -> Array:
        """Values (rows, columns, …) of the nodes in the order of their numbers (N, …)."""
        out = np.empty((self.numbers.size, *values.shape[2:]), values.dtype)
        out[self.numbers] = values
        return out

    def rays_of(self, points: Array) -> Array:
        """Rays (…, 3) of ideal pixels (…, 2), with r'_z = 1."""
        rays: Array = homogeneous(points) @ inverse_intrinsics(self.view.K).T
        return rays

    def sensitivity_of(self, rays: Array) -> Array:
        """f |t × r'| / |r'|² (…): px of a picture of `GridOptions.side_px` per unit of δ, for rays (…, 3)."""
        K = self.view.K
        focal = np.sqrt(K[0, 0] * K[1, 1]) * GRID.side_px / max(self.view.size)
        result: Array = focal * np.linalg.norm(np.cross(rays, self.view.t), axis=-1) / np.square(rays).sum(axis=-1)
        return result

    def bounded_sensitivity(self, rays: Array) -> Array:
        """The same, at least a share of the greatest over the nodes."""
        greatest = self.sensitivity_of(self.rays).max()
        result: Array = np.maximum(self.sensitivity_of(rays), GRID.min_sensitivity * greatest)
        return result

    def level_range_of(self, rays: Array) -> Array:
        """See `level_range`; away from 0 for rays (…, 3) that point straight down."""
        result: Array = np.sqrt(np.maximum(np.square(rays).sum(axis=-1) - np.square(rays @ self.down), 0.09))
        return result

    def taps(self, points: Array) -> tuple[NDArray[np.intp], Array]:
        """Numbers (N, 4) of the nodes around points (N, 2), and their bilinear weights (N, 4)."""
        place = (points - np.array(self.grid.start) - (self.grid.step - 1) / 2) / self.grid.step
        rows, columns = self.shape
        place = np.clip(place, 0, [columns - 1 - 1e-6, rows - 1 - 1e-6])
        first = place.astype(np.intp)
        a, b = np.moveaxis(place - first, -1, 0)
        i, j = np.moveaxis(first, -1, 0)
        nodes = np.stack([self.numbers[j + down, i + right] for down in (0, 1) for right in (0, 1)], axis=1)
        weights: Array = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=1)
        return nodes, weights

    def gathered(self, points: Array, values: Array) -> Array:
        """Sums (rows, columns, …) over points (N, 2) of values (N[, k]), shared out to the four nodes around each."""
        nodes, weights = self.taps(points)
        flat = values.reshape(len(points), -1)
        sums = np.zeros((self.numbers.size, flat.shape[1]))
        for k, column in enumerate(flat.T):
            sums[:, k] = np.bincount(nodes.ravel(), (weights * column[:, None]).ravel(), self.numbers.size)
        at_nodes: Array = sums[self.numbers].reshape(*self.shape, *values.shape[1:])
        return at_nodes

    def panorama_rays(self, inverse_depth: Array) -> Array:
        """Vectors Rᵀ (r' − δ t) (rows, columns, 3) towards the nodes from the reference's place, in its frame."""
        result: Array = (self.rays - inverse_depth[..., None] * self.view.t) @ self.view.R
        return result
