"""How a field fades outside the overlap."""

from __future__ import annotations

import numpy as np

from ..raster.arrays import Array
from ..raster.distance import outside
from ..raster.grid import Grid
from .options import FADE
from .spline import ThinPlateSpline


def on_nodes(spline: ThinPlateSpline, grid: Grid, ideal: Array | None) -> Array:
    """Values (rows, columns[, k]) of a spline at a grid's nodes, or at their ideal pixels."""
    if ideal is None:
        return spline.on_axes(grid.xs, grid.ys)
    values = spline.at(ideal.reshape(-1, 2))
    return values.reshape(*ideal.shape[:2], *values.shape[1:])


def outside_overlap(grid: Grid, target: Array, size: tuple[int, int], target_size: tuple[int, int]) -> Array:
    """How many px (rows, columns) a grid's nodes lie outside the overlap; inf where there is none.

    target (rows, columns, 2): where the field, not faded, sends the nodes; a node belongs to the overlap when it lies
    in the reference and that in the target.
    """
    inside = (grid.points >= 0).all(axis=-1) & (grid.points <= np.array(size) - 1).all(axis=-1)
    with np.errstate(invalid="ignore"):
        inside &= (target >= 0).all(axis=-1) & (target <= np.array(target_size) - 1).all(axis=-1)
    return outside(inside, grid.step)


def fading(away: Array, width: float) -> Array:
    """α: 1 where `away` is 0, smoothly to 0 where it is `width`."""
    u = np.minimum(away / width, 1.0)
    return 1 - u * u * (3 - 2 * u)


def fade_width(moved_px: Array, noise_scale: float) -> float:
    """Width (px) over which a field fades that moves its matches by moved_px (N,): five times its robust maximum."""
    return max(FADE.length * float(np.percentile(moved_px, 98)), FADE.min_px * noise_scale)
