"""A grid of rays with inverse depth as a surface, whole or cut where near and far meet. Arrays only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from ...raster.arrays import Array, dilated
from .options import MESH

# Rows and columns of the corners of a cell, counter-clockwise as seen from the viewpoint, the lower left one first.
_CORNERS = ((1, 0), (1, 1), (0, 1), (0, 0))


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """Nodes of a panorama, row by row from the top.

    Attributes
    ----------
    rays : (rows, columns, 3) array
        What each shows, as long as 1 / d is to be taken.
    inverse_depth : (rows, columns) array
        d; NaN where it is not known.
    shows : (rows, columns) bool array
        Where the panorama shows something.
    uvs : (rows, columns, 2) array
        Where it lies in the texture.
    places : (rows, columns, 3) array, optional
        From where each is seen; the origin by default.
    middles : (rows − 1, columns − 1) array, optional
        d in the middle of each cell; by default a cell between near and far counts as far.
    """

    rays: Array
    inverse_depth: Array
    shows: NDArray[np.bool_]
    uvs: Array
    places: Array | None = None
    middles: Array | None = None

    def ended(self, farthest: float) -> DepthGrid:
        """The same with all beyond `farthest` times the median range, infinity (d ≤ 0) too, at that range.

        Raises ValueError where nothing lies nearer than infinity.
        """
        return replace(self, inverse_depth=np.maximum(self.inverse_depth, self._least(farthest)))

    def nearer(self, farthest: float) -> DepthGrid:
        """The same that shows nothing of what lies beyond. Raises as `ended`."""
        return replace(self, shows=self.shows & (self.inverse_depth > self._least(farthest)))

    def _least(self, farthest: float) -> float:
        near = self.inverse_depth[self.shows & (self.inverse_depth > 0)]
        if not near.size:
            raise ValueError("the panorama has no depth: nothing of it lies nearer than infinity")
        return float(np.median(near)) / farthest


@dataclass(frozen=True)
class Surface:
    """vertices (N, 3); faces (M, 4) of vertex indices, seen from the viewpoint counter-clockwise; uvs (N, 2)."""

    vertices: Array
    faces: NDArray[np.int32]
    uvs: Array


def whole_surface(grid: DepthGrid, farthest: float = MESH.farthest) -> Surface:
    """All of a grid as one surface.

    A face is left out where the panorama shows nothing at all four corners, or depth is not known at one.

    Parameters
    ----------
    grid : DepthGrid
    farthest : float
        Median ranges, where everything beyond ends.

    Returns
    -------
    Surface

    Raises
    ------
    ValueError
        There is no depth.
    """
    grid = grid.ended(farthest)
    there = _there(grid)
    return _joined(grid, there, np.zeros(0, np.intp), np.zeros((0, 4)))


def cut_surface(grid: DepthGrid, farthest: float = MESH.farthest) -> Surface:
    """A grid as a surface that is cut where near and far meet.

    A face whose plane almost passes through the viewpoint is a skin between near and far, or a spike. Slopes of a few
    such faces become steps. A cell across a step goes to that side which its middle lies on, and is continued from
    there: seen from the viewpoint, nothing is missing.

    Parameters
    ----------
    grid : DepthGrid
        With its middles.
    farthest : float
        Median ranges, where everything beyond ends.

    Returns
    -------
    Surface

    Raises
    ------
    ValueError
        There is no depth.
    """
    grid = grid.ended(farthest)
    least = _least_distance(grid)
    across, down, wide = _stepped(grid, least)
    if wide is not None:
        grid = wide.grid
        across, down = _cuts(grid, least)
        across &= ~(wide.nodes[:, 1:] | wide.nodes[:, :-1])
        down &= ~(wide.nodes[1:] | wide.nodes[:-1])
    there = _there(grid)
    # along the ring of corners: below, right, above, left
    cuts = np.stack([across[1:], down[:, 1:], across[:-1], down[:, :-1]], axis=-1)
    torn = there & cuts.any(axis=-1)
    cells = np.flatnonzero(torn)
    return _joined(grid, there & ~torn, cells, _one_sided(grid, cuts.reshape(-1, 4)[cells], cells))


@dataclass(frozen=True, eq=False)
class _Stepped:
    """A grid whose narrow slopes became steps; nodes (rows, columns): those of slopes too wide to be steps."""

    grid: DepthGrid
    nodes: NDArray[np.bool_]


def _least_distance(grid: DepthGrid) -> float:
    """By which the plane of a face has to pass the viewpoint."""
    d = _per_unit_ray(grid)[grid.shows & np.isfinite(grid.inverse_depth)]
    return MESH.least_distance / float(np.percentile(d, 100 - MESH.near_percentile))


def _per_unit_ray(grid: DepthGrid) -> Array:
    """Inverse range (rows, columns)."""
    per_unit: Array = grid.inverse_depth / np.linalg.norm(grid.rays, axis=-1)
    return per_unit


def _cuts(grid: DepthGrid, least: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Between which neighbours in a row (rows, columns − 1), and in a column (rows − 1, columns), the line from one
    point to the other passes nearer than `least` to the viewpoint."""
    unit = grid.rays / np.linalg.norm(grid.rays, axis=-1, keepdims=True)
    d, found = _per_unit_ray(grid), []
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        between = unit[other] - unit[one]
        # sines and cosines of small angles, from the chord
        chord = np.sum(between**2, axis=-1)
        sine = np.sqrt(chord * np.maximum(1 - chord / 4, 0))
        apart = np.sqrt((d[one] - d[other]) ** 2 + d[one] * d[other] * chord)
        with np.errstate(invalid="ignore"):
            found.append(apart * least > sine)
    return found[0], found[1]


def _stepped(
    grid: DepthGrid, least: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], _Stepped | None]:
    """The cuts of a grid (see `_cuts`), and the same grid with steps; None if it has no slopes."""
    across, down = _cuts(grid, least)
    loose = np.zeros(grid.shows.shape, bool)
    loose[:, 1:-1] |= across[:, 1:] & across[:, :-1]
    loose[1:-1] |= down[1:] & down[:-1]
    # both ends of a slope are less steep
    loose = dilated(loose, 1)
    if not loose.any() or loose.all():
        return across, down, None
    far, nearest = distance_transform_edt(loose, return_indices=True)
    wide = dilated(far > MESH.ramp_nodes, 2 * MESH.ramp_nodes) & loose
    steps = loose & ~wide
    d = _per_unit_ray(grid)
    stepped = np.where(steps, d[tuple(nearest)] * np.linalg.norm(grid.rays, axis=-1), grid.inverse_depth)
    return across, down, _Stepped(replace(grid, inverse_depth=stepped), wide)


def _there(grid: DepthGrid) -> NDArray[np.bool_]:
    """Which cells (rows − 1, columns − 1) have a face."""
    known = np.isfinite(grid.inverse_depth)
    shown, there = (
        np.stack([mask[1:, :-1], mask[1:, 1:], mask[:-1, 1:], mask[:-1, :-1]]) for mask in (grid.shows, known)
    )
    faces: NDArray[np.bool_] = shown.any(axis=0) & there.all(axis=0)
    return faces


def _one_sided(grid: DepthGrid, cuts: NDArray[np.bool_], cells: NDArray[np.intp]) -> Array:
    """d (M, 4) at the corners of cells across a step: of the side that the middle lies on; cuts (M, 4): between each
    corner and the next one."""
    rows, columns = grid.shows.shape
    d = _of_corners(_per_unit_ray(grid), cells)
    if grid.middles is None:
        first = d.argmin(axis=1)
    else:
        lengths = np.linalg.norm(grid.rays, axis=-1)
        middle = grid.middles.ravel()[cells] / _of_corners(lengths, cells).mean(axis=1)
        first = np.abs(d - middle[:, None]).argmin(axis=1)
    turned = (first[:, None] + np.arange(4)) % 4
    one_way = ~np.take_along_axis(cuts, turned, axis=1)
    # corners that hang together with the first one, either way round
    onwards = np.logical_and.accumulate(one_way[:, :3], axis=1)
    backwards = np.logical_and.accumulate(one_way[:, :0:-1], axis=1)[:, ::-1]
    same = np.concatenate([np.ones((len(cells), 1), bool), onwards | backwards], axis=1)
    values = np.take_along_axis(d, turned, axis=1)
    mean = (values * same).sum(axis=1) / same.sum(axis=1)
    values = np.where(same, values, mean[:, None])
    out = np.empty_like(values)
    np.put_along_axis(out, turned, values, axis=1)
    per_ray: Array = out * _of_corners(np.linalg.norm(grid.rays, axis=-1), cells)
    return per_ray


def _of_corners(values: NDArray[Any], cells: NDArray[np.intp]) -> NDArray[Any]:
    """Values (rows, columns, …) at the four corners (M, 4, …) of cells."""
    width = values.shape[1] - 1
    row, column = cells // width, cells % width
    corners: NDArray[Any] = np.stack([values[row + down, column + right] for down, right in _CORNERS], axis=1)
    return corners


def _joined(grid: DepthGrid, faces: NDArray[np.bool_], cells: NDArray[np.intp], d: Array) -> Surface:
    """The surface of cells that share their corners, and of `cells` that have corners of their own at d (M, 4)."""
    rows, columns = grid.shows.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    shared = _of_corners(at, np.flatnonzero(faces))
    used, shared = np.unique(shared, return_inverse=True)
    flat = [None if one is None else one.reshape(rows * columns, -1) for one in (grid.rays, grid.uvs, grid.places)]
    rays, uvs, places = flat
    assert rays is not None and uvs is not None
    vertices = [_points(grid.inverse_depth.ravel()[used], rays[used], None if places is None else places[used])]
    own = _of_corners(at, cells).ravel()
    vertices.append(_points(d.ravel(), rays[own], None if places is None else places[own]))
    further = len(used) + np.arange(len(own)).reshape(-1, 4)
    return Surface(
        np.concatenate(vertices), np.concatenate([shared.reshape(-1, 4), further]).astype(np.int32),
        np.concatenate([uvs[used], uvs[own]]),
    )  # fmt: skip


def _points(inverse_depth: Array, rays: Array, places: Array | None) -> Array:
    """The points (N, 3) of rays (N, 3) at d (N,), seen from places (N, 3), None for the origin."""
    points: Array = rays / inverse_depth[..., None]
    return points if places is None else points + places
