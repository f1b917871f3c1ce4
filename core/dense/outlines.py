"""Puts the edges of depth where the reference has an edge.

A window that is matched makes near things wider than they are, and what lies between two surfaces belongs to neither.
So near an edge of depth each node may also have what was found nearer or farther just beside it. It takes the one by
which the pictures look most alike, averaged along the edges of the reference (cost-volume filtering: Rhemann et al.,
CVPR 2011), if that is clearly better than what it had. What would lie behind something nearer cannot be compared with
the target: it costs as much as a poor match.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Plane
from .edge_aware_smoothing import Smoother
from .epipolar_lines import EpipolarLines, Places
from .matching import ComparedPicture, comparable_levels, tone_curves
from .options import OUTLINES

# row and column indices
Places2 = tuple[Places, Places]


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
    rough = cv2.medianBlur(along, OUTLINES.median_nodes)
    around = np.ones((2 * OUTLINES.reach + 1,) * 2, np.uint8)
    near_jump = cv2.dilate((_spread(rough, np.ones((3, 3), np.uint8)) > OUTLINES.jump_px).view(np.uint8), around) > 0
    if not near_jump.any():
        return along
    near, far = _beside(rough, along, np.maximum(found, np.float32(OUTLINES.unfound)), around)
    compared = _Compared.of(lines, along, across, found, views)
    places = _in_rows(np.nonzero(near_jump))
    own = compared.costs(along, across, places)
    better = []
    for other in (near, far):
        gain = np.zeros_like(along)
        gain[places] = own - compared.costs(other, across, places)
        better.append(gain)
    gains = Smoother.of(edges, OUTLINES.smoothness, passes=1).averaged(better)
    chosen = np.where(gains[0] > gains[1], near, far)
    clearly = near_jump & (np.maximum(*gains) > OUTLINES.least_gain) & (np.abs(chosen - along) > OUTLINES.least_px)
    return np.where(clearly, chosen, along)


def _in_rows(places: Places2) -> Places2:
    """Indices (…) as (m, row) indices, some of them twice: OpenCV's pictures have bounded sides."""
    short = -places[0].size % OUTLINES.row
    row, column = (np.concatenate([at, np.repeat(at[:1], short)]).reshape(-1, OUTLINES.row) for at in places)
    return row, column


def _spread(values: Plane, window: NDArray[np.uint8]) -> Plane:
    """Largest minus smallest value (h, w) in a window around each."""
    spread: Plane = cv2.dilate(values, window) - cv2.erode(values, window)
    return spread


def _beside(rough: Plane, along: Plane, weight: Plane, window: NDArray[np.uint8]) -> tuple[Plane, Plane]:
    """The means (h, w), weighted, of the nearest and of the farthest of the moves (h, w) in a window; rough: the same
    without specks."""
    nearest, farthest = cv2.dilate(rough, window), cv2.erode(rough, window)
    share = np.float32(OUTLINES.side_share) * (nearest - farthest)

    def mean(those: NDArray[np.bool_], otherwise: Plane) -> Plane:
        counted = weight * those
        total = cv2.blur(counted, window.shape)
        sums = cv2.blur(counted * along, window.shape)
        return np.divide(sums, total, out=otherwise, where=total > np.float32(OUTLINES.unfound) / window.size)

    return mean(along > nearest - share, nearest), mean(along < farthest + share, farthest)


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
        curves = tone_curves(reference[some], other, both, 256) if both.any() else [np.arange(256, dtype=np.uint8)] * 3
        target = np.dstack([curve[channel] for curve, channel in zip(curves, cv2.split(target), strict=True)])
        nearest = _nearest(lines, along[some], x, y, some, views[1].size)
        compared = _Compared(lines, views[1], reference.reshape(*along.shape, -1), target, nearest, np.inf)
        costs = compared.costs(along, across, some)[both]
        costs = costs[np.isfinite(costs)]
        usual = float(np.percentile(costs, OUTLINES.usual_percentile)) if costs.size else 0.0
        return _Compared(
            lines, views[1], compared.reference, target, nearest, max(OUTLINES.min_behind, OUTLINES.behind * usual)
        )

    def costs(self, along: Plane, across: Plane, places: Places2) -> NDArray[np.float32]:
        """Gray levels (…) by which the pictures differ at nodes with these row and column indices, after moves (h, w)
        px."""
        x, y = self.lines.target(along, across, places)
        levels, shown = self.picture.sample(self.target, x, y)
        difference = cv2.absdiff(self.reference[places], levels.reshape(*x.shape, -1))
        cost = np.minimum(difference.mean(axis=-1, dtype=np.float32), np.float32(OUTLINES.max_levels))
        ahead = along[places] + np.float32(OUTLINES.same_px)
        depth = self.lines.inverse_depth[places] + ahead * self.lines.depth_per_px[places]
        hidden = self.nearest[_cells(x, y, self.nearest.shape)] > depth
        return np.where(shown & ~hidden, cost, np.float32(self.behind))


def _nearest(
    lines: EpipolarLines, along: NDArray[np.float32], x: NDArray[np.float32], y: NDArray[np.float32],
    places: Places2, size: tuple[int, int],
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


def _cells(x: NDArray[np.float32], y: NDArray[np.float32], shape: tuple[int, ...]) -> Places2:
    """Row and column indices (…) of the cells of the target at px x, y (…), at the border those of the border."""
    row, column = (
        np.clip(np.nan_to_num(at) * np.float32(1 / OUTLINES.cell_px), 0, side - 1).astype(np.intp)
        for at, side in zip((y, x), shape, strict=True)
    )
    return row, column
