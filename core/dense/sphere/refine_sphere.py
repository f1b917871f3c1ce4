"""Dense refinement of inverse range all over the sphere, patch by patch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.lens import distort
from ...field.refined_sphere import RefinedSphere
from ...field.sphere_chart import SphereChart
from ...raster.arrays import Plane
from ...raster.grid import Grid
from ...system.threads import in_order
from ..edge_aware_smoothing import Smoother, cut_edges, edge_weights, strengthen
from ..options import REFINE
from .choice import Compared, compared_on
from .options import CHART, SWEEP
from .patch import Patch, SweptPicture
from .search import Hints, found_on
from .sphere_outlines import with_outlines
from .sphere_polish import polished
from .sweep import MEAN_OF_COLOURS

if TYPE_CHECKING:
    from ...cameras.rig import Rig
    from ...cameras.view import View
    from ...field.sphere_field import SphereField
    from ...pictures.picture import Picture


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


# Share of the time that the search at half the size takes.
COARSE_SHARE = 0.25
# Of both sides of the window in which confidence is the share of nodes that were found.
CONFIDENCE_NODES = 9


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
    chart, count = _chart(field, rig.views)
    small = chart.smaller(2)
    smooth = _of_field(field, small)
    swept = [SweptPicture.of(k, view, picture, small.per_radian)
             for k, (view, picture) in enumerate(zip(rig.views, pictures, strict=True))]  # fmt: skip
    d, where = smooth.copy(), np.zeros(smooth.shape, bool)
    hints = _hints(rig, small)
    parts = _patches(small, count)
    for number, (patch, inner) in enumerate(parts):
        tick(COARSE_SHARE * number / len(parts))
        compared = compared_on(patch, swept, field, smooth)
        if compared is not None:
            found = found_on(compared, hints)
            _put(patch, inner, d, compared.at(found.along))
            _put(patch, inner, where, found.where)
    hints = replace(_hints(rig, chart), coarse=(d, where))
    return _at_full_size(field, rig, pictures, (chart, count), hints, tick)


def _at_full_size(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], covered: tuple[SphereChart, NDArray[np.intp]],
    hints: Hints, tick: Callable[[float], None],
) -> DenseSphere:  # fmt: skip
    """The refinement on a chart; covered: the chart, and how many pictures show its parts."""
    chart, count = covered
    smooth = _of_field(field, chart)
    swept = [SweptPicture.of(k, view, picture, chart.per_radian)
             for k, (view, picture) in enumerate(zip(rig.views, pictures, strict=True))]  # fmt: skip
    d, confidence, deviation = smooth.copy(), np.zeros_like(smooth), _deviation(field, chart)
    shown = cv2.resize((count > 0).astype(np.uint8), chart.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0

    def refined(part: tuple[Patch, Patch]) -> _Refined | None:
        compared = compared_on(part[0], swept, field, smooth)
        return None if compared is None else _refined(compared, hints)

    parts, several, found = _patches(chart, count), 0, 0
    for number, ((patch, inner), one) in enumerate(zip(parts, in_order(refined, parts), strict=True)):
        tick(COARSE_SHARE + (1 - COARSE_SHARE) * number / len(parts))
        if one is not None:
            several, found = several + one.several, found + one.found
            _put(patch, inner, d, one.d)
            _put(patch, inner, confidence, one.confidence)
            spread = np.hypot(one.confidence * one.noise, (1 - one.confidence) * patch.of_chart(deviation))
            _put(patch, inner, deviation, spread.astype(np.float32))
    if not several:
        return DenseSphere(None, "no two pictures from different places show the same")
    return DenseSphere(RefinedSphere(chart, d, confidence, deviation, shown), "", found / several)


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
    found = found_on(compared, hints)
    guide = compared.best(compared.sampled(compared.at(found.along)))[..., :3]
    edges = edge_weights(cv2.GaussianBlur(guide, (0, 0), 1.0).astype(np.float32), REFINE.edge_levels)
    plain = _plain(guide)
    along = np.where(found.where, found.along, compared.field_px).astype(np.float32)
    weights = strengthen(cut_edges(edges, along, found.where, REFINE.depth_edge_px), plain, REFINE.plain_strength)
    known = np.maximum(found.where.astype(np.float32), np.float32(REFINE.field_confidence))
    weight = np.maximum(found.where * (1 - np.float32(REFINE.plain_doubt) * plain), np.float32(REFINE.field_confidence))
    along = Smoother.of(weights, REFINE.smoothness).smoothed(along, weight)
    along = polished(compared, along, known, weights)
    along = with_outlines(compared, found, along, edges)
    confidence: Plane = cv2.blur(found.where.astype(np.float32), (CONFIDENCE_NODES,) * 2)
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


def _chart(field: SphereField, views: Sequence[View]) -> tuple[SphereChart, NDArray[np.intp]]:
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
    rays = chart.all_rays
    d = np.maximum(field.at(rays), 0)
    count = np.zeros(chart.shape, np.intp)
    for view in views:
        seen = rays @ (view.K @ view.R).T + d[..., None] * (view.K @ view.t)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = distort(np.where(seen[..., 2:] > 0, seen[..., :2] / seen[..., 2:], np.nan), view.camera)
            count += ((pixels >= 0) & (pixels <= np.array(view.size) - 1)).all(axis=-1)
    return count


def _of_field(field: SphereField, chart: SphereChart) -> Plane:
    """The field's inverse range (H, W), not below 0, at all nodes of a chart."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.field_nodes)
    return grid.to_pixels(np.maximum(field.at(chart.rays(grid.ys, grid.xs)), 0), 0, 0, *chart.shape[::-1])


def _deviation(field: SphereField, chart: SphereChart) -> Plane:
    """The field's standard deviation (H, W) of inverse range."""
    grid = Grid.over(0, 0, *chart.shape[::-1], CHART.deviation_nodes)
    return grid.to_pixels(field.deviation(chart.rays(grid.ys, grid.xs)), 0, 0, *chart.shape[::-1])


def _hints(rig: Rig, chart: SphereChart) -> Hints:
    """The rig's points on a chart."""
    columns, rows = chart.places(rig.rays)
    return Hints(np.rint(columns), np.rint(rows), np.maximum(rig.inverse_ranges, 0))


def _patches(chart: SphereChart, count: NDArray[np.intp]) -> list[tuple[Patch, Patch]]:
    """Patches with their margins, and what of the chart each of them is for, where several pictures show something."""
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
