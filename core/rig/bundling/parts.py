"""Parts of a rig: within one, points that three pictures see tell the proportions of all lengths; between parts nothing
but how depth goes on does.

Two pairs of pictures are of one part if both are sides of a triangle of pictures that enough points are seen by. Fewer
are no evidence: one wrong point fits any lengths, and would set them. Pictures of one place count as one here: between
them there is no length, and so a side that two triangles share there ties none of theirs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from ..averaging.graph import components
from .bundle_options import JUDGE
from .tracks import Index, Tracks, kinds_of


def parts_of_pairs(seen: NDArray[np.bool_], points: Array) -> Index:
    """The part (N, N) that each pair of pictures is of, as the number of one of its pairs.

    seen (N, K): which pictures, or which places, see points of each kind; points (K,): how many there are of each.
    """
    count = len(seen)
    number = np.arange(count * count).reshape(count, count)
    number = np.minimum(number, number.T)
    shown = seen.astype(float)
    sides: list[tuple[int, int]] = []
    for i in range(count - 2):
        rest = shown[i + 1 :]
        triangles = np.triu((rest * (shown[i] * points)) @ rest.T, 1) >= JUDGE.three_view_points
        for j, k in (np.argwhere(triangles) + i + 1).tolist():
            sides += [(int(number[i, j]), int(number[i, k])), (int(number[i, j]), int(number[j, k]))]
    part = np.arange(count * count)
    for group in components(count * count, sides):
        part[group] = min(group)
    of: Index = part[number]
    return of


def supported(tracks: Tracks, pictures: int) -> Tracks:
    """Without what would tie parts by fewer points than there must be: each point keeps its observations of one part,
    that of which its pictures share most points."""
    _, kept = _of_kinds(tracks, np.arange(pictures))
    chosen = kept[tracks.kind[tracks.point], tracks.picture]
    if chosen.all():
        return tracks
    point = tracks.point[chosen]
    picture, starts = tracks.picture[chosen], np.searchsorted(point, np.arange(len(tracks)))
    return Tracks(
        picture, point, tracks.feature[chosen], tracks.pixels[chosen], starts, kinds_of(picture, starts, pictures)
    )


def part_of_points(tracks: Tracks, place: Index) -> Index:
    """The part of each point (P,); place (N,): numbers of the places where pictures were taken. Points that are seen
    from one place only, which have no depth, are of a part of that place."""
    part: Index = _of_kinds(tracks, place)[0][tracks.kind]
    return part


def _of_kinds(tracks: Tracks, place: Index) -> tuple[Index, NDArray[np.bool_]]:
    """The part of each kind of points (K,), and from which places (K, M) observations are of it, numbered in order."""
    points = np.bincount(tracks.kind).astype(float)
    places, at = np.unique(place, return_inverse=True)
    seen = np.zeros((len(points), len(places)), bool)
    seen[tracks.kind[tracks.point], at[tracks.picture]] = True
    part = parts_of_pairs(seen.T, points)
    shared = (seen.T * points) @ seen
    of = np.zeros(len(points), np.intp)
    kept = np.zeros_like(seen)
    for kind, row in enumerate(seen):
        among = np.flatnonzero(row)
        if len(among) == 1:
            of[kind] = part[among[0], among[0]]
            kept[kind, among] = True
            continue
        i, j = (among[side] for side in np.triu_indices(len(among), 1))
        parts, number = np.unique(part[i, j], return_inverse=True)
        most = int(np.bincount(number, shared[i, j]).argmax())
        of[kind] = parts[most]
        kept[kind, i[number == most]] = kept[kind, j[number == most]] = True
    return of, kept
