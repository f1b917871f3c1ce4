"""The places that pictures were taken from, and what is refined from each: what its picture shows best.

From where a picture was taken, edges of depth lie on its own edges, and a thing that is nearer than what it stands
before is one piece. From another place the pictures would agree on what lies behind a thin thing as well as on itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.view import View
from ...field.sphere_chart import SphereChart
from ...field.sphere_points import seen_at
from ...raster.arrays import Array, Plane, dilated
from ...raster.distance import outside
from ...raster.enlarging import repeated
from ...raster.grid import Grid
from ...raster.picture_map import falls_inside
from ...system.threads import ask
from .options import CHART

if TYPE_CHECKING:
    from ...cameras.rig import Rig
    from ...field.sphere_field import SphereField

Cells = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Viewed:
    """What pictures show from the viewpoint: a chart, and the field's inverse range d (H, W) on it; of each of its
    cells count (h, w), how many pictures show it, and owner (h, w), which of them was taken nearest to it, −1 for none.
    """

    chart: SphereChart
    d: Plane
    count: NDArray[np.intp]
    owner: NDArray[np.int16]

    @staticmethod
    def of(field: SphereField, views: Sequence[View]) -> Viewed:
        """With as many nodes per radian as the pictures have px, within bounds."""
        focal = float(np.median([view.camera.focal for view in views]))
        rough = SphereChart.whole(np.eye(3), CHART.rough_height)
        count = (_shown(field, views, rough) >= 0).sum(axis=0)
        height = focal * np.pi
        nodes = float((count > 1).sum()) * (height / rough.height) ** 2
        height *= min(1.0, np.sqrt(CHART.max_nodes / max(nodes, 1.0)))
        cell = CHART.cell
        height = cell * max(1, round(height / cell))
        rows, columns = _window(count > 0)
        scale, margin = height / rough.height / cell, CHART.margin_cells
        low, high = int(rows.start * scale) - margin, int(rows.stop * scale) + 1 + margin
        across = min(2 * height // cell, int((columns.stop - columns.start + 1) * scale) + 2 * margin)
        left = int(columns.start * scale) - margin if across < 2 * height // cell else 0
        chart = _cells(height, slice(low, high), slice(left, left + across))
        off = _shown(field, views, chart.smaller(cell))
        owner = np.where((off >= 0).any(axis=0), np.where(off < 0, np.inf, off).argmin(axis=0), -1)
        return Viewed(chart, field_on(field, chart), (off >= 0).sum(axis=0), owner.astype(np.int16))


@dataclass(frozen=True, eq=False)
class Place:
    """What is refined from where one picture was taken.

    number: the picture's; centre (3,): where; chart: around it; wanted (h, w): which of its cells the picture shows
    best of several, and those around; share (h, w): what is taken of refinement, ever less beyond what several pictures
    show, for nothing holds it there; d (H, W): the field's inverse range from there; points: columns, rows and inverse
    ranges (N,) of the rig's points there.
    """

    number: int
    centre: Array
    chart: SphereChart
    wanted: Cells
    share: Plane
    d: Plane
    points: tuple[Array, Array, Array]

    @staticmethod
    def of(number: int, rig: Rig, viewed: Viewed) -> Place | None:
        """None if the picture shows nothing best that others show as well."""
        cell, chart = CHART.cell, viewed.chart
        cells = chart.smaller(cell)
        own = (viewed.owner == number) & (viewed.count > 1)
        if not own.any():
            return None
        ask()
        centre = rig.centres[number]
        whole = SphereChart.whole(np.eye(3), cells.height)
        d = cv2.resize(viewed.d, cells.shape[::-1], interpolation=cv2.INTER_AREA)
        towards = cells.all_rays - d[..., None] * centre
        reach = CHART.beyond_cells
        wide = _wider(_put(whole, towards[own]), reach)
        window = _window(wide)
        several = _wider(_put(whole, towards[viewed.count > 1]), 1)
        own_chart = _cells(chart.height, *window)
        columns = np.arange(window[1].start, window[1].stop) % whole.circumference
        wide, several = (one[window[0]][:, columns] for one in (wide, several))
        share = np.clip(1 - outside(several) / reach, 0, 1).astype(np.float32)
        away = rig.rays - np.maximum(rig.inverse_ranges, 0)[:, None] * centre
        points = (*own_chart.places(away), np.maximum(rig.inverse_ranges, 0) / np.linalg.norm(away, axis=1))
        return Place(number, centre, own_chart, wide, share, _seen_from(viewed, own_chart, centre), points)

    def smaller(self, times: int) -> Place:
        """The same on a chart with so many times fewer nodes a side."""
        chart = self.chart.smaller(times)
        d = cv2.resize(self.d, chart.shape[::-1], interpolation=cv2.INTER_AREA)
        columns, rows = ((at + 0.5) / times - 0.5 for at in self.points[:2])
        return replace(self, chart=chart, d=d, points=(columns, rows, self.points[2]))

    @property
    def inside(self) -> Cells:
        """The nodes (H, W) that lie in wanted cells."""
        return repeated(self.wanted, self.chart.shape[0] // self.wanted.shape[0])

    def joined(self, refined: Plane) -> Plane:
        """Inverse range (H, W) that becomes the field's beyond what several pictures show."""
        share = cv2.resize(self.share, self.chart.shape[::-1], interpolation=cv2.INTER_LINEAR)
        whole: Plane = self.d + share * (refined - self.d)
        return whole

    def view_from(self, view: View) -> View:
        """The view that a picture has of what lies around this place."""
        return replace(view, t=view.t + view.R @ self.centre)

    def from_viewpoint(self, rays: Array, d: Array) -> Array:
        """Rays (…, 3), of any length, from the viewpoint to what lies at inverse ranges (…) along rays (…, 3) from
        here; their length is the range from there in that from here."""
        seen: Array = rays + d[..., None] * self.centre
        return seen


def field_on(field: SphereField, chart: SphereChart) -> Plane:
    """The field's inverse range (H, W), not below 0, at all nodes of a chart around the viewpoint."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.field_nodes)
    return grid.to_pixels(np.maximum(field.at(chart.rays(grid.ys, grid.xs)), 0), 0, 0, *chart.shape[::-1])


def _seen_from(viewed: Viewed, chart: SphereChart, centre: Array) -> Plane:
    """The field's inverse range (H, W) on a chart around another place: a fixed point, since it is smooth."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.field_nodes)
    rays = chart.rays(grid.ys, grid.xs)
    towards, d = rays @ centre, np.zeros(rays.shape[:2])
    for _ in range(CHART.field_steps):
        ask()
        seen = rays + d[..., None] * centre
        length = np.linalg.norm(seen, axis=-1)
        columns, rows = (at.astype(np.float32) for at in viewed.chart.places(seen))
        of_viewpoint = cv2.remap(viewed.d, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        # the range from here of the point at that range from the viewpoint, along the ray
        along = (seen * rays).sum(axis=-1) / length - of_viewpoint * towards
        d += CHART.field_damping * (of_viewpoint / np.maximum(along, CHART.least_along) - d)
    return grid.to_pixels(np.maximum(d, 0), 0, 0, *chart.shape[::-1])


def _shown(field: SphereField, views: Sequence[View], chart: SphereChart) -> Array:
    """How far (N, h, w) each picture's place lies off each ray of a chart, −1 where the picture does not show it."""
    rays = chart.all_rays
    d = np.maximum(field.at(rays), 0)
    off = np.empty((len(views), *chart.shape))
    for one, view in zip(off, views, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = np.moveaxis(seen_at(view, rays.reshape(-1, 3), d.ravel()), -1, 0)
        place = -view.R.T @ view.t
        across = np.linalg.norm(place - rays * (rays @ place)[..., None], axis=-1)
        one[:] = np.where(falls_inside(x, y, view.size).reshape(chart.shape), across, -1)
    return off


def _put(whole: SphereChart, rays: Array) -> Cells:
    """The cells (h, 2 h) of a whole sphere on which rays (N, 3) of any length lie."""
    marked = np.zeros(whole.shape, bool)
    columns, rows = whole.places(rays)
    row = np.clip(np.rint(rows).astype(int), 0, whole.height - 1)
    marked[row, np.rint(columns).astype(int) % whole.circumference] = True
    return marked


def _wider(marked: Cells, reach: int) -> Cells:
    """Cells (h, 2 h) of a whole sphere with so many more on every side."""
    around = np.concatenate([marked[:, -reach:], marked, marked[:, :reach]], axis=1)
    return dilated(around, reach)[:, reach:-reach]


def _window(mask: Cells) -> tuple[slice, slice]:
    """Rows, and columns from the first of the whole sphere on, of what is marked (h, 2 h) on a whole sphere; all of it
    if nothing is. The widest gap between columns that show something lies behind."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not columns.size:
        rows, columns = (np.arange(side) for side in mask.shape)
    ends = np.append(columns, columns[0] + mask.shape[1])
    last = int(np.argmax(np.diff(ends)))
    first = int(ends[last + 1] % mask.shape[1])
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(first, first + mask.shape[1] - int(np.diff(ends)[last]) + 1)


def _cells(height: int, rows: slice, columns: slice) -> SphereChart:
    """The chart of cells of the whole sphere of so many nodes from pole to pole."""
    cell = CHART.cell
    low, high = max(0, rows.start), min(height // cell, rows.stop)
    shape = (high - low) * cell, (columns.stop - columns.start) * cell
    return SphereChart(np.eye(3), height, low * cell, columns.start * cell, shape)
