"""The random rigs that the tests of registration stand on are what they say."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous

from .rigs import KINDS, make_rig


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "wrong"])
def test_matches_follow_from_poses(kind: str) -> None:
    rig = make_rig(kind, 1, points=2000)
    K = rig.true_cameras[0].K
    for pair in rig.matches:
        right = rig.true_matches(pair)
        assert len(right) >= 0.7 * len(pair)
        for column in (0, 1):
            assert len(np.unique(pair.index[:, column])) == len(pair)
        R = rig.R[pair.j] @ rig.R[pair.i].T
        t = rig.t[pair.j] - R @ rig.t[pair.i]
        x, y = (homogeneous(rig.points[k][right[:, column]]) for column, k in ((0, pair.i), (1, pair.j)))
        a, b = x @ np.linalg.inv(K).T @ R.T, y @ np.linalg.inv(K).T
        off_plane = np.abs(np.cross(a, b) @ t) * rig.focal / np.maximum(np.linalg.norm(np.cross(b, t), axis=1), 1e-12)
        assert np.median(off_plane) < 1.5


def test_same_seed_same_rig() -> None:
    first, second = (make_rig("ring", 3, points=1000) for _ in range(2))
    np.testing.assert_array_equal(first.points[0], second.points[0])
    assert len(first.matches) == len(second.matches)
    assert not np.array_equal(first.R, make_rig("ring", 4, points=1000).R)


def test_shuffled_keeps_pairs() -> None:
    rig = make_rig("ring", 0, points=1000)
    order = np.random.default_rng(0).permutation(len(rig.cameras))
    other = rig.shuffled(order)
    assert sum(len(pair) for pair in other.matches) == sum(len(pair) for pair in rig.matches)
    assert all(pair.i < pair.j and len(other.true_matches(pair)) >= 0.7 * len(pair) for pair in other.matches)


def test_a_chain_has_no_point_in_three_pictures() -> None:
    rig = make_rig("chain", 0)
    used = [set() for _ in rig.cameras]
    for pair in rig.matches:
        right = rig.true_matches(pair)
        for column, k in ((0, pair.i), (1, pair.j)):
            new = set(right[:, column].tolist())
            assert not used[k] & new
            used[k] |= new
    assert len(rig.matches) == len(rig.cameras) - 1


def test_a_wrong_pair_has_no_right_match() -> None:
    rig = make_rig("wrong", 0)
    (wrong,) = [pair for pair in rig.matches if (pair.i, pair.j) == (0, 5)]
    assert len(wrong) >= 60 and not len(rig.true_matches(wrong))
