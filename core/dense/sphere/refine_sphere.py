"""Dense refinement of inverse range all over the sphere, patch by patch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ...field.refined_sphere import RefinedSphere
from ...field.sphere_chart import SphereChart
from ...field.sphere_points import seen_at
from ...raster.arrays import Plane
from ...raster.enlarging import repeated
from ...raster.grid import Grid
from ...raster.picture_map import falls_inside
from ...system.threads import in_order
from ..filling import filled
from ..options import REFINE
from .choice import Compared, compared_on
from .options import CHART, SWEEP
from .patch import Patch, SweptPicture
from .search import Hints, found_on, span_of
from .sphere_outlines import with_outlines
from .sphere_polish import polished
from .sweep import MEAN_OF_COLOURS

if TYPE_CHECKING:
    from ...cameras.rig import Rig
    from ...cameras.view import View
    from ...field.sphere_field import SphereField
    from ...pictures.picture import Picture

Covered = tuple[SphereChart, NDArray[np.intp]]
"""A chart, and how many pictures show each of its cells (see `ChartOptions.cell`)."""
Part = tuple[Patch, Patch]
"""A patch with its margins, and what of the chart it is for."""
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class DenseSphere:
    """The result of dense refinement on the sphere.

    Attributes
    ----------
    refined : RefinedSphere or None
        None where nothing was refined.
    why : str
        Why not, in plain words; empty where it was.
    found : float
        Share of what several pictures show that was found, 0 to 1.
    """

    refined: RefinedSphere | None
    why: str
    found: float = 0.0


def refine_sphere(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], tick: Callable[[float], None] = lambda share: None
) -> DenseSphere:
    """Refine a field on the sphere where several pictures show the same.

    Parameters
    ----------
    field : SphereField
        Fitted to the rig's points.
    rig : Rig
    pictures : sequence of Picture
        In the rig's order.
    tick : callable
        Called between patches with the share that is done; ends the work by raising.

    Returns
    -------
    DenseSphere
        Without refinement where all pictures were taken from one place, or no two of them show the same.
    """
    if not rig.t.any():
        return DenseSphere(None, "pictures that were taken from one place tell no distances")
    covered = _chart(field, rig.views)
    hints = _at_half_size(field, rig, pictures, covered, tick)
    return _at_full_size(field, rig, pictures, covered, hints, tick)


def _at_half_size(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], covered: Covered, tick: Callable[[float], None]
) -> Hints:
    """What is found with half as many nodes a side, and the rig's points, as hints of where to search."""
    full, count = covered
    chart = full.smaller(2)
    smooth, swept = _of_field(field, chart), _swept(rig, pictures, chart)
    d, where = smooth.copy(), np.zeros(smooth.shape, bool)

    def found(part: Part) -> tuple[Plane, NDArray[np.bool_]] | None:
        compared = compared_on(part[0], swept, field, smooth)
        if compared is None:
            return None
        best = found_on(compared, SWEEP.coarse_range_px)
        return compared.at(best.along), best.where

    for (patch, inner), (near, known) in _each(found, _patches(chart, count), tick, (0.0, CHART.coarse_share)):
        _put(patch, inner, d, near)
        _put(patch, inner, where, known)
    columns, rows = full.places(rig.rays)
    return Hints(np.rint(columns), np.rint(rows), np.maximum(rig.inverse_ranges, 0), d, where)


def _at_full_size(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], covered: Covered, hints: Hints,
    tick: Callable[[float], None],
) -> DenseSphere:  # fmt: skip
    """The refinement on the chart."""
    chart, count = covered
    smooth, swept = _of_field(field, chart), _swept(rig, pictures, chart)
    d, confidence, deviation = smooth.copy(), np.zeros_like(smooth), _deviation(field, chart)
    shown = repeated(count > 0, CHART.cell)

    def refined(part: Part) -> _Refined | None:
        compared = compared_on(part[0], swept, field, smooth)
        return None if compared is None else _refined(compared, hints)

    several = found = 0
    for (patch, inner), one in _each(refined, _patches(chart, count), tick, (CHART.coarse_share, 1.0)):
        several, found = several + one.several, found + one.found
        _put(patch, inner, d, one.d)
        _put(patch, inner, confidence, one.confidence)
        spread = np.hypot(one.confidence * one.noise, (1 - one.confidence) * patch.of_chart(deviation))
        _put(patch, inner, deviation, spread.astype(np.float32))
    if not several:
        return DenseSphere(None, "no two pictures from different places show the same")
    return DenseSphere(RefinedSphere(chart, d, confidence, deviation, shown), "", found / several)


def _each(
    work: Callable[[Part], Outcome | None], parts: Sequence[Part], tick: Callable[[float], None],
    share: tuple[float, float],
) -> Iterator[tuple[Part, Outcome]]:  # fmt: skip
    """Patches and what comes of each, of those of which anything does; share: of all work, where this begins and ends.
    """
    begin, end = share
    for number, (part, outcome) in enumerate(zip(parts, in_order(work, parts), strict=True)):
        tick(begin + (end - begin) * number / len(parts))
        if outcome is not None:
            yield part, outcome


@dataclass(frozen=True, eq=False)
class _Refined:
    """Inverse range, confidence and noise of inverse range (h, w) of a patch; of how many nodes several pictures show,
    and how many of them were found."""

    d: Plane
    confidence: Plane
    noise: Plane
    several: int
    found: int


def _refined(compared: Compared, hints: Hints) -> _Refined:
    """A patch, searched, filled, polished, and with its outlines in place."""
    found = found_on(compared, span_of(compared, hints))
    where = found.where.astype(np.float32)
    guide = compared.best(compared.sampled(compared.at(found.along)))[..., :3]
    along = np.where(found.where, found.along, compared.field_px).astype(np.float32)
    whole = filled(cv2.GaussianBlur(guide, (0, 0), 1.0).astype(np.float32), along, where, _plain(guide))
    along = polished(compared, whole.along, whole.known, whole.weights)
    along = with_outlines(compared, found, along, whole.edges)
    confidence: Plane = cv2.blur(where, (REFINE.confidence_nodes,) * 2)
    d = np.where(compared.owner >= 0, compared.at(along), compared.field)
    noise = compared.per_px * np.float32(SWEEP.noise_px)
    return _Refined(d, confidence, noise, int(compared.several.sum()), int(found.where.sum()))


def _plain(guide: NDArray[np.uint8]) -> Plane:
    """Lack of texture (h, w) around the nodes: 0 for much, 1 for none."""
    gray = cv2.transform(guide.astype(np.float32), MEAN_OF_COLOURS[:, :3])
    gray = cv2.GaussianBlur(gray, (0, 0), 1.0)
    slope = np.zeros_like(gray)
    for k in (0, 1):
        slope += np.square(cv2.Scharr(gray, cv2.CV_32F, 1 - k, k, scale=1 / 32))
    plain: Plane = REFINE.half_texture / (REFINE.half_texture + cv2.blur(slope, (7, 7)))
    return plain


def _chart(field: SphereField, views: Sequence[View]) -> Covered:
    """A chart of what pictures show, with as many nodes per radian as they have px, within bounds; and how many of them
    show each of its cells of `cell` nodes a side."""
    focal = float(np.median([view.camera.focal for view in views]))
    rough = SphereChart.whole(np.eye(3), CHART.rough_height)
    count = _count(field, views, rough)
    height = focal * np.pi
    nodes = float((count > 1).sum()) * (height / rough.height) ** 2
    height *= min(1.0, np.sqrt(CHART.max_nodes / max(nodes, 1.0)))
    cell = CHART.cell
    height = cell * max(1, round(height / cell))
    # the widest gap between columns that show something lies behind
    columns, rows = (np.flatnonzero((count > 0).any(axis=axis)) for axis in (0, 1))
    if not columns.size:
        columns, rows = np.arange(count.shape[1]), np.arange(count.shape[0])
    ends = np.append(columns, columns[0] + rough.circumference)
    last = int(np.argmax(np.diff(ends)))
    first, wide = ends[last + 1], rough.circumference - int(np.diff(ends)[last]) + 1
    margin, scale = CHART.margin_cells, height / rough.height
    low, high = (int(edge * scale) // cell for edge in (rows[0], rows[-1] + 1))
    low, high = max(0, low - margin), min(height // cell, high + 1 + margin)
    across = min(2 * height // cell, int((wide + 1) * scale) // cell + 2 * margin)
    left = int(first % rough.circumference * scale) // cell - margin if across < 2 * height // cell else 0
    chart = SphereChart(np.eye(3), height, low * cell, left * cell, ((high - low) * cell, across * cell))
    return chart, _count(field, views, chart.smaller(cell))


def _count(field: SphereField, views: Sequence[View], chart: SphereChart) -> NDArray[np.intp]:
    """How many pictures show each node (h, w) of a chart."""
    rays = chart.all_rays.reshape(-1, 3)
    d = np.maximum(field.at(rays), 0)
    count = np.zeros(len(rays), np.intp)
    for view in views:
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = seen_at(view, rays, d).T
        count += falls_inside(x, y, view.size)
    return count.reshape(chart.shape)


def _swept(rig: Rig, pictures: Sequence[Picture], chart: SphereChart) -> list[SweptPicture]:
    """The pictures at the scale of a chart."""
    return [
        SweptPicture.of(number, view, picture, chart.per_radian)
        for number, (view, picture) in enumerate(zip(rig.views, pictures, strict=True))
    ]


def _of_field(field: SphereField, chart: SphereChart) -> Plane:
    """The field's inverse range (H, W), not below 0, at all nodes of a chart."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.field_nodes)
    return grid.to_pixels(np.maximum(field.at(chart.rays(grid.ys, grid.xs)), 0), 0, 0, *chart.shape[::-1])


def _deviation(field: SphereField, chart: SphereChart) -> Plane:
    """The field's standard deviation (H, W) of inverse range."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.deviation_nodes)
    return grid.to_pixels(field.deviation(chart.rays(grid.ys, grid.xs)), 0, 0, *chart.shape[::-1])


def _patches(chart: SphereChart, count: NDArray[np.intp]) -> list[Part]:
    """The patches where several pictures show something."""
    height, width = chart.shape
    found = []
    for top in range(0, height, CHART.side):
        for left in range(0, width, CHART.side):
            inner = Patch(chart, top, left, (min(CHART.side, height - top), min(CHART.side, width - left)))
            rows, columns = (
                slice(first * n // side, -(-(first + length) * n // side))
                for first, length, n, side in zip((top, left), inner.shape, count.shape, chart.shape, strict=True)
            )
            if (count[rows, columns] > 1).mean() < CHART.least_share:
                continue
            above, below = min(top, CHART.margin), min(height - top - inner.shape[0], CHART.margin)
            before, after = min(left, CHART.margin), min(width - left - inner.shape[1], CHART.margin)
            if chart.closed:
                before = after = CHART.margin
            shape = inner.shape[0] + above + below, inner.shape[1] + before + after
            found.append((Patch(chart, top - above, left - before, shape), inner))
    return found


def _put(patch: Patch, inner: Patch, chart: NDArray[Any], values: NDArray[Any]) -> None:
    """Writes what a patch is for, of its values (h, w), into those of the chart."""
    top, left = inner.top - patch.top, inner.left - patch.left
    height, width = inner.shape
    chart[inner.top : inner.top + height, inner.left : inner.left + width] = values[
        top : top + height, left : left + width
    ]
