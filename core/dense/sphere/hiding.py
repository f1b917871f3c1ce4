"""What pictures cannot see of a patch, by the inverse ranges found on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane
from ...raster.picture_map import falls_inside
from ..options import OUTLINES
from .choice import Compared
from .options import SPHERE_OUTLINES


def nearest_on(compared: Compared, d: Plane) -> list[Plane]:
    """For each picture the largest inverse range that falls on each of its cells, −inf where none does."""
    found = []
    for seen in compared.seen:
        x, y = seen.places(d)
        height, width = seen.picture.levels.shape[:2]
        cell = SPHERE_OUTLINES.cell_px
        nearest = np.full((int(height / cell) + 1, int(width / cell) + 1), -np.inf, np.float32)
        inside = falls_inside(x, y, (width, height))
        np.maximum.at(nearest, _cells(x[inside], y[inside], nearest.shape), d[inside])
        found.append(nearest)
    return found


def hidden_from(compared: Compared, d: Plane, nearest: list[Plane] | None = None) -> list[NDArray[np.bool_]]:
    """Which nodes (h, w) at inverse ranges (h, w) each picture does not see, since something nearer falls on the same
    cell; nearest: see `nearest_on`, of these ranges themselves if not given."""
    nearest = nearest_on(compared, d) if nearest is None else nearest
    margin = np.float32(OUTLINES.same_px) * compared.per_px
    return [
        cells[_cells(*seen.places(d), cells.shape)] > d + margin
        for seen, cells in zip(compared.seen, nearest, strict=True)
    ]


def _cells(x: Plane, y: Plane, shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row and column of the cells at px x, y (…), at the border those of the border."""
    scale = np.float32(1 / SPHERE_OUTLINES.cell_px)
    row, column = (np.clip(at * scale, 0, side - 1).astype(np.intp) for at, side in zip((y, x), shape, strict=True))
    return row, column
