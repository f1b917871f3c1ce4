"""What hypotheses are compared by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.rig import PictureMatches
from edf_stitch.core.rig.averaging.averaged import PairGeometry, Verified
from edf_stitch.core.rig.averaging.averaging import hypotheses
from edf_stitch.core.rig.averaging.pairs import verified
from edf_stitch.core.rig.averaging.turns import rotations
from edf_stitch.core.rig.bundling.bundle_options import JUDGE
from edf_stitch.core.rig.bundling.judging import judged
from edf_stitch.core.rig.bundling.polishing import Polished
from edf_stitch.core.rig.bundling.solving import Solved, solve

from .rigs import SyntheticRig, make_rig

MOST = JUDGE.kernel_px**2 * np.log1p(JUDGE.missed_kernels)


class _Ended:
    """A rig whose registration came to its end."""

    def __init__(self, kind: str) -> None:
        self.rig: SyntheticRig = make_rig(kind, 0, points=2000)
        self.checked: Verified = verified(self.rig.points, self.rig.matches, 1.0, 0)
        averages = hypotheses(self.rig.cameras, self.rig.points, self.checked)
        found = solve(self.rig.cameras, self.rig.points, self.checked, averages[0], lambda: None)
        assert found is not None
        self.solved: Solved = found

    def cost(
        self,
        found: Polished | None = None,
        pairs: Sequence[PairGeometry] | None = None,
        checked: Verified | None = None,
    ) -> float:
        return judged(
            self.rig.cameras, self.rig.points, checked or self.checked, self.solved.averaged.members,
            self.solved.pairs if pairs is None else pairs, found or self.solved.found,
        )  # fmt: skip


@pytest.fixture(scope="module")
def ring() -> _Ended:
    return _Ended("ring")


@pytest.fixture(scope="module")
def tripod() -> _Ended:
    return _Ended("tripod")


def _shuffled(pair: PictureMatches) -> PictureMatches:
    other = np.random.default_rng(0).permutation(len(pair))
    return replace(pair, index=np.column_stack([pair.index[:, 0], pair.index[other, 1]]))


def test_it_is_what_the_end_says(ring: _Ended) -> None:
    assert ring.cost() == ring.solved.cost


@pytest.mark.parametrize("kind", ["ring", "tripod"])
def test_matches_that_no_track_took_cost_what_they_are_off(kind: str, request: pytest.FixtureRequest) -> None:
    """Right ones little, whether there are epipolar lines or places are one; wrong ones nearly the most."""
    ended: _Ended = request.getfixturevalue(kind)
    right = ended.cost(pairs=[]) - ended.cost(pairs=ended.solved.pairs)
    wrong = tuple(_shuffled(pair) for pair in ended.checked.pairs)
    all_wrong = ended.cost(pairs=[], checked=replace(ended.checked, pairs=wrong)) - ended.cost()
    assert 0 < right < 0.4 * MOST
    assert 0.7 * MOST < all_wrong <= MOST


def test_matches_with_a_picture_left_out_cost_the_most(ring: _Ended) -> None:
    rig = ring.rig
    stray = PictureMatches(0, len(rig.cameras), np.column_stack([np.arange(100)] * 2))
    more = replace(ring.checked, pairs=(*ring.checked.pairs, stray))
    count = sum(len(pair) for pair in ring.checked.pairs)
    expected = (ring.cost() * count + 100 * MOST) / (count + 100)
    found = judged(
        (*rig.cameras, rig.cameras[0]), (*rig.points, rig.points[0]), more, ring.solved.averaged.members,
        ring.solved.pairs, ring.solved.found,
    )  # fmt: skip
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_picture_that_is_turned_costs_more_even_where_no_track_tells(ring: _Ended) -> None:
    found = ring.solved.found
    R = found.solution.R.copy()
    R[3] = rotations(np.array([0.02, 0, 0])) @ R[3]
    nothing = np.zeros_like(found.solution.solved)
    blind = replace(found, solution=replace(found.solution, solved=nothing))
    turned = replace(found, solution=replace(found.solution, solved=nothing, R=R))
    assert ring.cost(turned, pairs=[]) > ring.cost(blind, pairs=[]) + 0.02 * MOST
