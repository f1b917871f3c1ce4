"""A chart of the sphere of rays around the viewpoint, or of part of it: longitude across, latitude down, evenly spaced.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, angle_of


@dataclass(frozen=True, eq=False)
class SphereChart:
    """Nodes (h, w), in a window of those (`height`, 2 `height`) of the whole sphere.

    rotation (3, 3): from the chart's axes (x right, y down, z ahead) to those of the rays; height: nodes from pole to
    pole; top, left: row and column of the whole sphere at which the window begins; shape: (h, w). Node (row, column) of
    the whole sphere looks at longitude (column + ½) π / height − π and latitude (row + ½) π / height − π / 2.
    """

    rotation: Array
    height: int
    top: int
    left: int
    shape: tuple[int, int]

    @staticmethod
    def whole(rotation: Array, height: int) -> SphereChart:
        """The whole sphere."""
        return SphereChart(rotation, height, 0, 0, (height, 2 * height))

    def smaller(self, times: int) -> SphereChart:
        """The same with so many times fewer nodes on a side; all measures are multiples of that."""
        rows, columns = (side // times for side in self.shape)
        return replace(
            self, height=self.height // times, top=self.top // times, left=self.left // times, shape=(rows, columns)
        )

    @property
    def circumference(self) -> int:
        """Nodes all around the sphere."""
        return 2 * self.height

    @property
    def closed(self) -> bool:
        """Whether its last column lies beside its first."""
        return self.shape[1] == self.circumference

    @property
    def per_radian(self) -> float:
        """Nodes per radian, in the middle."""
        return self.height / np.pi

    def rays(self, rows: Array, columns: Array) -> Array:
        """Unit rays (m, n, 3) where some rows (m,) and columns (n,), which need not be whole or lie within the chart,
        cross."""
        across = (columns + self.left + 0.5) / self.per_radian - np.pi
        down = ((rows + self.top + 0.5) / self.per_radian - np.pi / 2)[:, None]
        level = np.cos(down)
        own = np.stack(np.broadcast_arrays(level * np.sin(across), np.sin(down), level * np.cos(across)), axis=-1)
        rays: Array = own @ self.rotation.T
        return rays

    @property
    def all_rays(self) -> Array:
        """Unit rays (h, w, 3) of all nodes."""
        return self.rays(*(np.arange(side, dtype=np.float64) for side in self.shape))

    def places(self, rays: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Columns and rows (…) at which rays (…, 3) of any length lie; those beyond the chart on the nearer side."""
        kind = rays.dtype.type
        x, y, z = np.moveaxis(rays @ self.rotation.astype(rays.dtype), -1, 0)
        beyond = (self.circumference - self.shape[1]) / 2
        column = (angle_of(x, z) + kind(np.pi)) * kind(self.per_radian) + kind(beyond - self.left - 0.5)
        column = column % kind(self.circumference) - kind(beyond)
        row = (angle_of(y, np.hypot(x, z)) + kind(np.pi / 2)) * kind(self.per_radian) - kind(self.top + 0.5)
        return column, row
