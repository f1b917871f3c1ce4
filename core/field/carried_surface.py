"""A surface seen from another place: points put on the pixels of an image, the nearest on each, and what lies between.

Every point of the surface is put where it appears. Of several on one pixel the nearest is seen; what none falls on is
taken to lie as far as its farthest neighbour.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Plane, beside, bounds, small_strips, with_margin
from ..raster.pull_push import filled
from ..system.threads import ask, each
from .options import CARRY
from .sphere_chart import SphereChart


def cells_of(chart: SphereChart, rays: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The flat indices of the nodes of a chart above and left of where rays (N, 3) lie, of those that lie on the chart,
    and which (N,) do; a point covers the four nodes around it (see `filled_surface`)."""
    height, width = chart.shape
    column, row = (np.floor(at + CARRY.rounding).astype(np.intp) for at in chart.places(rays))
    column = column % width if chart.closed else column
    there = (row >= -1) & (row < height) & (column >= -1) & (column < width)
    return (np.maximum(row, 0) * width + np.maximum(column, 0))[there], there


def put_nearest(nearest: Plane, cells: NDArray[np.intp], d: NDArray[np.float32]) -> None:
    """Raises values (H, W) at flat indices (N,) to d (N,), where that is more."""
    flat = nearest.ravel()
    # of equal indices NumPy keeps the last, so that what is nearer than that has another try
    nearer = np.flatnonzero(d > flat[cells])
    while nearer.size:
        flat[cells[nearer]] = d[nearer]
        nearer = nearer[d[nearer] > flat[cells[nearer]]]


def filled_surface(nearest: Plane) -> Plane:
    """Inverse depth (H, W) everywhere, from that of points by the cell above and left of each, -1 where none is.

    Gaps that are narrower than a point are closed by it; others go on from their farthest neighbours, and what lies
    beyond all points from those at their bounds.
    """
    part = bounds(nearest >= 0)
    if part is None:
        return np.zeros(nearest.shape, np.float32)
    part = with_margin(part, 1, nearest.shape)
    here: Plane = cv2.dilate(nearest[part], np.ones((2, 2), np.uint8), anchor=(1, 1))
    here = _from_far(_across_gaps(cv2.medianBlur(here, CARRY.speck_px)), CARRY.halvings)
    beyond = [(one.start, side - one.stop) for one, side in zip(part, nearest.shape, strict=True)]
    return np.pad(here, beyond, mode="edge")


def filled_chart(nearest: Plane, closed: bool) -> Plane:
    """The same of the nodes (H, W) of a chart of the sphere, whose last column lies beside its first if it is closed.
    """
    width, margin = nearest.shape[1], CARRY.beside_nodes if closed else 0
    around = np.concatenate([nearest[:, width - margin :], nearest, nearest[:, :margin]], axis=1)
    return np.ascontiguousarray(filled_surface(around)[:, margin : margin + width])


def _across_gaps(values: Plane) -> Plane:
    """Values (H, W), those below 0 within narrow gaps replaced by the lesser of those at both ends of the gap, along
    the row or the column, whichever is shorter: what slides away uncovers what lies behind."""
    missing = np.nonzero(values < 0)
    if not missing[0].size:
        return values
    out, shortest = values.copy(), np.full(missing[0].size, CARRY.widest_gap_px, np.int32)
    for axis in (1, 0):
        count = values.shape[axis]
        places = np.arange(count, dtype=np.int32) if axis else np.arange(count, dtype=np.int32)[:, None]
        known = values >= 0
        before = np.maximum.accumulate(np.where(known, places, np.int32(-1)), axis=axis)[missing]
        after = np.flip(np.minimum.accumulate(np.flip(np.where(known, places, np.int32(count)), axis), axis), axis)
        after = after[missing]
        length = after - before
        nearer = np.flatnonzero((before >= 0) & (after < count) & (length < shortest))
        row, column = (at[nearer] for at in missing)
        shortest[nearer] = length[nearer]
        ends = (
            values[(row, end[nearer]) if axis else (end[nearer], column)] for end in (before, after)
        )
        out[row, column] = np.minimum(*ends)
    return out


def _from_far(values: Plane, halvings: int) -> Plane:
    """Values (H, W), those below 0 replaced by the least around them: near ones first, then by ever coarser cells."""
    missing = values < 0
    if not missing.any():
        return values
    beyond = np.finfo(np.float32).max  # what OpenCV takes for the border too
    out = np.where(missing, beyond, values)
    for _ in range(CARRY.rounds):
        ask()
        grown = cv2.erode(out, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
        np.copyto(out, grown, where=missing)
        missing = out == beyond
        if not missing.any():
            return out
    if halvings:
        height, width = (side + side % 2 for side in out.shape)
        padded = np.pad(out, ((0, height - out.shape[0]), (0, width - out.shape[1])), constant_values=beyond)
        coarse = padded.reshape(height // 2, 2, width // 2, 2).min(axis=(1, 3))
        coarse = _from_far(np.where(coarse == beyond, np.float32(-1), coarse), halvings - 1)
        rest = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)[: out.shape[0], : out.shape[1]]
    else:
        rest = filled(np.where(missing, np.float32(0), out)[..., None], ~missing)[..., 0]
    np.copyto(out, rest, where=missing)
    return out


def sharpened(depth: Plane, per_radian: float) -> Plane:
    """Inverse depth (H, W), of so many px per radian, without what is in between at jumps: it belongs to neither
    surface, and would be seen between them as specks. Steep surfaces, which go on rising, stay."""
    out, square, wider = np.empty_like(depth), np.ones((3, 3), np.uint8), np.ones((CARRY.jump_side,) * 2, np.uint8)
    least, share = np.float32(CARRY.jump_px / per_radian), np.float32(1 - CARRY.jump_share)

    def put(rows: slice) -> None:
        some, own = beside(rows, CARRY.sharpenings + CARRY.jump_side // 2, len(depth))
        here = depth[some]
        for _ in range(CARRY.sharpenings):
            near, far = cv2.dilate(here, square), cv2.erode(here, square)
            jumps = share * near - far > least
            if not jumps.any():
                break
            jumps &= cv2.dilate(here, wider) - cv2.erode(here, wider) < CARRY.jump_growth * (near - far)
            here = np.where(jumps, np.where(2 * here > near + far, near, far), here)
        out[rows] = here[own]

    each(put, small_strips(depth.shape))
    return out

