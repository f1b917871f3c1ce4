"""Tracks join what is one point, and nothing that is not."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.rig.averaging.averaged import PairGeometry
from edf_stitch.core.rig.bundling.tracks import build_tracks, fitting_pairs, pairs_within
from hypothesis import given
from hypothesis import strategies as st

POINTS = [np.arange(12.0).reshape(6, 2) + 100 * k for k in range(4)]


def _pair(i: int, j: int, index: list[tuple[int, int]], off_degrees: float = 0.0, degrees: float = 0.1) -> PairGeometry:
    information = np.eye(3) / np.radians(degrees) ** 2
    kept = np.array(index, np.intp).reshape(-1, 2)
    t = np.array([1.0, 0, 0])
    return PairGeometry(i, j, kept, 9, 9, np.eye(3), t, information, 0.3, 5.0, -1.0, False, off_degrees)


def _as_sets(pairs: list[PairGeometry], members: tuple[int, ...] = (0, 1, 2, 3)) -> set[frozenset[tuple[int, int]]]:
    tracks = build_tracks(pairs, POINTS, members)
    points: dict[int, set[tuple[int, int]]] = {}
    for picture, point, feature in zip(tracks.picture, tracks.point, tracks.feature, strict=True):
        points.setdefault(int(point), set()).add((members[picture], int(feature)))
    return {frozenset(track) for track in points.values()}


def test_matches_of_three_pictures_are_one_track() -> None:
    found = _as_sets([_pair(0, 1, [(0, 1), (2, 2)]), _pair(1, 2, [(1, 5)])])
    assert found == {frozenset({(0, 0), (1, 1), (2, 5)}), frozenset({(0, 2), (1, 2)})}


def test_two_features_of_a_picture_are_never_one_point() -> None:
    """0:0 = 1:1 = 2:2, and then 2:2 = 0:3: the last, of the weakest pair, is refused."""
    pairs = [_pair(0, 1, [(0, 1), (4, 4), (5, 5)]), _pair(1, 2, [(1, 2), (4, 4)]), _pair(0, 2, [(3, 2)])]
    assert frozenset({(0, 0), (1, 1), (2, 2)}) in _as_sets(pairs)
    assert not any({(0, 0), (0, 3)} <= track for track in _as_sets(pairs))


def test_pictures_are_counted_among_the_members() -> None:
    tracks = build_tracks([_pair(1, 3, [(0, 1)])], POINTS, (1, 3))
    assert tracks.picture.tolist() == [0, 1]
    np.testing.assert_array_equal(tracks.pixels, [POINTS[1][0], POINTS[3][1]])


def test_kinds_tell_sets_of_pictures_apart() -> None:
    tracks = build_tracks([_pair(0, 1, [(0, 0), (1, 1)]), _pair(0, 2, [(2, 2)])], POINTS, (0, 1, 2, 3))
    kinds = dict(zip(tracks.feature[tracks.starts].tolist(), tracks.kind.tolist(), strict=True))
    assert kinds[0] == kinds[1] != kinds[2]


def test_pairs_that_the_average_contradicts_are_left_out() -> None:
    good, weak, bad = _pair(0, 1, [(0, 0)]), _pair(0, 2, [(1, 1)] * 2, 6.0, 2.0), _pair(0, 3, [(2, 2)], 6.0)
    assert fitting_pairs([good, weak, bad]) == [weak, good]
    assert fitting_pairs([bad]) == [bad]


@given(st.lists(st.integers(1, 5), min_size=1, max_size=6))
def test_pairs_within_a_point_are_all(lengths: list[int]) -> None:
    point = np.repeat(np.arange(len(lengths)), lengths)
    first, second = pairs_within(point)
    expected = {(a, b) for a in range(len(point)) for b in range(a + 1, len(point)) if point[a] == point[b]}
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == expected
