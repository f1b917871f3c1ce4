"""Lengths are told by points that three pictures see where there are enough, elsewhere by depth that goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.rig.averaging.averaged import PairGeometry
from edf_stitch.core.rig.bundling.continuity import Neighbours, log_sizes, neighbours_of
from edf_stitch.core.rig.bundling.parts import part_of_points, parts_of_pairs, supported
from edf_stitch.core.rig.bundling.positions import place_pictures
from edf_stitch.core.rig.bundling.tracks import Tracks, build_tracks

from .rigs import SyntheticRig, make_rig
from .test_positions import off, problem_of


def tracks_of(*sets: tuple[int, ...]) -> Tracks:
    """One track for each set of pictures."""
    index: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for number, pictures in enumerate(sets):
        for i, j in zip(pictures[:-1], pictures[1:], strict=True):
            index.setdefault((i, j), []).append((number, number))
    t = np.array([1.0, 0, 0])
    pairs = [
        PairGeometry(i, j, np.array(rows), 9, 9, np.eye(3), t, np.eye(3), 0.3, 5.0, -1.0, False, 0.0)
        for (i, j), rows in index.items()
    ]
    points = [np.column_stack([np.arange(len(sets)), np.full(len(sets), k)]).astype(float) for k in range(5)]
    return build_tracks(pairs, points, range(5))


def seen_in(tracks: Tracks) -> list[tuple[int, ...]]:
    bounds = [*tracks.starts.tolist(), len(tracks.picture)]
    return sorted(tuple(tracks.picture[a:b].tolist()) for a, b in zip(bounds[:-1], bounds[1:], strict=True))


def test_pairs_are_of_one_part_if_triangles_join_them() -> None:
    seen = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]], bool)
    part = parts_of_pairs(seen, np.array([4.0, 4, 100]))
    assert part[0, 1] == part[1, 2] == part[0, 2] == part[2, 3] == part[1, 3]
    assert len({part[0, 1], part[0, 3]}) == 2
    part = parts_of_pairs(seen, np.array([4.0, 3, 100]))
    assert part[0, 1] == part[1, 2] == part[0, 2] and len({part[0, 1], part[2, 3], part[1, 3]}) == 3


def test_a_side_between_pictures_of_one_place_ties_no_triangles() -> None:
    tracks = tracks_of(*[(0, 1, 2)] * 6, *[(0, 1, 3)] * 6, (0, 1))
    assert len(set(part_of_points(tracks, np.arange(5)).tolist())) == 1
    part = part_of_points(tracks, np.array([7, 7, 2, 3, 4]))
    assert len(set(part[:6].tolist())) == len(set(part[6:12].tolist())) == 1 and len(set(part.tolist())) == 3


def test_too_few_points_of_three_pictures_keep_two() -> None:
    few = tracks_of(*[(0, 1)] * 9, *[(1, 2)] * 5, *[(0, 1, 2)] * 3)
    assert seen_in(supported(few, 5)) == sorted([(0, 1)] * 12 + [(1, 2)] * 5)
    assert len(set(part_of_points(supported(few, 5), np.arange(5)).tolist())) == 2
    enough = tracks_of(*[(0, 1)] * 9, *[(1, 2)] * 5, *[(0, 1, 2)] * 4)
    assert supported(enough, 5) is enough
    assert len(set(part_of_points(enough, np.arange(5)).tolist())) == 1


def test_a_long_track_keeps_what_its_part_tells() -> None:
    found = supported(tracks_of(*[(0, 1, 2)] * 6, *[(2, 3)] * 9, (0, 1, 2, 3)), 5)
    assert seen_in(found) == sorted([(0, 1, 2)] * 7 + [(2, 3)] * 9)


def test_neighbours_are_of_two_parts_and_each_counts_once() -> None:
    """Across a gap in which nothing is, too."""
    tracks = tracks_of(*[(0, 1)] * 30, *[(1, 2)] * 30)
    part = part_of_points(tracks, np.arange(5))
    near = neighbours_of(tracks, part, np.ones(60, bool), np.arange(5), np.zeros((len(tracks.picture), 3)))
    assert (tracks.picture[near.first] == 1).all() and (tracks.picture[near.second] == 1).all()
    assert (part[tracks.point[near.first]] != part[tracks.point[near.second]]).all()
    assert len(near.first) == 30 == len(set(near.first.tolist())) == len(set(near.second.tolist()))


def test_parts_that_meet_at_a_place_and_in_none_of_its_pictures_have_neighbours_there() -> None:
    """Pictures 0 and 1 are of one place; 2 shares points with the one, 3 with the other."""
    tracks = tracks_of(*[(0, 2)] * 6, *[(1, 3)] * 6)
    angle = np.where(tracks.point < 6, 0.0, 1.0) + 0.01 * tracks.point
    directions = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    for place, count in ((np.arange(5), 0), (np.array([0, 0, 2, 3, 4]), 6)):
        near = neighbours_of(tracks, part_of_points(tracks, place), np.ones(12, bool), place, directions)
        assert len(near.first) == count
        assert {*tracks.picture[near.first], *tracks.picture[near.second]} <= {0, 1}


def spread_of_lengths(rig: SyntheticRig) -> float:
    """Log of the ratio between a chain's most enlarged and most reduced length."""
    problem, begun = problem_of(rig)
    problem = replace(problem, tracks=supported(problem.tracks, problem.pictures))
    placed = place_pictures(problem, begun)
    lengths, true = (np.linalg.norm(np.diff(c, axis=0), axis=1) for c in (placed.centres, rig.centres))
    return float(np.ptp(np.log(lengths / true)))


@pytest.mark.parametrize("pictures", [5, 9])
def test_no_length_along_a_chain_collapses(pictures: int) -> None:
    """The linear rounds alone let all lengths but one shrink, a little more each round."""
    assert max(spread_of_lengths(make_rig("chain", seed, pictures=pictures)) for seed in range(6)) < np.log(3)


@pytest.mark.parametrize("number", [7, 47])
def test_a_wrong_point_of_three_pictures_sets_no_length(number: int) -> None:
    """With its third observation it would; with the wrong two alone it is off their line, or fits it by chance."""
    rig = make_rig("chain", 0)
    first, second = rig.matches[:2]
    wrong = np.array([[rig.true_matches(first)[25, 1], rig.true_matches(second)[number, 1]]])
    rig.identity[2][wrong[0, 1]] = rig.identity[1][wrong[0, 0]]
    joined = replace(second, index=np.concatenate([second.index[second.index[:, 1] != wrong[0, 1]], wrong]))
    assert spread_of_lengths(replace(rig, matches=[first, joined, *rig.matches[2:]])) < np.log(1.5)


def test_parts_without_neighbours_keep_their_sizes() -> None:
    none = np.zeros(0, np.intp)
    sizes = log_sizes(Neighbours(none, none, np.zeros(0)), none, np.arange(3), np.zeros(0))
    np.testing.assert_array_equal(sizes, np.zeros(3))


def test_parts_grow_until_depths_go_on() -> None:
    """Three parts in two pictures: the second is half as large as it has to be, the third three times."""
    picture, part = np.repeat([0, 0, 1, 1], 3), np.repeat([0, 1, 1, 2], 3)
    depth = np.array([4, 5, 6, 2, 2.5, 3, 1, 2, 3, 6, 12, 18.0])
    near = Neighbours(np.array([0, 1, 2, 6, 7, 8]), np.array([3, 4, 5, 9, 10, 11]), np.ones(6))
    sizes = np.exp(log_sizes(near, picture, part, depth))
    np.testing.assert_allclose(sizes / sizes[0], [1, 2, 1 / 3], rtol=1e-12)


def test_loops_tell_lengths_better_than_depth() -> None:
    """A ring of links that no three-view points tie closes only with the right lengths."""
    rig = make_rig("ring", 3)
    links = []
    for pair in rig.matches:
        if pair.j - pair.i in (1, 10):
            number = pair.i if pair.j - pair.i == 1 else 10
            kept = rig.identity[pair.i][pair.index[:, 0]] % 3 == number % 3
            links.append(replace(pair, index=pair.index[kept]))
    problem, begun = problem_of(replace(rig, matches=links))
    assert len(np.unique(part_of_points(problem.tracks, np.arange(11)))) == 11
    assert off(place_pictures(problem, begun).centres, rig).max() < 0.15 * rig.extent
