"""Least squares over a grid of unknowns of which each equation names a few that lie close together.

Numbered along the grid's shorter side, the normal equations are a band, and LAPACK's Cholesky factor of a band takes a
fraction of the time of a general sparse one. Their structure is worked out once: reweighting multiplies two matrices
by vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

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

    @property
    def band(self) -> int:
        """How far apart the numbers of two unknowns of one equation are, at most."""
        return int(np.ptp(self.nodes, axis=1).max(initial=0))


class LeastSquares:
    """Weighted least squares for unknowns z (count,), solved again and again with other weights."""

    def __init__(self, count: int, sets: Sequence[Equations]) -> None:
        self.count = count
        self.band = 1 + max(one.band for one in sets)
        self.wanted = np.concatenate([one.wanted for one in sets])
        self._ends = np.cumsum([len(one.wanted) for one in sets])[:-1]
        starts = np.concatenate([[0], self._ends])
        numbers = [np.arange(start, start + len(one.wanted)) for start, one in zip(starts, sets, strict=True)]
        named = [np.repeat(number, one.nodes.shape[1]) for number, one in zip(numbers, sets, strict=True)]
        self._factors = csr_matrix(
            (np.concatenate([one.factors.ravel() for one in sets]),
             (np.concatenate(named), np.concatenate([one.nodes.ravel() for one in sets]))),
            (len(self.wanted), count),
        )  # fmt: skip
        self._transposed = self._factors.T.tocsr()
        products, entries, pairs = zip(*(self._products(*one) for one in zip(sets, numbers, strict=True)), strict=True)
        # (entries of the band, equations): what each equation adds to the normal equations for a weight of 1
        self._normal = csr_matrix(
            (np.concatenate(products), (np.concatenate(entries), np.concatenate(pairs))),
            (self.band * count, len(self.wanted)),
        )

    def residuals(self, z: Array) -> list[Array]:
        """By how much (n,) unknowns z (N,) miss what each set of equations wants."""
        return np.split(self._factors @ z - self.wanted, self._ends)

    def solved(self, weights: Sequence[Array], diagonal: Array, right: Array) -> Array:
        """The z (count,) that minimises Σ w (equation's residual)² + Σ diagonal z² − 2 Σ right z.

        weights: (n,) of each set; diagonal, right: (count,).
        """
        weight = np.concatenate(weights)
        lower_band = (self._normal @ weight).reshape(self.band, self.count)
        lower_band[0] += diagonal
        side = self._transposed @ (weight * self.wanted) + right
        z: Array = scipy.linalg.solveh_banded(
            lower_band, side, overwrite_ab=True, overwrite_b=True, lower=True, check_finite=False
        )
        return z

    def _products(
        self, equations: Equations, numbers: NDArray[np.intp]
    ) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
        """Of every two unknowns of an equation, flattened: the product of their factors, the entry of the band that it
        is added to, and the equation's number of `numbers` (n,)."""
        nodes, factors = equations.nodes, equations.factors
        first, second = np.triu_indices(nodes.shape[1])
        a, b = nodes[:, first], nodes[:, second]
        product = factors[:, first] * factors[:, second]
        # an unknown that is named twice meets itself in both orders
        product = np.where((a == b) & (first != second), 2 * product, product)
        entry = np.abs(a - b) * self.count + np.minimum(a, b)
        return product.ravel(), entry.ravel(), np.repeat(numbers, len(first))
