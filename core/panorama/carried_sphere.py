"""Dense inverse range carried from the first picture's place to a viewpoint that slides among N pictures.

As `carried_depth` does for a pair: every node is put where its point appears, the nearest is seen, and what none falls
on is taken to lie as far as its farthest neighbour.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..field.carried_surface import cells_of, filled_chart, put_nearest, sharpened
from ..field.refined_sphere import RefinedSphere
from ..raster.arrays import small_strips
from ..system.threads import in_order
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
    depth = sharpened(np.maximum(refined.inverse_range, np.float32(0)), chart.per_radian)
    columns = np.arange(chart.shape[1], dtype=np.float64)
    nearest = np.full(chart.shape, -1, np.float32)

    def appear(rows: slice) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        """Cells (N,) on which the nodes of some rows fall, and their inverse range (N,) from there."""
        shown = refined.shown[rows]
        rays = chart.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)[shown]
        seen, d = viewpoint.seen_from(rays, depth[rows][shown].astype(np.float64))
        cells, there = cells_of(chart, seen)
        return cells, d[there].astype(np.float32)

    for cells, d in in_order(appear, small_strips(chart.shape)):
        put_nearest(nearest, cells, d)
    carried = filled_chart(nearest, chart.closed)
    confidence, deviation = np.empty_like(carried), np.empty_like(carried)
    for rows in small_strips(chart.shape):
        rays = chart.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)
        carried[rows], confidence[rows], deviation[rows] = refined.seen_from(viewpoint.place(rays), rays, carried[rows])
    return replace(refined, inverse_range=carried, confidence=confidence, deviation=deviation)
