"""Tracks: features of several pictures that are one point, from the inliers of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from ..averaging.averaged import PairGeometry
from .bundle_options import TRACKS

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Tracks:
    """Observations of points, sorted by point and then by picture.

    picture, point, feature (O,): numbers of each, pictures counted among those of the rig; pixels (O, 2); starts (P,):
    the first observation of every point; kind (P,): a number for each set of pictures that sees a point.
    """

    picture: Index
    point: Index
    feature: Index
    pixels: Array
    starts: Index
    kind: Index

    def __len__(self) -> int:
        return len(self.starts)


def pairs_within(point: Index) -> tuple[Index, Index]:
    """All pairs of observations of one point, the earlier first; point (O,): of each observation, ascending."""
    first, second = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
    step = 1
    while len(same := np.flatnonzero(point[step:] == point[: max(len(point) - step, 0)])):
        first.append(same)
        second.append(same + step)
        step += 1
    return np.concatenate(first), np.concatenate(second)


def fitting_pairs(pairs: Sequence[PairGeometry]) -> list[PairGeometry]:
    """Those that the averaged rotations agree with, the strongest first; all if none does."""
    limit = TRACKS.most_degrees
    fitting = [pair for pair in pairs if pair.off_degrees < max(limit, TRACKS.most_sigmas * pair.degrees)]
    return sorted(fitting or pairs, key=lambda pair: -len(pair.index))


def build_tracks(pairs: Sequence[PairGeometry], points: Sequence[Array], members: Sequence[int]) -> Tracks:
    """Joins the inliers of pairs, given strongest first; a join that would put two features of one picture into a track
    is refused.

    points: of all pictures (n, 2), raw px; members: numbers of the rig's pictures among them.
    """
    firsts = np.concatenate([[0], np.cumsum([len(p) for p in points])])
    owner = _joined(pairs, firsts)
    ends = [firsts[pair.i] + pair.index[:, 0] for pair in pairs] + [firsts[pair.j] + pair.index[:, 1] for pair in pairs]
    nodes = np.unique(np.concatenate(ends))
    roots = owner[nodes]
    _, point, counts = np.unique(roots, return_inverse=True, return_counts=True)
    kept = counts[point] >= 2
    nodes, point = nodes[kept], point[kept]
    picture = np.searchsorted(np.asarray(members), np.searchsorted(firsts, nodes, "right") - 1)
    order = np.lexsort((picture, point))
    nodes, picture = nodes[order], picture[order]
    _, point = np.unique(point[order], return_inverse=True)
    number = np.searchsorted(firsts, nodes, "right") - 1
    feature = nodes - firsts[number]
    pixels = np.concatenate(list(points))[nodes]
    starts = np.searchsorted(point, np.arange(point.max(initial=-1) + 1))
    return Tracks(picture, point, feature, pixels, starts, kinds_of(picture, starts, len(members)))


def _joined(pairs: Sequence[PairGeometry], firsts: Index) -> Index:
    """For every feature of all pictures the number of the track that it belongs to: that of one of its features."""
    owner = np.arange(firsts[-1])
    joined: dict[int, tuple[list[int], set[int]]] = {}  # of each track: its features, its pictures
    for pair in pairs:
        i, j = pair.i, pair.j
        left, right = (firsts[i] + pair.index[:, 0]).tolist(), (firsts[j] + pair.index[:, 1]).tolist()
        for a, b in zip(left, right, strict=True):
            first, second = int(owner[a]), int(owner[b])
            if first == second:
                continue
            features, pictures = joined.get(first) or ([a], {i})
            others, their_pictures = joined.get(second) or ([b], {j})
            if pictures & their_pictures:
                continue
            if len(others) > len(features):
                first, second, features, others = second, first, others, features
            owner[others] = first
            joined[first] = (features + others, pictures | their_pictures)
            joined.pop(second, None)
    return owner


def kinds_of(picture: Index, starts: Index, count: int) -> Index:
    """A number (P,) for each set of pictures."""
    if not len(starts):
        return np.zeros(0, np.intp)
    seen = np.zeros((len(starts), count), bool)
    point = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(picture))))
    seen[point, picture] = True
    return np.unique(np.packbits(seen, axis=1), axis=0, return_inverse=True)[1].ravel()
