"""A rig seen from another of its pictures is the same rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import Registration, RigEdge
from edf_stitch.core.rig.reframing import best_connected, reordered, seen_from
from hypothesis import given, settings
from hypothesis import strategies as st

from .known_rigs import known_rig, pixels_seen


@given(seed=st.integers(0, 1000), order=st.permutations(range(4)), extent=st.sampled_from([0.0, 0.1, 1.0]))
@settings(max_examples=25, deadline=None)
def test_every_picture_sees_its_points_where_it_did(seed: int, order: list[int], extent: float) -> None:
    rig, _ = known_rig(4, seed, extent)
    other = reordered(rig, order)
    np.testing.assert_allclose(pixels_seen(other), pixels_seen(rig), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(other.rays, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(other.R[0], np.eye(3), atol=1e-12)
    assert not other.t[0].any()
    assert np.linalg.norm(other.t, axis=1).max() == pytest.approx(1.0 if extent else 0.0)
    assert [order[number] for number in other.observations.picture] == rig.observations.picture.tolist()


@given(seed=st.integers(0, 1000), order=st.permutations(range(4)))
@settings(max_examples=15, deadline=None)
def test_there_and_back_changes_nothing(seed: int, order: list[int]) -> None:
    rig, _ = known_rig(4, seed)
    back = reordered(reordered(rig, order), np.argsort(order).tolist())
    for name in ("R", "t", "rays", "inverse_ranges", "focal_deviation", "position_deviation"):
        np.testing.assert_allclose(getattr(back, name), getattr(rig, name), atol=1e-9, err_msg=name)
    assert [(edge.i, edge.j) for edge in back.edges] == [(edge.i, edge.j) for edge in rig.edges]
    np.testing.assert_array_equal(back.observations.picture, rig.observations.picture)


@given(seed=st.integers(0, 1000), given_as=st.permutations(range(5)))
@settings(max_examples=15, deadline=None)
def test_the_others_come_in_any_order_and_no_bit_changes(seed: int, given_as: list[int]) -> None:
    rig, _ = known_rig(5, seed)
    names = [f"{number}.jpg" for number in range(5)]
    one = seen_from(Registration(rig, (0, 1, 2, 3, 4), {}), "2.jpg", names, range(5))
    there = [f"{number}.jpg" for number in np.argsort(given_as)]
    other = seen_from(Registration(rig, tuple(given_as), {}), "2.jpg", there, range(5))
    assert one.numbers == (2, 0, 1, 3, 4) and other.numbers[0] == given_as[2]
    assert list(other.numbers[1:]) == sorted(other.numbers[1:])
    back = [other.numbers.index(given_as[number]) for number in one.numbers]
    same = other.rig.renumbered(back)
    for name in ("R", "t", "rays", "inverse_ranges", "deviations", "focal_deviation", "position_deviation"):
        assert getattr(same, name).tobytes() == getattr(one.rig, name).tobytes(), name
    np.testing.assert_array_equal(same.observations.picture, one.rig.observations.picture)
    in_own = [result.rig.renumbered(result.rig.own_order) for result in (one, other)]
    assert in_own[0].t.tobytes() == in_own[1].t.tobytes() and not in_own[0].t[0].any()


def test_what_is_said_of_each_picture_goes_with_it() -> None:
    rig, _ = known_rig(4)
    rig = replace(
        rig, lenses=(0, 1, 0, 2), stations=((1, 3),), focal_deviation=np.arange(4.0),
        edges=(RigEdge(0, 1, 9, 5, 1, 1, 1), RigEdge(1, 3, 9, 7, 1, 1, 1, "none")),
    )  # fmt: skip
    other = reordered(rig, [3, 0, 2, 1])
    assert other.lenses == (2, 0, 0, 1)
    assert other.stations == ((0, 3),)
    assert other.focal_deviation.tolist() == [3, 0, 2, 1]
    assert [(e.i, e.j, e.inliers, e.baseline) for e in other.edges] == [(0, 3, 7, "none"), (1, 3, 5, "measured")]


def test_deviations_follow_the_places() -> None:
    """Of points that are moved by their deviation: ρ in the other frame changes by the deviation there."""
    rig, _ = known_rig(3)
    step = 1e-6
    moved = replace(rig, inverse_ranges=rig.inverse_ranges + step)
    order = [2, 0, 1]
    change = reordered(moved, order).inverse_ranges - reordered(rig, order).inverse_ranges
    told = reordered(replace(rig, deviations=np.full(len(rig.rays), step)), order).deviations
    np.testing.assert_allclose(np.abs(change), told, rtol=1e-3)


def test_the_centre_is_reached_from_all_over_strong_edges() -> None:
    rig, _ = known_rig(4)

    def with_edges(*inliers: tuple[int, int, int]) -> int:
        return best_connected(replace(rig, edges=tuple(RigEdge(i, j, n, n, 1, 1, 0) for i, j, n in inliers)))

    assert with_edges((0, 1, 50), (0, 2, 50), (0, 3, 50)) == 0
    assert with_edges((0, 1, 50), (1, 2, 50), (2, 3, 500)) in (1, 2)
    assert with_edges((0, 1, 50), (1, 2, 50), (1, 3, 50)) == 1
    assert with_edges((0, 3, 10), (1, 3, 900), (2, 3, 900), (0, 2, 900)) == 2, "a weak edge is a long way"
