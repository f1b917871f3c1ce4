"""Rotations averaged over pairs; each guard against wrong pairs by what would go wrong without it."""

import numpy as np
import pytest
from edf_stitch.core.rig.averaging.rotation_averaging import NEVER, Links, average, worst_loop
from edf_stitch.core.rig.averaging.triplets import triangles, without_contradicted
from edf_stitch.core.rig.averaging.turns import degrees_between, rotations
from hypothesis import given, settings
from hypothesis import strategies as st

KNOWN = 1e12


def turn(*degrees: float):
    return rotations(np.radians(np.array(degrees, float)))


def true_rotations(count: int, seed: int = 0):
    return rotations(np.random.default_rng(seed).normal(0, 0.6, (count, 3)))


def links_of(R, pairs, degrees=0.2, noise=0.0, others=None, inliers=300, seed=0, by_focal=0.0):
    """Pairs of true rotations with noise; others: {number of a pair: [(rotation off the true one, cost)]}, which
    replace the candidates of that pair."""
    rng = np.random.default_rng(seed)
    count, others = len(pairs), others or {}
    most = max([1, *(len(found) for found in others.values())])
    between = np.array([R[j] @ R[i].T for i, j in pairs])
    found = rotations(rng.normal(0, np.radians(noise), (count, 3))) @ between
    candidates, costs = np.tile(found[:, None], (1, most, 1, 1)), np.full((count, most), NEVER)
    costs[:, 0] = 0
    for k, replaced in others.items():
        for c, (off, cost) in enumerate(replaced):
            candidates[k, c], costs[k, c] = off @ between[k], cost
    degrees = np.broadcast_to(degrees, count)
    information = np.radians(degrees)[:, None, None] ** -2 * np.eye(3)
    along = np.tile([0.0, by_focal, 0.0], (count, 1))
    return Links(len(R), tuple(pairs), candidates, costs, information, along, np.broadcast_to(inliers, count))


def worst(found, R) -> float:
    """Largest error of a relative rotation, degrees."""
    i, j = np.triu_indices(len(R), 1)
    return float(degrees_between(found.R[j] @ np.swapaxes(found.R[i], 1, 2), R[j] @ np.swapaxes(R[i], 1, 2)).max())


def ring_pairs(count: int):
    return [(k, (k + 1) % count) for k in range(count)]


def all_pairs(count: int):
    return [(i, j) for i in range(count) for j in range(i + 1, count)]


@settings(deadline=None, max_examples=30)
@given(st.integers(3, 9), st.integers(0, 10**6), st.data())
def test_pairs_without_noise_give_the_truth(count, seed, data):
    extra = data.draw(st.lists(st.sampled_from(all_pairs(count)), unique=True))
    pairs = sorted({(i, i + 1) for i in range(count - 1)} | set(extra))
    R = true_rotations(count, seed)
    assert worst(average(links_of(R, pairs), KNOWN), R) < 1e-5


def test_noise_is_averaged_and_sure_pairs_count_more():
    R, pairs = true_rotations(8), all_pairs(8)
    degrees = np.where(np.arange(len(pairs)) % 3, 2.0, 0.2)
    found = links_of(R, pairs, degrees, noise=0.0, seed=3)
    rng = np.random.default_rng(0)
    noisy = rotations(rng.normal(size=(len(pairs), 3)) * np.radians(degrees)[:, None]) @ found.R[:, 0]
    noisy = Links(8, found.pairs, noisy[:, None], found.costs, found.information, found.by_focal, found.inliers)
    alike = links_of(R, pairs, 2.0)
    alike = Links(8, noisy.pairs, noisy.R, noisy.costs, alike.information, noisy.by_focal, noisy.inliers)
    assert worst(average(noisy, KNOWN), R) < 1 < 2 < worst(average(alike, KNOWN), R)


def test_a_pair_that_errs_does_not_pull_the_others():
    """Cauchy: least squares would turn the pictures by a third of the error."""
    R, pairs = true_rotations(6), all_pairs(6)
    links = links_of(R, pairs, 0.2, others={4: [(turn(0, 1.9, 0), 0)]})
    assert worst(average(links, KNOWN), R) < 0.1


def test_triangles_that_do_not_close_drop_the_wrong_pair():
    R, pairs = true_rotations(5), all_pairs(5)
    links = links_of(R, pairs, 0.2, others={3: [(turn(0, 40, 0), 0)]})
    found = triangles(pairs, [each[:1] for each in links.R], links.degrees)
    used, closed = without_contradicted(5, pairs, found, links.degrees, np.ones(10, bool))
    np.testing.assert_array_equal(used, np.arange(10) != 3)
    np.testing.assert_array_equal(closed == 3, [0 not in p and 4 not in p for p in pairs])


def test_the_least_certain_of_a_triangle_goes_and_no_bridge():
    R = true_rotations(4)
    pairs = [(0, 1), (1, 2), (0, 2), (2, 3)]
    links = links_of(R, pairs, np.array([0.2, 0.5, 0.2, 3.0]), others={0: [(turn(30, 0, 0), 0)]})
    found = triangles(pairs, [each[:1] for each in links.R], links.degrees)
    used, _ = without_contradicted(4, pairs, found, links.degrees, np.ones(4, bool))
    np.testing.assert_array_equal(used, [True, False, True, True])


def test_a_second_candidate_closes_a_triangle():
    R, pairs = true_rotations(3), [(0, 1), (1, 2), (0, 2)]
    wrong = (turn(0, 8, 0), 0.0)
    both = links_of(R, pairs, 0.2, others={1: [wrong, (turn(0, 0, 0), 4.0)]})
    found = triangles(pairs, [each[:cost] for each, cost in zip(both.R, (1, 2, 1), strict=True)], both.degrees)
    assert found.misfit[0] < 0.1
    result = average(both, KNOWN)
    assert worst(result, R) < 0.01 and result.choice[1] == 1


def test_candidates_are_switched_where_only_a_long_loop_closes():
    """Spread over twelve pairs, each is off by less than any would be alone: only the whole tells."""
    R, pairs = true_rotations(12), ring_pairs(12)
    links = links_of(R, pairs, 0.6, others={5: [(turn(0, 7, 0), 0.0), (turn(0, 0, 0), 3.0)]})
    result = average(links, KNOWN)
    assert result.choice[5] == 1 and worst(result, R) < 0.01


def test_a_candidate_that_is_unlikely_is_not_taken_for_little():
    R, pairs = true_rotations(12), ring_pairs(12)
    links = links_of(R, pairs, 0.6, others={5: [(turn(0, 0.3, 0), 0.0), (turn(0, 0, 0), 9.0)]})
    assert average(links, KNOWN).choice[5] == 0


def test_a_false_pair_across_a_ring_is_left_out():
    """No triangle knows it, and it is the most certain: the first tree is built on it."""
    R = true_rotations(11)
    pairs = [*ring_pairs(11), (0, 5)]
    degrees = np.array([*[0.8] * 11, 0.1])
    links = links_of(R, pairs, degrees, noise=0.3, others={11: [(turn(0, 140, 0), 0)]}, inliers=100)
    result = average(links, KNOWN)
    assert worst(result, R) < 3
    assert result.off_degrees[11] > 100 and (result.off_degrees[:11] < 1).all()


def test_pairs_that_a_wrong_one_contradicted_come_back():
    """It shares a triangle with each of four sound pairs, which are less certain and go first."""
    R = true_rotations(4)
    pairs = [(0, 1), (1, 2), (0, 3), (2, 3), (0, 2)]
    links = links_of(R, pairs, np.array([0.3, 0.3, 0.3, 0.3, 0.2]), others={4: [(turn(20, 0, 0), 0)]})
    result = average(links, KNOWN)
    assert worst(result, R) < 0.01
    np.testing.assert_array_equal(result.used, [True, True, True, True, False])


def test_a_closed_ring_tells_the_focal_length():
    """A tenth of a per cent of focal length opens a ring by a third of a degree."""
    count, log_focal = 12, 0.02
    R = rotations(np.array([[0, 2 * np.pi * k / count, 0] for k in range(count)]))
    pairs = ring_pairs(count)
    links = links_of(R, pairs, 0.3, by_focal=-2 * np.pi / count)
    off = rotations(np.tile([0, 2 * np.pi / count * log_focal, 0], (count, 1)))
    links = Links(
        count, links.pairs, off[:, None] @ links.R, links.costs, links.information, links.by_focal, links.inliers
    )
    free = average(links, 1 / 0.05**2)
    assert free.log_focal == pytest.approx(log_focal, rel=0.01) and worst(free, R) < 0.02
    assert abs(average(links, KNOWN).log_focal) < 1e-6
    elsewhere = average(links, 1e8, 0.01)
    assert elsewhere.log_focal == pytest.approx(0.01, abs=1e-4)


def test_the_worst_loop_is_told():
    R, pairs = true_rotations(6), ring_pairs(6)
    links = links_of(R, pairs, others={2: [(turn(0, 3, 0), 0)]})
    everything = np.ones(6, bool)
    assert worst_loop(links, links.R[:, 0], everything) == pytest.approx(3, abs=1e-6)
    everything[4] = False
    assert np.isnan(worst_loop(links, links.R[:, 0], everything))
