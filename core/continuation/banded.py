"""Least squares over a grid of unknowns of which each equation names a few that lie close together.

Numbered along the grid's shorter side, the normal equations are a band, and LAPACK's Cholesky factor of a band takes a
tenth of the time of a general sparse one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ..raster.arrays import Array


@dataclass(frozen=True, eq=False)
class Equations:
    """Σ_k factors[:, k] z[nodes[:, k]] = wanted: nodes (n, k), factors (n, k), wanted (n,)."""

    nodes: NDArray[np.intp]
    factors: Array
    wanted: Array

    @staticmethod
    def joined(parts: Sequence[Equations]) -> Equations:
        """Several sets of equations, each of which names as many unknowns, as one."""
        nodes, factors, wanted = zip(*((one.nodes, one.factors, one.wanted) for one in parts), strict=True)
        return Equations(np.concatenate(nodes), np.concatenate(factors), np.concatenate(wanted))

    def residual(self, z: Array) -> Array:
        """By how much (n,) unknowns z (N,) miss what is wanted."""
        missed: Array = np.einsum("nk,nk->n", self.factors, z[self.nodes]) - self.wanted
        return missed

    @cached_property
    def pairs(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Of every two unknowns of an equation (n, m): how far apart their numbers are, the smaller number, and what
        the two add to the normal equations for a weight of 1."""
        first, second = np.triu_indices(self.nodes.shape[1])
        a, b = self.nodes[:, first], self.nodes[:, second]
        product = self.factors[:, first] * self.factors[:, second]
        # an unknown that is named twice meets itself in both orders
        product = np.where((a == b) & (first != second), 2 * product, product)
        return np.abs(a - b), np.minimum(a, b), product


def solved(
    count: int, weighted: Sequence[tuple[Equations, Array]], diagonal: Array, right: Array
) -> Array:
    """The z (count,) that minimises Σ w (equation's residual)² + Σ diagonal z² − 2 Σ right z.

    weighted: equations, and weights (n,) of each; diagonal (count,) > 0 somewhere near every unknown; right (count,).
    """
    used = [(equations, weights) for equations, weights in weighted if len(weights)]
    band = 1 + max((int(equations.pairs[0].max()) for equations, _ in used), default=0)
    matrix = np.zeros(band * count)
    side = right.copy()
    for equations, weights in used:
        apart, lower, product = equations.pairs
        matrix += np.bincount((apart * count + lower).ravel(), (weights[:, None] * product).ravel(), band * count)
        pull = (weights * equations.wanted)[:, None] * equations.factors
        side += np.bincount(equations.nodes.ravel(), pull.ravel(), count)
    lower_band = matrix.reshape(band, count)
    lower_band[0] += diagonal
    z: Array = scipy.linalg.solveh_banded(
        lower_band, side, overwrite_ab=True, overwrite_b=True, lower=True, check_finite=False
    )
    return z
