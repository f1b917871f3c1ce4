"""What was refined from each picture's place, as it is seen from the viewpoint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...field.carried_surface import cells_of, filled_chart, put_nearest, sharpened
from ...field.refined_sphere import RefinedSphere
from ...field.sphere_chart import SphereChart
from ...raster.arrays import Plane, small_strips
from ...raster.enlarging import repeated
from ...raster.grid import Grid
from ...system.threads import ask
from .options import CHART
from .place import Place, Viewed

if TYPE_CHECKING:
    from ...field.sphere_field import SphereField


def fused(viewed: Viewed, places: Sequence[Place], refined: Sequence[RefinedSphere], deviation: Plane) -> RefinedSphere:
    """What was refined from each place, seen from the viewpoint.

    Parameters
    ----------
    viewed : Viewed
    places : sequence of Place
    refined : sequence of RefinedSphere
        What was refined from each of them.
    deviation : (H, W) float32
        Standard deviation of the field's inverse range on the viewpoint's chart.

    Returns
    -------
    RefinedSphere
        On the viewpoint's chart. Each ray shows what was refined from where the picture that shows it best was taken;
        where that leaves a gap, what was from other places; where no two pictures show anything, the field.
    """
    chart = viewed.chart
    owner = repeated(viewed.owner, CHART.cell)
    shown = owner >= 0
    own, others = (np.full(chart.shape, -1, np.float32) for _ in range(2))
    for place, of_place in zip(places, refined, strict=True):
        ask()
        _put_from(place, of_place, chart, owner, own, others)
    nearest = np.where(own < 0, others, own)
    alone = repeated(viewed.count < 2, CHART.cell)
    nearest = np.where(alone & (nearest < 0), viewed.d, nearest)
    d = filled_chart(nearest, chart.closed)
    confidence, spread = np.zeros_like(d), deviation.copy()
    for place, of_place in zip(places, refined, strict=True):
        ask()
        _put_values(place, of_place, chart, owner, d, confidence, spread)
    return RefinedSphere(chart, d, confidence, spread, shown)


def field_deviation(field: SphereField, chart: SphereChart) -> Plane:
    """The field's standard deviation (H, W) of inverse range."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.deviation_nodes)
    return grid.to_pixels(field.deviation(chart.rays(grid.ys, grid.xs)), 0, 0, *chart.shape[::-1])


def _put_from(
    place: Place, refined: RefinedSphere, chart: SphereChart, owner: Plane, own: Plane, others: Plane
) -> None:
    """Puts what was refined from a place where it is seen from the viewpoint (H, W): what the picture of the place
    shows best, and what others do."""
    here = refined.chart
    depth = sharpened(np.maximum(refined.inverse_range, np.float32(0)), here.per_radian)
    columns = np.arange(here.shape[1], dtype=np.float64)
    for rows in small_strips(here.shape):
        inside = refined.shown[rows]
        d = depth[rows][inside].astype(np.float64)
        rays = here.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)[inside]
        seen = place.from_viewpoint(rays, d)
        d = (d / np.linalg.norm(seen, axis=-1)).astype(np.float32)
        cells, there = cells_of(chart, seen)
        d, best = d[there], owner.ravel()[cells] == place.number
        put_nearest(own, cells[best], d[best])
        put_nearest(others, cells[~best], d[~best])


def _put_values(
    place: Place, refined: RefinedSphere, chart: SphereChart, owner: Plane, d: Plane, confidence: Plane, spread: Plane
) -> None:
    """Puts inverse range, confidence and standard deviation (H, W) where the picture of a place shows the viewpoint's
    rays best; d, spread: inverse range by points on nodes, and the field's deviation before."""
    for rows in small_strips(chart.shape):
        mine = owner[rows] == place.number
        if not mine.any():
            continue
        columns = np.arange(chart.shape[1], dtype=np.float64)
        rays = chart.rays(np.arange(rows.start, rows.stop, dtype=np.float64), columns)[mine]
        found = refined.seen_from(-place.centre, rays[None], d[rows][mine][None])
        d[rows][mine], sure, noise = (values[0] for values in found)
        confidence[rows][mine] = sure
        spread[rows][mine] = np.hypot(sure * noise, (1 - sure) * spread[rows][mine])
