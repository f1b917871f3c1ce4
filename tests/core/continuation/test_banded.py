"""The banded solver against NumPy's least squares."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.continuation.banded import Equations, LeastSquares


def equations(random: np.random.Generator, count: int, named: int, many: int) -> Equations:
    first = random.integers(0, count - 6, many)
    nodes = first[:, None] + random.integers(0, 6, (many, named))  # some name an unknown twice
    return Equations(nodes, random.normal(size=nodes.shape), random.normal(size=many))


def test_it_finds_what_dense_least_squares_finds_whatever_the_weights() -> None:
    random = np.random.default_rng(3)
    count = 40
    sets = [equations(random, count, named, many) for named, many in ((4, 60), (2, 50), (12, 0))]
    problem = LeastSquares(count, sets)
    diagonal, right = np.full(count, 0.3), random.normal(size=count)
    for _ in range(2):
        weights = [random.uniform(0.1, 2, len(one.wanted)) for one in sets]
        rows = np.zeros((sum(len(one.wanted) for one in sets), count))
        np.add.at(rows, (np.arange(60)[:, None], sets[0].nodes), sets[0].factors)
        np.add.at(rows, (60 + np.arange(50)[:, None], sets[1].nodes), sets[1].factors)
        weight, wanted = np.concatenate(weights), np.concatenate([one.wanted for one in sets])
        normal = rows.T @ (weight[:, None] * rows) + np.diag(diagonal)
        expected = np.linalg.solve(normal, rows.T @ (weight * wanted) + right)
        z = problem.solved(weights, diagonal, right)
        assert np.allclose(z, expected)
        assert np.allclose(np.concatenate(problem.residuals(z)), rows @ z - wanted)
