"""Smoothing thin-plate splines in the plane, and their leave-one-out cross-validation.

Duchon 1977; Wahba, Spline Models for Observational Data (1990), chapters 2.4 and 4.2. Affine functions have no bending
energy: where there are few points, or none near, the spline is a plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ..raster.arrays import Array
from ..system.threads import ask, beside
from .options import SPLINE


@dataclass(frozen=True)
class ThinPlateSpline:
    """f(p) = Σ w_i ½ r_i² ln r_i² + a·(p, 1) over centres in normalised coordinates (p − centre) / scale.

    centres (N, 2), normalised; centre (2,) and scale: px; weights w (N,) and affine a (3,), or (N, k) and (3, k) for k
    functions with the same centres.
    """

    centres: Array
    weights: Array
    affine: Array
    centre: Array
    scale: float

    def at(self, points: Array) -> Array:
        """Values (N,) or (N, k) at points (N, 2) px, in float64 throughout."""
        p = (np.asarray(points, np.float64) - self.centre) / self.scale
        out: Array = p @ self.affine[:-1] + self.affine[-1]
        rows = max(1, SPLINE.kernel_values_at_once // max(1, len(self.centres)))
        for start in range(0, len(p), rows):
            out[start : start + rows] += kernel(p[start : start + rows], self.centres) @ self.weights
        return out

    def on_axes(self, xs: Array, ys: Array) -> Array:
        """Values (H, W[, k]) where columns xs (W,) and rows ys (H,) in px cross; the kernel in float32.

        Squared distances are sums dx² + dy² and not |p|² + |c|² − 2p·c, which would cancel close to a centre.
        """
        x = (np.asarray(xs, np.float64) - self.centre[0]) / self.scale
        y = (np.asarray(ys, np.float64) - self.centre[1]) / self.scale
        dx2 = ((x[:, None] - self.centres[:, 0]) ** 2).astype(np.float32)
        dy2 = ((y[:, None] - self.centres[:, 1]) ** 2).astype(np.float32)
        weights = (0.5 * self.weights).astype(np.float32)
        across, down = np.multiply.outer(x, self.affine[0]), np.multiply.outer(y, self.affine[1]) + self.affine[2]
        out: Array = across[None] + down[:, None]
        if not len(self.centres):
            return out
        rows = max(1, SPLINE.line_values_at_once // max(1, dx2.size))
        for start in range(0, len(y), rows):
            r2 = dy2[start : start + rows, None, :] + dx2[None, :, :]
            np.maximum(r2, np.float32(1e-20), out=r2)
            log = cv2.log(r2.reshape(-1, r2.shape[2])).reshape(r2.shape)
            np.multiply(r2, log, out=r2)
            out[start : start + rows] += r2 @ weights
        return out


def kernel(points: Array, centres: Array) -> Array:
    """½ r² ln r² between points (N, n) and centres (M, n), zero at r = 0."""
    r2 = np.subtract.outer(points[:, 0], centres[:, 0]) ** 2
    for p, c in zip(points.T[1:], centres.T[1:], strict=True):
        r2 += np.subtract.outer(p, c) ** 2
    result: Array = 0.5 * r2 * np.log(np.maximum(r2, 1e-300))
    return result


@dataclass(frozen=True)
class SmoothingProblem:
    """The linear system of a smoothing spline: (Φ + 8πλ D) w + M a = g with Mᵀ w = 0.

    centres (N, n): points (p − centre) / scale, n = 2 in the plane and 3 on a sphere; noise (N,): √D, relative; phi
    (N, N): Φ, the kernel between points; M (N, n + 1): the points, homogeneous. λ is in units of scale² px².
    """

    centres: Array
    noise: Array
    centre: Array
    scale: float
    phi: Array

    @staticmethod
    def build(points: Array, noise: Array, scale: float, centre: Array | None = None) -> SmoothingProblem:
        """The problem of points (N, n) px with relative noise (N,); centre (n,) px: their centroid if not given."""
        centre = points.mean(axis=0) if centre is None else centre
        centres = (points - centre) / scale
        return SmoothingProblem(centres, noise, centre, scale, kernel(centres, centres))

    def subset(self, keep: NDArray[np.bool_]) -> SmoothingProblem:
        """The problem of the points that the mask `keep` (N,) selects."""
        phi = self.phi[np.ix_(keep, keep)]
        return SmoothingProblem(self.centres[keep], self.noise[keep], self.centre, self.scale, phi)

    def system(self, smoothing: float) -> Array:
        """The bordered matrix [[Φ + 8πλ D, M], [Mᵀ, 0]] (N + n + 1, N + n + 1)."""
        n, functions = len(self.noise), self.centres.shape[1] + 1
        system = np.zeros((n + functions, n + functions))
        system[:n, :n] = self.phi
        system[np.arange(n), np.arange(n)] += 8 * np.pi * smoothing * self.noise**2
        system[:n, n:] = np.column_stack([self.centres, np.ones(n)])
        system[n:, :n] = system[:n, n:].T
        return system

    def solve(self, values: Array, smoothing: float) -> tuple[ThinPlateSpline, Array]:
        """The spline of values g (N,) or (N, k) at λ = smoothing, and its residuals g − f = 8πλ D w, shaped as g."""
        ask()
        n, functions = len(values), self.centres.shape[1] + 1
        solution = scipy.linalg.solve(
            self.system(smoothing), np.concatenate([values, np.zeros((functions, *values.shape[1:]))])
        )
        spline = ThinPlateSpline(self.centres, solution[:n], solution[n:], self.centre, self.scale)
        return spline, ((8 * np.pi * smoothing * self.noise**2) * solution[:n].T).T

    def inverse(self, smoothing: float) -> Inverse:
        """The matrix that turns values into weights, at λ = smoothing."""
        ask()
        projected, affine = self._projected()
        ask()
        n = len(self.noise)
        # the affine directions get an eigenvalue of the matrix's own size, which keeps it well conditioned
        size = float(np.trace(projected)) / n
        projected += size * (affine @ affine.T)
        projected[np.arange(n), np.arange(n)] += 8 * np.pi * smoothing
        # symmetric, so its transpose is the column-major matrix that LAPACK expects: no copy
        factor, failed = scipy.linalg.lapack.dpotrf(projected.T, lower=1, clean=0, overwrite_a=1)
        ask()
        if failed:
            raise np.linalg.LinAlgError(f"the matrix of a spline is not positive definite at λ = {smoothing:g}")
        matrix = cv2.completeSymm(scipy.linalg.lapack.dpotri(factor, lower=1, overwrite_c=1)[0].T)
        matrix -= (affine @ affine.T) / (size + 8 * np.pi * smoothing)
        matrix /= np.outer(self.noise, self.noise)
        return Inverse(matrix, 8 * np.pi * smoothing * self.noise**2)

    def held_out(self, values: Array, ladder: Array) -> Array:
        """Leave-one-out residuals for each λ of a ladder.

        One eigen-decomposition serves every λ: with v = √D w the residual at a point that is left out is √D_i v_i /
        G_ii, where G = Q (…)⁻¹ Qᵀ (see `_projected`; Wahba eq. 4.2.8 in these coordinates).

        Parameters
        ----------
        values : (N,) or (N, k) array
        ladder : (n,) array
            The λ to try.

        Returns
        -------
        (n, N) or (n, N, k) array
        """
        matrix, affine = self._projected()
        # the affine directions get the lowest eigenvalues, and are dropped
        matrix -= (1 + np.abs(matrix).sum(axis=1).max()) * (affine @ affine.T)
        # NumPy's leaves the interpreter lock to who waits, SciPy's does not
        eigenvalues, basis = beside(lambda: np.linalg.eigh(matrix))
        eigenvalues, basis = eigenvalues[affine.shape[1] :], basis[:, affine.shape[1] :]
        squared = basis**2
        projected = basis.T @ (values.T / self.noise).T
        out = np.empty((len(ladder), *values.shape))
        for i, smoothing in enumerate(ladder):
            ask()
            gain = 1.0 / (np.maximum(eigenvalues, 0.0) + 8 * np.pi * smoothing)
            scale = self.noise / np.maximum(squared @ gain, 1e-300)
            out[i] = ((basis @ (gain * projected.T).T).T * scale).T
        return out

    def _projected(self) -> tuple[Array, Array]:
        """D^-½ Φ D^-½ projected onto the orthogonal complement Q of D^-½ M, as (N, N), and a basis of D^-½ M.

        On Q the system is (Qᵀ D^-½ Φ D^-½ Q + 8πλ I) z = … with v = √D w, positive definite. Q itself is never formed:
        projections are updates of low rank.
        """
        root = self.noise
        polynomial = np.column_stack([self.centres, np.ones(len(root))]) / root[:, None]
        affine = np.linalg.qr(polynomial)[0]
        matrix = self.phi / np.outer(root, root)
        for _ in range(2):  # from the left, then from the right
            matrix -= affine @ (affine.T @ matrix)
            matrix = matrix.T
        return matrix, affine


@dataclass(frozen=True)
class Inverse:
    """The first N rows and columns P of the inverse of a problem's system at one λ: w = P g.

    matrix (N, N): P; penalty (N,): 8πλ D.
    """

    matrix: Array
    penalty: Array

    def residual(self, values: Array) -> Array:
        """Residuals g − f (N,) of the spline of values g (N,)."""
        return self.penalty * (self.matrix @ values)

    def held_out(self, values: Array) -> Array:
        """Leave-one-out residuals (N,) of values g (N,): w_i / P_ii (Dubrule 1983, for kriging: the same equations)."""
        return (self.matrix @ values) / np.diag(self.matrix)

    def subset(self, keep: NDArray[np.bool_]) -> Inverse:
        """The inverse for the points that the mask `keep` (N,) selects, by a Schur complement."""
        ask()
        dropped = ~keep
        rows = self.matrix[keep]
        mixed = rows[:, dropped]
        matrix = rows[:, keep]
        matrix -= mixed @ np.linalg.solve(self.matrix[np.ix_(dropped, dropped)], mixed.T)
        return Inverse(matrix, self.penalty[keep])


def spread_points(points: Array, cost: Array, budget: int, spacing: float) -> NDArray[np.intp]:
    """Indices of at most `budget` of the points (N, n): of each cell of `spacing`, in their unit, the one of the least
    `cost` (N,)."""
    if not len(points):
        return np.zeros(0, dtype=np.intp)
    cells = np.floor(points / spacing).astype(np.int64)
    order = np.lexsort((cost, *cells.T))
    first = np.r_[True, np.any(np.diff(cells[order], axis=0) != 0, axis=1)]
    chosen = order[first]
    if len(chosen) > budget:  # larger cells, by the square root of the excess, until they are few enough
        return spread_points(points, cost, budget, spacing * max(1.05, float(np.sqrt(len(chosen) / budget))))
    return np.sort(chosen)
