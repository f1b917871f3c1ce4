"""How a field fades outside the overlap."""

from __future__ import annotations

import numpy as np

from ..raster.arrays import Array
from ..raster.distance import outside
from ..raster.grid import Grid
from .options import FADE
from .spline import ThinPlateSpline


def on_nodes(spline: ThinPlateSpline, grid: Grid, ideal: Array | None) -> Array:
    """Values (rows, columns[, k]) of a spline at a grid's nodes, or at their undistorted pixels `ideal` if given."""
    if ideal is None:
        return spline.on_axes(grid.xs, grid.ys)
    values = spline.at(ideal.reshape(-1, 2))
    return values.reshape(*ideal.shape[:2], *values.shape[1:])


def outside_overlap(grid: Grid, target: Array, size: tuple[int, int], target_size: tuple[int, int]) -> Array:
    """Distance of a grid's nodes from the overlap.

    Parameters
    ----------
    grid : Grid
        Nodes on the reference's plane.
    target : (rows, columns, 2) array
        Target pixels that the field predicts for the nodes before it fades. A node belongs to the overlap when it lies
        in the reference and its prediction in the target.
    size, target_size : (int, int)
        (W, H) px of the reference and of the target.

    Returns
    -------
    (rows, columns) array
        px of the reference's plane, 0 in the overlap; inf everywhere if there is no overlap.
    """
    inside = (grid.points >= 0).all(axis=-1) & (grid.points <= np.array(size) - 1).all(axis=-1)
    with np.errstate(invalid="ignore"):
        inside &= (target >= 0).all(axis=-1) & (target <= np.array(target_size) - 1).all(axis=-1)
    return outside(inside, grid.step)


def fading(distance: Array, width: float) -> Array:
    """Weight α (…): 1 at distance 0, falling smoothly (3u² − 2u³) to 0 at distance `width`; both in px."""
    u = np.minimum(distance / width, 1.0)
    result: Array = 1 - u * u * (3 - 2 * u)
    return result


def fade_width(displacement_px: Array, noise_scale: float) -> float:
    """Width (px) over which a field fades that displaces its matches by displacement_px (N,); noise_scale: the matches'
    unit of noise, px."""
    return max(FADE.length * float(np.percentile(displacement_px, 98)), FADE.min_px * noise_scale)
