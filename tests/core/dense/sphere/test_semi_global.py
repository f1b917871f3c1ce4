"""Semi-global matching through given costs."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.dense.sphere.semi_global import summed_costs


def reference(costs: np.ndarray, step: int, jump: np.ndarray) -> np.ndarray:
    """The same, node by node, as the paper says."""
    levels, height, width = costs.shape
    sums = np.zeros(costs.shape, np.int64)
    for dy, dx in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        path = np.zeros(costs.shape, np.int64)
        for y in range(height)[:: dy or 1]:
            for x in range(width)[:: dx or 1]:
                here = costs[:, y, x].astype(np.int64)
                py, px = y - dy, x - dx
                # diagonal paths begin anew at the sides from what stands beside
                px = min(max(px, 0), width - 1) if dy else px
                if 0 <= py < height and 0 <= px < width:
                    before = path[:, py, px]
                    least = before.min()
                    beside = np.full((2, levels), 10**6)
                    beside[0, 1:], beside[1, :-1] = before[:-1] + step, before[1:] + step
                    here += np.minimum(np.minimum(before, beside.min(axis=0)), least + jump[y, x]) - least
                path[:, y, x] = here
        sums += path
    return sums


def test_paths_from_eight_directions_are_summed() -> None:
    random = np.random.default_rng(3)
    costs = random.integers(0, 60, (6, 7, 9)).astype(np.uint8)
    jump = random.integers(8, 30, (7, 9)).astype(np.int16)
    assert np.array_equal(summed_costs(costs, 3, jump), reference(costs, 3, jump))


@pytest.mark.parametrize("turn", [1, 2, 3])
def test_no_direction_is_better_than_another(turn: int) -> None:
    costs = np.random.default_rng(0).integers(0, 60, (5, 12, 12)).astype(np.uint8)
    jump = np.full((12, 12), 20, np.int16)
    found = summed_costs(np.rot90(costs, turn, (1, 2)), 3, jump)
    inner = np.s_[:, 3:-3, 3:-3]  # at corners diagonal paths begin in different ways
    straight = summed_costs(costs, 3, jump)
    assert np.array_equal(np.rot90(found, -turn, (1, 2))[inner].argmin(0), straight[inner].argmin(0))


def test_a_surface_is_found_where_single_nodes_say_nothing() -> None:
    costs = np.full((8, 20, 20), 10, np.uint8)
    costs[3, ::3, ::3] = 0
    assert (summed_costs(costs, 3, np.full((20, 20), 16, np.int16)).argmin(0) == 3).all()
