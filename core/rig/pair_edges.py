"""Each pair of a rig with its matches and the rig's own geometry, for whatever asks about two pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.edge import Edge
from ..cameras.lens import undistort
from ..cameras.matches import Matches
from ..cameras.projective import fundamental_from_pose, infinite_homography
from ..cameras.rig import PictureMatches, Rig, RigEdge
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from .matching import Matched


def edges_of(rig: Rig, matched: Matched, numbers: Sequence[int]) -> tuple[Edge, ...]:
    """The pairs of a rig with their matches.

    Parameters
    ----------
    rig : Rig
    matched : Matched
        What was matched before.
    numbers : sequence of int
        Which of the pictures that were matched are in the rig, in its order.

    Returns
    -------
    tuple of Edge
        One for each of the rig's edges, in their order. Its geometry is the rig's own, and its inliers are the matches
        whose both ends are one point of the bundle.
    """
    by_pair = {frozenset((one.i, one.j)): one for one in matched.matches}
    points = _point_of_each_feature(rig, [matched.points[number] for number in numbers])
    found = []
    for edge in rig.edges:
        first, second = numbers[edge.i], numbers[edge.j]
        index = _from_to(by_pair[frozenset((first, second))], first)
        matches = Matches(
            matched.points[first][index[:, 0]], matched.points[second][index[:, 1]], matched.scale,
            given=matched.given,
        )  # fmt: skip
        ideal = Matches(
            undistort(matches.x, rig.cameras[edge.i]), undistort(matches.y, rig.cameras[edge.j]), matched.scale,
            given=matched.given,
        )  # fmt: skip
        one, other = points[edge.i][index[:, 0]], points[edge.j][index[:, 1]]
        found.append(Edge(edge.i, edge.j, matches, ideal, _two_view(rig, edge, (one == other) & (one >= 0))))
    return tuple(found)


def reordered_edges(edges: Sequence[Edge], rig: Rig, order: Sequence[int]) -> tuple[Edge, ...]:
    """The pairs of a rig whose pictures were put into another order (see `reordered`).

    Parameters
    ----------
    edges : sequence of Edge
        As they were.
    rig : Rig
        In the new order.
    order : sequence of int
        What number each of its pictures had.

    Returns
    -------
    tuple of Edge
        One for each of the rig's edges, in their order.
    """
    before = {(edge.i, edge.j): edge for edge in edges}
    found = []
    for edge in rig.edges:
        one, other = order[edge.i], order[edge.j]
        known = before.get((one, other)) or before[(other, one)]
        both = (known.matches, known.ideal)
        if known.i != one:
            both = (_swapped(known.matches), _swapped(known.ideal))
        found.append(Edge(edge.i, edge.j, *both, _two_view(rig, edge, known.two_view.inliers)))
    return tuple(found)


def _swapped(matches: Matches) -> Matches:
    return replace(matches, x=matches.y, y=matches.x)


def _from_to(matches: PictureMatches, first: int) -> NDArray[np.intp]:
    """The indices (M, 2) of a pair's matches, those of picture `first` in the first column."""
    return matches.index if matches.i == first else matches.index[:, ::-1]


def _point_of_each_feature(rig: Rig, features: Sequence[Array]) -> list[NDArray[np.intp]]:
    """For each picture the number of the bundle's point that each of its features (K, 2) px shows, −1 for none."""
    seen = rig.observations
    found = []
    for number, points in enumerate(features):
        own = seen.used & (seen.picture == number)
        by_place = dict(zip(map(tuple, seen.pixels[own].tolist()), seen.point[own].tolist(), strict=True))
        found.append(np.array([by_place.get(tuple(place), -1) for place in points.tolist()], np.intp))
    return found


def _two_view(rig: Rig, edge: RigEdge, inliers: NDArray[np.bool_]) -> TwoView:
    cameras = rig.cameras[edge.i], rig.cameras[edge.j]
    K, K_prime = (camera.K for camera in cameras)
    R = rig.R[edge.j] @ rig.R[edge.i].T
    baseline = rig.t[edge.j] - R @ rig.t[edge.i]
    length = float(np.linalg.norm(baseline))
    one_place = length == 0 or any({edge.i, edge.j} <= set(station) for station in rig.stations)
    t = np.zeros(3) if one_place else baseline / length
    deviation = float(rig.focal_deviation[edge.i]) if len(rig.focal_deviation) else float("nan")
    return TwoView(
        K=K, K_prime=K_prime, R=R, t=t,
        F=np.full((3, 3), np.nan) if one_place else fundamental_from_pose(K, K_prime, R, t),
        H_inf=infinite_homography(K, K_prime, R), e_prime=K_prime @ t, inliers=inliers, sigma=edge.noise_px,
        model="rotation" if one_place else "general",
        why="both were taken from one place" if one_place else "all pictures together",
        focal_source=cameras[0].source, focal_deviation=deviation, h_inf_spread=float("nan"),
    )  # fmt: skip
