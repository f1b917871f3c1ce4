"""Puts the edges of depth where the reference has an edge.

A window that is matched makes near things wider than they are, and what lies between two surfaces belongs to neither.
So near an edge of depth each node may also have what was found nearer or farther just beside it. It takes the one by
which the pictures look most alike, averaged along the edges of the reference (cost-volume filtering: Rhemann et al.,
CVPR 2011), if that is clearly better than what it had. What would lie behind something nearer cannot be compared with
the target: it costs as much as a poor match.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .edge_aware_smoothing import Smoother
from .epipolar_lines import EpipolarLines, Places
from .jumps import Jumps
from .matching import ComparedPicture, comparable_levels
from .options import OUTLINES
from .tones import tone_curves

Indices = tuple[Places, Places]
"""Rows and columns of nodes or cells (…)."""


def at_outlines(
    lines: EpipolarLines, along: Plane, across: Plane, found: Plane,
    edges: tuple[NDArray[np.float32], NDArray[np.float32]], views: tuple[ComparedPicture, ComparedPicture],
) -> Plane:  # fmt: skip
    """Moves along the lines (h, w) px whose jumps lie on edges of the reference.

    Parameters
    ----------
    lines : EpipolarLines
    along, across : (h, w) float32 arrays
        Moves along the lines and across them, px.
    found : (h, w) float32 array
        0..1, how surely each node was found.
    edges : pair of float32 arrays
        Connections of neighbours in the reference (see `edge_weights`).
    views : (ComparedPicture, ComparedPicture)
        Reference and target.

    Returns
    -------
    (h, w) float32 array
    """
    jumps = Jumps.of(along, found >= OUTLINES.example, OUTLINES.reach)
    if jumps is None:
        return along
    compared = _Compared.of(lines, along, across, found, views)
    places = _in_rows(*np.nonzero(jumps.near))
    own = compared.costs(along, across, places)
    # a guess is no better than the surface behind
    guessed = found[places] < OUTLINES.example
    own[guessed] = np.maximum(own[guessed], compared.behind) + 2 * OUTLINES.least_gain
    gains = []
    for other in (jumps.nearest, jumps.farthest):
        gain = np.zeros_like(along)
        gain[places] = own - compared.costs(other, across, places)
        gains.append(gain)
    return jumps.settled(along, gains, Smoother.of(edges, OUTLINES.smoothness, passes=1))


def _in_rows(row: Places, column: Places) -> Indices:
    """Indices (n,) as (m, `OUTLINES.row`) indices, some of them twice: OpenCV's pictures have bounded sides."""
    short = -row.size % OUTLINES.row
    row, column = (np.append(at, np.repeat(at[:1], short)).reshape(-1, OUTLINES.row) for at in (row, column))
    return row, column


@dataclass(frozen=True)
class _Compared:
    """The pictures in the same tones, and what the target shows where.

    reference (h, w, C) uint8 at the nodes, target (h', w', C) uint8; nearest: inverse depth of the nearest that falls
    on cells of the target; behind: what a node costs that lies behind something nearer.
    """

    lines: EpipolarLines
    picture: ComparedPicture
    reference: NDArray[np.uint8]
    target: NDArray[np.uint8]
    nearest: Plane
    behind: float

    @staticmethod
    def of(
        lines: EpipolarLines, along: Plane, across: Plane, found: Plane, views: tuple[ComparedPicture, ComparedPicture]
    ) -> _Compared:
        """By the moves as they are."""
        levels, target = comparable_levels(*views)
        reference, shown = views[0].at_nodes(levels, lines)
        row, column = np.mgrid[tuple(slice(0, side, OUTLINES.every) for side in along.shape)]
        some = row, column
        x, y = lines.target(along, across, some)
        other, also_shown = views[1].sample(target, x, y)
        both = shown[some] & also_shown & (found[some] >= OUTLINES.sure)
        if both.any():
            curves = tone_curves(reference[some], other, both, 256)
            target = np.dstack([curve[target[..., k]] for k, curve in enumerate(curves)])
        nearest = _nearest(lines, along[some], x, y, some, views[1].size)
        compared = _Compared(lines, views[1], reference.reshape(*along.shape, -1), target, nearest, np.inf)
        costs = compared.costs(along, across, some)[both]
        costs = costs[np.isfinite(costs)]
        usual = float(np.percentile(costs, OUTLINES.usual_percentile)) if costs.size else 0.0
        return replace(compared, behind=max(OUTLINES.min_behind, OUTLINES.behind * usual))

    def costs(self, along: Plane, across: Plane, places: Indices) -> NDArray[np.float32]:
        """Gray levels (…) by which the pictures differ at nodes with these row and column indices, after moves (h, w)
        px."""
        x, y = self.lines.target(along, across, places)
        levels, shown = self.picture.sample(self.target, x, y)
        # OpenCV leaves out the axis of a single channel
        difference = cv2.absdiff(self.reference[places], levels.reshape(*x.shape, -1)).reshape(*x.shape, -1)
        cost = np.minimum(difference.mean(axis=-1, dtype=np.float32), np.float32(OUTLINES.max_levels))
        ahead = along[places] + np.float32(OUTLINES.same_px)
        depth = self.lines.inverse_depth[places] + ahead * self.lines.depth_per_px[places]
        hidden = self.nearest[_cells(x, y, self.nearest.shape)] > depth
        return np.where(shown & ~hidden, cost, np.float32(self.behind))


def _nearest(
    lines: EpipolarLines, along: NDArray[np.float32], x: NDArray[np.float32], y: NDArray[np.float32],
    places: Indices, size: tuple[int, int],
) -> Plane:  # fmt: skip
    """The largest inverse depth that falls on each cell of a picture of (W, H) px, of nodes with these row and column
    indices, their moves (…) and where they are seen, px x and y (…); −inf where none does."""
    width, height = (int(side / OUTLINES.cell_px) + 1 for side in size)
    nearest = np.full((height, width), -np.inf, np.float32)
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= size[0] - 1) & (y <= size[1] - 1)
    row, column = (part[inside] for part in _cells(x, y, nearest.shape))
    depth = (lines.inverse_depth[places] + along * lines.depth_per_px[places])[inside]
    np.maximum.at(nearest, (row, column), depth)
    return nearest


def _cells(x: NDArray[np.float32], y: NDArray[np.float32], shape: tuple[int, ...]) -> Indices:
    """Row and column indices (…) of the cells of the target at px x, y (…), at the border those of the border."""
    row, column = (
        np.clip(np.nan_to_num(at) * np.float32(1 / OUTLINES.cell_px), 0, side - 1).astype(np.intp)
        for at, side in zip((y, x), shape, strict=True)
    )
    return row, column
