"""Pictures that show the same from the same place: one of them is registered, and the others stand where it does.

Between such twins there is neither a baseline nor depth. A bundle of all would fit both to noise, in a long valley of
places that nothing tells apart, and would count what two twins and another picture see as seen from three places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..cameras.camera import Camera
from ..cameras.rig import Observations, PictureMatches, Registration, Rig, RigEdge
from ..raster.arrays import Array
from ..raster.robust import sigma_of_lengths
from .averaging.graph import components
from .averaging.options import TWINS
from .reframing import reordered


def twins_of(
    cameras: Sequence[Camera], points: Sequence[Array], matches: Sequence[PictureMatches], scale: float
) -> dict[int, int]:
    """Which pictures need not be registered.

    Parameters
    ----------
    cameras : sequence of Camera
        As known before matching: of twins that is kept of which most is known. Those whose poses are given have none.
    points : sequence of (M_i, 2)
        The features of every picture, raw px.
    matches : sequence of PictureMatches
    scale : float
        px by which thresholds are multiplied.

    Returns
    -------
    dict
        By the number of each picture that shows the same as another one, the number of that.
    """
    same = {(pair.i, pair.j) for pair in matches if _show_the_same(cameras, points, pair, scale)}
    found: dict[int, int] = {}
    for group in components(len(cameras), sorted(same)):
        first = min(group, key=lambda k: (cameras[k].log_sigma, k))
        found |= {k: first for k in group if k != first and (min(k, first), max(k, first)) in same}
    return found


def _show_the_same(cameras: Sequence[Camera], points: Sequence[Array], pair: PictureMatches, scale: float) -> bool:
    first, second = cameras[pair.i], cameras[pair.j]
    known = first.fixed and second.fixed and not np.array_equal(first.K, second.K)
    if len(pair) < TWINS.matches or first.size != second.size or first.pose or second.pose or known:
        return False
    return bool((_shifts(points, pair) < TWINS.still_px * scale).mean() >= TWINS.share)


def _shifts(points: Sequence[Array], pair: PictureMatches) -> Array:
    """px (M,) by which matches move from one picture to the other."""
    moved: Array = np.linalg.norm(points[pair.i][pair.index[:, 0]] - points[pair.j][pair.index[:, 1]], axis=1)
    return moved


def without(twins: Mapping[int, int], matches: Sequence[PictureMatches], kept: Sequence[int]) -> list[PictureMatches]:
    """The matches of the pictures that are kept, by their numbers among these."""
    number = {member: k for k, member in enumerate(kept)}
    return [
        replace(pair, i=number[pair.i], j=number[pair.j])
        for pair in matches if pair.i not in twins and pair.j not in twins
    ]  # fmt: skip


def with_twins(
    found: Registration, kept: Sequence[int], twins: Mapping[int, int], points: Sequence[Array],
    matches: Sequence[PictureMatches], scale: float, names: Sequence[str],
) -> Registration:  # fmt: skip
    """A registration with the twins of its pictures where those stand.

    Parameters
    ----------
    found : Registration
        Of the pictures that were kept.
    kept : sequence of int
        Their numbers among all.
    twins : mapping
        See `twins_of`.
    points, matches, scale, names
        Of all pictures, as `register` was given them.

    Returns
    -------
    Registration
        By the numbers of all pictures, ascending.
    """
    numbers = [kept[number] for number in found.numbers]
    left_out = {kept[number]: why for number, why in found.left_out.items()}
    pairs = {(pair.i, pair.j): pair for pair in matches}
    rig = found.rig
    for twin, first in sorted(twins.items()):
        if first in left_out:
            left_out[twin] = f"shows the same as {names[first]}, which is left out as well: {left_out[first]}"
            continue
        pair = pairs[min(twin, first), max(twin, first)]
        still = _shifts(points, pair) < TWINS.still_px * scale
        index = pair.index[still] if pair.i == first else pair.index[still, ::-1]
        edge = RigEdge(
            numbers.index(first), len(numbers), len(pair), len(index),
            sigma_of_lengths(_shifts(points, pair)[still]), 0.0, 0.0, "none",
        )  # fmt: skip
        rig = _with_twin(rig, edge, points[first][index[:, 0]], points[twin][index[:, 1]])
        numbers.append(twin)
    ascending = np.argsort(numbers).tolist()
    return Registration(reordered(rig, ascending), tuple(sorted(numbers)), dict(sorted(left_out.items())))


def _with_twin(rig: Rig, edge: RigEdge, pixels: Array, others: Array) -> Rig:
    """The rig with one picture more, edge.j, that stands where edge.i does: others (M, 2) px of it show what pixels
    (M, 2) of that show."""
    seen, first = rig.observations, edge.i
    own = np.flatnonzero(seen.picture == first)
    row_of = dict(zip(map(tuple, seen.pixels[own].tolist()), own.tolist(), strict=True))
    rows = {row_of[place]: k for k, place in enumerate(map(tuple, pixels.tolist())) if place in row_of}
    row, match = np.array(list(rows), np.intp), np.array(list(rows.values()), np.intp)
    picture = np.concatenate([seen.picture, np.full(len(row), edge.j)])
    point = np.concatenate([seen.point, seen.point[row]])
    order = np.lexsort((picture, point))
    observations = Observations(
        picture[order], point[order], np.concatenate([seen.pixels, others[match]])[order],
        np.concatenate([seen.used, seen.used[row]])[order],
    )  # fmt: skip
    station = next((one for one in rig.stations if first in one), (first,))
    return replace(
        rig, cameras=(*rig.cameras, rig.cameras[first]), R=np.concatenate([rig.R, rig.R[[first]]]),
        t=np.concatenate([rig.t, rig.t[[first]]]), observations=observations, edges=(*rig.edges, edge),
        stations=(*(one for one in rig.stations if first not in one), (*station, edge.j)),
        lenses=(*rig.lenses, rig.lenses[first]),
        focal_deviation=np.append(rig.focal_deviation, rig.focal_deviation[first]),
        position_deviation=np.append(rig.position_deviation, rig.position_deviation[first]),
    )  # fmt: skip
