"""Dense refinement of inverse range all over the sphere, patch by patch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ...field.refined_sphere import RefinedSphere
from ...field.sphere_chart import SphereChart
from ...raster.arrays import Plane
from ...system.threads import ask, in_order
from ..filling import filled
from ..options import REFINE
from .choice import Compared, compared_on
from .fusing import field_deviation, fused
from .improved import where_improved
from .options import CHART, SWEEP
from .patch import Patch, SweptPicture
from .place import Place, Viewed
from .search import Hints, found_on, span_of
from .sphere_outlines import with_outlines
from .sphere_polish import polished
from .sweep import lack_of_texture

if TYPE_CHECKING:
    from ...cameras.rig import Rig
    from ...field.sphere_field import SphereField
    from ...pictures.picture import Picture

Outcome = TypeVar("Outcome")
APART = "no two pictures from different places show the same"


@dataclass(frozen=True, eq=False)
class _Part:
    """A patch of what is refined from a place, with margins, and what of the place's chart it is for."""

    place: int
    patch: Patch
    inner: Patch


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
    # the same in whatever order pictures are given: the least difference of rounding would be another choice somewhere
    order = rig.own_order
    field, rig, pictures = field.renumbered(order), rig.renumbered(order), [pictures[number] for number in order]
    viewed = Viewed.of(field, rig.views)
    some = [Place.of(number, rig, viewed) for number in range(len(rig))]
    places = [place for place in some if place is not None]
    if not places:
        return DenseSphere(None, APART)
    hints = _at_half_size(field, rig, pictures, places, tick)
    refined, found = _at_full_size(field, rig, pictures, places, hints, tick)
    if found is None:
        return DenseSphere(None, APART)
    return DenseSphere(fused(viewed, places, refined, field_deviation(field, viewed.chart)), "", found)


def _at_half_size(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], places: Sequence[Place], tick: Callable[[float], None]
) -> list[Hints]:
    """What is found with half as many nodes a side, and the rig's points, as hints of where to search."""
    small = [place.smaller(2) for place in places]
    swept = _swept(rig, pictures, small[0].chart)

    def found(part: _Part) -> tuple[Plane, NDArray[np.bool_]] | None:
        compared = _compared(small[part.place], part, swept, field)
        if compared is None:
            return None
        best = found_on(compared, SWEEP.coarse_range_px)
        return compared.at(best.along), best.where

    hints = [
        Hints(*place.points, one.d.copy(), np.zeros(one.d.shape, bool))
        for place, one in zip(places, small, strict=True)
    ]  # fmt: skip
    for part, (near, known) in _each(found, _parts(small), tick, (0.0, CHART.coarse_share)):
        _put(part, hints[part.place].d, near)
        _put(part, hints[part.place].where, known)
    return hints


def _at_full_size(
    field: SphereField, rig: Rig, pictures: Sequence[Picture], places: Sequence[Place], hints: Sequence[Hints],
    tick: Callable[[float], None],
) -> tuple[list[RefinedSphere], float | None]:  # fmt: skip
    """The refinement from each place, and which share of what several pictures show was found, None of nothing."""
    swept = _swept(rig, pictures, places[0].chart)
    whole = [
        RefinedSphere(place.chart, place.d.copy(), np.zeros_like(place.d), np.zeros_like(place.d), place.inside)
        for place in places
    ]  # fmt: skip

    def refined(part: _Part) -> _Refined | None:
        compared = _compared(places[part.place], part, swept, field)
        return None if compared is None else _refined(compared, hints[part.place])

    several = found = 0
    for part, one in _each(refined, _parts(places), tick, (CHART.coarse_share, 1.0)):
        several, found = several + one.several, found + one.found
        of_place = whole[part.place]
        _put(part, of_place.inverse_range, one.d)
        _put(part, of_place.confidence, one.confidence)
        _put(part, of_place.deviation, one.noise)
    joined = [
        replace(one, inverse_range=place.joined(one.inverse_range)) for place, one in zip(places, whole, strict=True)
    ]  # fmt: skip
    return joined, found / several if several else None


def _compared(place: Place, part: _Part, swept: Sequence[SweptPicture], field: SphereField) -> Compared | None:
    """What is compared on a part of what is refined from a place."""
    moved = [replace(picture, view=place.view_from(picture.view)) for picture in swept]
    return compared_on(part.patch, moved, place, field)


def _each(
    work: Callable[[_Part], Outcome | None], parts: Sequence[_Part], tick: Callable[[float], None],
    share: tuple[float, float],
) -> Iterator[tuple[_Part, Outcome]]:  # fmt: skip
    """Parts and what comes of each, of those of which anything does; share: of all work, where this begins and ends."""
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
    whole = filled(cv2.GaussianBlur(guide, (0, 0), 1.0).astype(np.float32), along, where, lack_of_texture(guide))
    along = polished(compared, whole.along, whole.known, whole.weights)
    along = where_improved(compared, with_outlines(compared, found, along, whole.edges), whole.edges)
    confidence: Plane = cv2.blur(where, (REFINE.confidence_nodes,) * 2)
    d = np.where(compared.owner >= 0, compared.at(along), compared.field)
    noise = compared.per_px * np.float32(SWEEP.noise_px)
    return _Refined(d, confidence, noise, int(compared.several.sum()), int(found.where.sum()))


def _swept(rig: Rig, pictures: Sequence[Picture], chart: SphereChart) -> list[SweptPicture]:
    """The pictures at the scale of a chart."""
    out = []
    for number, (view, picture) in enumerate(zip(rig.views, pictures, strict=True)):
        ask()
        out.append(SweptPicture.of(number, view, picture, chart.per_radian))
    return out


def _parts(places: Sequence[Place]) -> list[_Part]:
    """The patches of all places that hold something wanted."""
    found = []
    for number, place in enumerate(places):
        chart, inside = place.chart, place.inside
        height, width = chart.shape
        for rows in _shares(height):
            for columns in _shares(width):
                if inside[rows, columns].mean() < CHART.least_share:
                    continue
                shape = rows.stop - rows.start, columns.stop - columns.start
                inner = Patch(chart, rows.start, columns.start, shape)
                above, below = (min(room, CHART.margin) for room in (rows.start, height - rows.stop))
                before, after = (min(room, CHART.margin) for room in (columns.start, width - columns.stop))
                if chart.closed:
                    before = after = CHART.margin
                shape = shape[0] + above + below, shape[1] + before + after
                found.append(_Part(number, Patch(chart, rows.start - above, columns.start - before, shape), inner))
    return found


def _shares(length: int) -> list[slice]:
    """A length in as few equal shares as are no longer than a patch."""
    ends = np.linspace(0, length, -(-length // CHART.side) + 1).round().astype(int).tolist()
    return [slice(*two) for two in pairwise(ends)]


def _put(part: _Part, whole: NDArray[Any], values: NDArray[Any]) -> None:
    """Writes what a part is for, of its values (h, w), into those of the chart of its place."""
    inner, top, left = part.inner, part.inner.top - part.patch.top, part.inner.left - part.patch.left
    height, width = inner.shape
    whole[inner.top : inner.top + height, inner.left : inner.left + width] = values[
        top : top + height, left : left + width
    ]
