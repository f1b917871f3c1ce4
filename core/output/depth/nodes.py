"""Where the nodes of a panorama's surface lie, and the inverse depth there and between."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array

if TYPE_CHECKING:
    from ...pipeline import StitchResult

Columns = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class DepthNodes:
    """A grid over all of a panorama, from border to border.

    Attributes
    ----------
    x, y : (columns,), (rows,) arrays
        px, from −½ to the last one + ½.
    inverse_depth : (rows, columns) array
        NaN where it is not known. A whole sphere is closed: the last column is the first one, and each pole one value.
    middles : (rows − 1, columns − 1) array
        The same in the middle of each cell.
    shows : (rows, columns) bool array
        Where the panorama shows something.
    """

    x: Array
    y: Array
    inverse_depth: Array
    middles: Array
    shows: NDArray[np.bool_]

    def to_bytes(self) -> bytes:
        """As `from_bytes` takes them; depths as single floats."""
        file = io.BytesIO()
        depths = {name: getattr(self, name).astype(np.float32) for name in ("inverse_depth", "middles")}
        np.savez_compressed(file, x=self.x, y=self.y, shows=self.shows, **depths)
        return file.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> DepthNodes:
        """What `to_bytes` gave."""
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            d, middles = (file[name].astype(np.float64) for name in ("inverse_depth", "middles"))
            return cls(file["x"], file["y"], d, middles, file["shows"])


def nodes_of(
    read: Callable[[Columns, Columns], Array], alpha: NDArray[Any], known: int, most: int, is_sphere: bool
) -> DepthNodes:
    """Nodes so dense that about `most` of them lie where depth is known.

    Parameters
    ----------
    read : callable
        read(rows, columns) -> inverse depth (len(rows), len(columns)) at px.
    alpha : (H, W) array
        Of the panorama.
    known : int
        px where depth is known.
    most : int
    is_sphere : bool
        Whether it is a whole one, whose sides meet.

    Returns
    -------
    DepthNodes
    """
    height, width = alpha.shape
    step = max(1.0, float(np.sqrt(known / most)))
    x, y = (np.linspace(-0.5, side - 0.5, max(1, int(side / step)) + 1) for side in (width, height))
    at = _nearest(y, height), _nearest(x, width)
    d = read(*at)
    middles = read(_nearest((y[1:] + y[:-1]) / 2, height), _nearest((x[1:] + x[:-1]) / 2, width))
    d = _beside_unknown(d, middles)
    if is_sphere:
        d[:, -1] = d[:, 0]
        for pole in (0, -1):
            if np.isfinite(d[pole]).any():
                d[pole] = np.nanmean(d[pole])
    return DepthNodes(x, y, d, middles, alpha[np.ix_(*at)] > 0)


def depth_nodes(result: StitchResult, most: int) -> DepthNodes:
    """Of a finished panorama, with d (docs/method.md) as the rays of its canvas have it.

    Parameters
    ----------
    result : StitchResult
    most : int
        See `nodes_of`.

    Returns
    -------
    DepthNodes
    """
    depth: Any = result.in_full(result.warp.depth, np.nan)
    alpha = result.panorama.alpha
    width = alpha.shape[1]

    def read(rows: Columns, columns: Columns) -> Array:
        return np.stack([np.asarray(depth[row : row + 1, 0:width], np.float64)[0, columns] for row in rows.tolist()])

    return nodes_of(read, alpha, int(np.count_nonzero(alpha)), most, is_whole_sphere(result))


def is_whole_sphere(result: StitchResult) -> bool:
    """Whether a panorama shows all of a sphere, so that its sides meet."""
    canvas = result.canvas
    sphere = None if canvas.projection is None else canvas.projection.sphere
    return sphere is not None and sphere[2:] == (canvas.width, canvas.height)


def _nearest(at: Array, side: int) -> Columns:
    """The px nearest to places along a side."""
    return np.clip(np.rint(at), 0, side - 1).astype(np.intp)


def _beside_unknown(d: Array, middles: Array) -> Array:
    """Inverse range (rows, columns), where a node knows none that of the middle of a cell beside it."""
    out = d.copy()
    for rows, columns in product((slice(1, None), slice(0, -1)), repeat=2):
        here = out[rows, columns]
        np.copyto(here, middles, where=np.isnan(here))
    return out
