"""The cut is the cheapest there is, checked against every labelling of small grids."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from edf_stitch.core.compose.options import MIN_CUT
from edf_stitch.core.compose.seams.min_cut import FIRST, FREE, NOWHERE, SECOND, min_cut
from hypothesis import given, settings
from hypothesis import strategies as st


def price(labels: np.ndarray, cost: np.ndarray, known: np.ndarray, each: np.ndarray) -> float:
    total = float(each[labels & (known == FREE)].sum())
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        border = (labels[a] != labels[b]) & (known[a] != NOWHERE) & (known[b] != NOWHERE)
        border &= (known[a] == FREE) | (known[b] == FREE)
        total += float(((cost[a] + cost[b]) / 2 + 1 / MIN_CUT.units)[border].sum())
    return total


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.05, 0.8]))
def test_no_labelling_is_cheaper(seed: int, dearest: float) -> None:
    random = np.random.default_rng(seed)
    shape = (3, 4)
    cost = random.random(shape).astype(np.float32)
    known = random.choice([FIRST, SECOND, FREE, FREE, FREE, NOWHERE], shape).astype(np.int8)
    each = (dearest * (random.random(shape) - 0.3)).astype(np.float32)
    found = min_cut(cost, known, each if dearest else None)
    assert (found[known == SECOND]).all() and not found[(known == FIRST) | (known == NOWHERE)].any()
    free = np.argwhere(known == FREE)
    best = np.inf
    for choice in itertools.product((False, True), repeat=len(free)):
        labels = known == SECOND
        labels[tuple(free.T)] = choice
        best = min(best, price(labels, cost, known, each))
    assert price(found, cost, known, each) == pytest.approx(best, abs=30 / MIN_CUT.units)


def test_it_follows_a_valley_of_low_cost() -> None:
    cost = np.full((40, 60), 0.8, np.float32)
    rows = np.arange(40)
    valley = (30 + 10 * np.sin(rows / 6)).astype(int)
    cost[rows, valley] = cost[rows, valley + 1] = 0.0
    known = np.zeros(cost.shape, np.int8)
    known[:, 0], known[:, -1] = FIRST, SECOND
    found = min_cut(cost, known)
    assert (np.abs(found.argmax(axis=1) - valley) <= 3).all()


def test_of_equal_cuts_the_first_picture_gets_most() -> None:
    known = np.zeros((5, 9), np.int8)
    known[:, 0], known[:, -1] = FIRST, SECOND
    assert min_cut(np.full(known.shape, 0.5, np.float32), known)[:, :-1].sum() == 0


@pytest.mark.parametrize(("known", "second"), [(FREE, 0), (FIRST, 0), (SECOND, 20), (NOWHERE, 0)])
def test_with_one_side_only_there_is_no_cut(known: int, second: int) -> None:
    grid = np.full((4, 5), known, np.int8)
    assert min_cut(np.ones(grid.shape, np.float32), grid).sum() == second
    grid[0, 0] = FIRST
    assert not min_cut(np.ones(grid.shape, np.float32), np.where(grid == SECOND, FREE, grid)).any()
    grid[:] = FREE
    grid[0, 0] = SECOND
    assert min_cut(np.ones(grid.shape, np.float32), grid).all(), "all that hangs on the second alone is the second's"
