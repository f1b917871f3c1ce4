"""Dense inverse range carried from the first picture's place to a viewpoint that slides among N pictures.

As `carried_depth` does for a pair: every node is put where its point appears, the nearest is seen, and what none falls
on is taken to lie as far as its farthest neighbour.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..field.refined_sphere import RefinedSphere
from ..raster.arrays import small_strips
from ..system.threads import in_order
from .carried_depth import filled_surface, put_nearest, sharpened
from .options import CARRY
from .rig_viewpoint import RigViewpoint


def carried_sphere(refined: RefinedSphere, viewpoint: RigViewpoint) -> RefinedSphere:
    """What was refined from the first picture's place, seen from a viewpoint that slides.

    Parameters
    ----------
    refined : RefinedSphere
    viewpoint : RigViewpoint

    Returns
    -------
    RefinedSphere
        On the same chart, inverse range along each ray from its own viewpoint.
    """
    chart = refined.chart
    height, width = chart.shape
    depth = sharpened(np.maximum(refined.inverse_range, np.float32(0)), chart.per_radian)
    columns = np.arange(width, dtype=np.float64)
    nearest = np.full(chart.shape, -1, np.float32)

    def appear(rows: slice) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        """Cells (N,) on which the nodes of some rows fall, and their inverse range (N,) from there."""
        shown = refined.shown[rows]
        rays = chart.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)[shown]
        seen, d = viewpoint.seen_from(rays, depth[rows][shown].astype(np.float64))
        column, row = (np.floor(at).astype(np.intp) for at in chart.places(seen))
        column = column % width if chart.closed else column
        there = (row >= -1) & (row < height) & (column >= -1) & (column < width)
        return (np.maximum(row, 0) * width + np.maximum(column, 0))[there], d[there].astype(np.float32)

    for cells, d in in_order(appear, small_strips(chart.shape)):
        put_nearest(nearest, cells, d)
    beside = CARRY.beside_nodes if chart.closed else 0
    around = np.concatenate([nearest[:, width - beside :], nearest, nearest[:, :beside]], axis=1)
    carried = np.ascontiguousarray(filled_surface(around)[:, beside : beside + width])
    confidence, deviation = np.empty_like(carried), np.empty_like(carried)
    for rows in small_strips(chart.shape):
        rays = chart.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)
        from_first = rays + carried[rows][..., None] * viewpoint.place(rays)
        _, confidence[rows], deviation[rows] = refined.at(from_first)
    return replace(refined, inverse_range=carried, confidence=confidence, deviation=deviation)
