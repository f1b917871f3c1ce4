"""Which pairs are matched, and which of their matches agree."""

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.pose.features import Features
from edf_stitch.core.rig.averaging.pairs import chosen_pairs, verified

from .rigs import make_rig


def features_along_a_walk(count: int, seed: int = 0) -> list[Features]:
    """Each picture shows 200 of the world's points, half of them those of its neighbour."""
    rng = np.random.default_rng(seed)
    world = rng.normal(size=(100 * count + 100, 128)).astype(np.float32)
    found = []
    for k in range(count):
        seen = world[100 * k : 100 * k + 200] + rng.normal(0, 0.3, (200, 128)).astype(np.float32)
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        found.append(Features(rng.uniform(0, 800, (200, 2)), seen, 1.0))
    return found


def test_small_sets_are_matched_throughout():
    features = features_along_a_walk(5)
    assert chosen_pairs(features) == [(i, j) for i in range(5) for j in range(i + 1, 5)]


def test_of_sixty_pictures_each_meets_those_it_shares_points_with():
    pairs = set(chosen_pairs(features_along_a_walk(60)))
    assert {(k, k + 1) for k in range(59)} <= pairs
    degree = np.bincount(np.array(sorted(pairs)).ravel(), minlength=60)
    assert degree.min() >= 20 and len(pairs) <= 60 * 20 < 60 * 59 / 2


def test_the_choice_does_not_depend_on_the_order():
    features = features_along_a_walk(45)
    order = np.random.default_rng(1).permutation(45)
    shuffled = chosen_pairs([features[k] for k in order], most_each=5)
    assert {tuple(sorted((order[i], order[j]))) for i, j in shuffled} == set(chosen_pairs(features, most_each=5))


@pytest.fixture(scope="module")
def ring():
    return make_rig("ring", 2)


def test_matches_that_agree_are_right(ring):
    kept = verified(ring.points, ring.matches, 1.0, 0)
    for pair in kept.pairs:
        right = {tuple(row) for row in ring.true_matches(pair)}
        assert np.mean([tuple(row) in right for row in pair.index]) > 0.93
    before = {(pair.i, pair.j): len(pair) for pair in ring.matches}
    assert [before[pair.i, pair.j] for pair in kept.pairs] == list(kept.found)
    assert [len(pair) for pair in kept.pairs] == sorted((len(pair) for pair in kept.pairs), reverse=True)


def test_matches_at_random_are_no_pair_but_counted():
    rng = np.random.default_rng(0)
    points = [rng.uniform(0, 800, (100, 2)) for _ in range(3)]
    index = np.column_stack([rng.permutation(100), rng.permutation(100)])
    kept = verified(points, [PictureMatches(0, 1, index), PictureMatches(1, 2, index[:20])], 1.0, 0)
    assert kept.pairs == ()
    assert 7 <= kept.best[0] < 24 and kept.best[0] == kept.best[1] and kept.best[2] == 0


def test_few_right_matches_among_many_wrong_are_chance(ring):
    """24 agree by chance where thousands are tried: a share counts too."""
    pair = max(ring.matches, key=len)
    right = ring.true_matches(pair)[:28]
    rng = np.random.default_rng(0)
    wrong = np.column_stack([rng.integers(0, len(ring.points[k]), 300) for k in (pair.i, pair.j)])
    both = PictureMatches(pair.i, pair.j, np.concatenate([right, wrong]))
    alone = PictureMatches(pair.i, pair.j, right)
    assert len(verified(ring.points, [alone], 1.0, 0).pairs) == 1
    assert verified(ring.points, [both], 1.0, 0).pairs == ()


def test_the_same_matches_agree_whichever_picture_is_first(ring):
    pair = ring.matches[0]
    flipped = PictureMatches(pair.i, pair.j, pair.index[::-1, ::-1])
    swapped = list(ring.points)
    swapped[pair.i], swapped[pair.j] = swapped[pair.j], swapped[pair.i]
    first = verified(ring.points, [pair], 1.0, 0).pairs[0].index
    second = verified(swapped, [flipped], 1.0, 0).pairs[0].index[:, ::-1]
    np.testing.assert_array_equal(first, second)
