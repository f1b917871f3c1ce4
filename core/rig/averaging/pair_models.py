"""How far matches are from what a pose, or a pure rotation, of each pair says, and how that changes: for all pairs at
once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...cameras.projective import skew
from ...raster.arrays import Array
from .matched_rays import MatchedRays, Rays, SharedLens
from .turns import dot, rotations


@dataclass(frozen=True, eq=False)
class Poses:
    """R (P, 3, 3) and t (P, 3), |t| = 1, of every pair: a ray a of the first picture points to R a + ρ t."""

    R: Array
    t: Array

    def chosen(self, better: NDArray[np.bool_], other: Poses) -> Poses:
        """The other's where it is better (P,)."""
        return Poses(np.where(better[:, None, None], other.R, self.R), np.where(better[:, None], other.t, self.t))


class PairModel(Protocol):
    """What a fit needs of a model: `freedom` parameters a pair, and the shared log factor and k1 after them."""

    @property
    def rays(self) -> MatchedRays:
        """The matches."""

    @property
    def freedom(self) -> int:
        """Parameters of each pair."""

    def equations(self, poses: Poses, lens: SharedLens, shared: bool) -> tuple[Array, Array]:
        """Normal matrices and gradients of every pair, px²; with the shared parameters or without."""

    def stepped(self, poses: Poses, steps: Array) -> Poses:
        """The poses after steps (P, freedom)."""

    def costs(self, poses: Poses, lens: SharedLens) -> Array:
        """Cauchy costs (P,), px²."""


@dataclass(frozen=True, eq=False)
class EpipolarModel:
    """Sampson distances from the epipolar lines of poses; parameters: a turn from the left, a turn of t."""

    rays: MatchedRays
    cauchy: float
    freedom: int = 5

    def residuals(self, poses: Poses, lens: SharedLens) -> Array:
        """Signed distances (O,), px."""
        seen = self.rays.undistorted(lens)
        return _Sampson(seen, (skew(poses.t) @ poses.R)[self.rays.owner]).residual

    def squares(self, poses: Poses, lens: SharedLens) -> Array:
        """Squared distances (O,), px²."""
        squares: Array = self.residuals(poses, lens) ** 2
        return squares

    def costs(self, poses: Poses, lens: SharedLens) -> Array:
        """Cauchy costs (P,), px²."""
        return cauchy_costs(self.rays, self.squares(poses, lens), self.cauchy)

    def equations(self, poses: Poses, lens: SharedLens, shared: bool) -> tuple[Array, Array]:
        """Normal matrices and gradients of every pair, px²."""
        seen = self.rays.undistorted(lens)
        sampson = _Sampson(seen, (skew(poses.t) @ poses.R)[self.rays.owner])
        columns = sampson.by_matrix()
        if shared:
            columns = np.concatenate([columns, sampson.by_lens(self.rays, self.rays.derivatives(lens, seen))], axis=1)
        weight = 1 / (1 + (sampson.residual / self.cauchy) ** 2)
        H, g = normal_equations(columns, weight, sampson.residual, self.rays.starts)
        # from the nine entries of E to the five parameters of each pair
        axes = skew(np.eye(3))
        by_turn = skew(poses.t)[:, None] @ axes @ poses.R[:, None]
        by_tangent = skew(np.swapaxes(tangents(poses.t), 1, 2)) @ poses.R[:, None]
        chain = np.zeros((len(self.rays), columns.shape[1], self.freedom + 2 * shared))
        chain[:, :9, :5] = np.swapaxes(np.concatenate([by_turn, by_tangent], axis=1).reshape(-1, 5, 9), 1, 2)
        if shared:
            chain[:, 9:, 5:] = np.eye(2)
        back = np.swapaxes(chain, 1, 2)
        return back @ H @ chain, np.einsum("pij,pj->pi", back, g)

    def stepped(self, poses: Poses, steps: Array) -> Poses:
        """The poses after steps (P, 5)."""
        t = poses.t + np.einsum("pij,pj->pi", tangents(poses.t), steps[:, 3:5])
        return Poses(rotations(steps[:, :3]) @ poses.R, t / np.linalg.norm(t, axis=1, keepdims=True))


class _Sampson:
    """Sampson distances of rays from essential matrices (O, 3, 3), and their derivatives."""

    def __init__(self, rays: Rays, E: Array) -> None:
        self.a, self.b, self.E = rays.a, rays.b, E
        self.line = np.einsum("oij,oj->oi", E, rays.a)
        self.back_line = np.einsum("oij,oi->oj", E, rays.b)
        # gradients are per px of each picture
        self.slope = self.line[:, :2] / rays.focal[1][:, None] ** 2
        self.back_slope = self.back_line[:, :2] / rays.focal[0][:, None] ** 2
        self.shares = (
            dot(self.back_slope, self.back_line[:, :2]), dot(self.slope, self.line[:, :2])
        )  # fmt: skip
        self.length = np.sqrt(self.shares[0] + self.shares[1] + 1e-30)
        self.residual: Array = dot(rays.b, self.line) / self.length
        self.ratio = self.residual / self.length**2

    def by_matrix(self) -> Array:
        """Derivatives (O, 9) by the entries of E."""
        first = self.b / self.length[:, None]
        first[:, :2] -= self.ratio[:, None] * self.slope
        self.first = first
        out = first[:, :, None] * self.a[:, None, :]
        out[:, :, :2] -= (self.ratio[:, None] * self.b)[:, :, None] * self.back_slope[:, None, :]
        entries: Array = out.reshape(-1, 9)
        return entries

    def by_lens(self, matched: MatchedRays, radial: Array) -> Array:
        """Derivatives (O, 2) by log factor and k1; radial: `MatchedRays.derivatives`. After `by_matrix`."""
        by_a = np.einsum("oij,oi->oj", self.E[:, :, :2], self.first)
        by_b = self.line[:, :2] / self.length[:, None]
        by_b = by_b - self.ratio[:, None] * np.einsum("oij,oj->oi", self.E[:, :2, :2], self.back_slope)
        out: Array = dot(by_a, self.a[:, :2])[:, None] * radial[0]
        out += dot(by_b, self.b[:, :2])[:, None] * radial[1]
        # px are px of a longer focal length
        out[:, 0] += self.ratio * (matched.zooms[0] * self.shares[0] + matched.zooms[1] * self.shares[1])
        return out


@dataclass(frozen=True, eq=False)
class RotationModel:
    """Distances of rays from where pure rotations take them, per coordinate and picture; parameters: a turn from the
    left."""

    rays: MatchedRays
    cauchy: float
    freedom: int = 3

    def vectors(self, poses: Poses, lens: SharedLens) -> tuple[Array, Array, Array]:
        """Residuals (O, 3) in px, the turned rays (O, 3), and px a radian over √2 (O,): both pictures err."""
        seen = self.rays.undistorted(lens)
        a, b = seen.unit()
        turned = np.einsum("oij,oj->oi", poses.R[self.rays.owner], a)
        scale = seen.focal[1] / np.sqrt(2)
        return (turned - b) * scale[:, None], turned, scale

    def squares(self, poses: Poses, lens: SharedLens) -> Array:
        """Squared distances (O,), px²: of two coordinates."""
        residual = self.vectors(poses, lens)[0]
        return dot(residual, residual)

    def costs(self, poses: Poses, lens: SharedLens) -> Array:
        """Cauchy costs (P,), px²."""
        return cauchy_costs(self.rays, self.squares(poses, lens), self.cauchy)

    def equations(self, poses: Poses, lens: SharedLens, shared: bool) -> tuple[Array, Array]:
        """Normal matrices and gradients of every pair, px²."""
        residual, turned, scale = self.vectors(poses, lens)
        columns = -skew(turned) * scale[:, None, None]
        if shared:
            step = 1e-6
            others = (SharedLens(lens.factor * np.exp(step), lens.k1), SharedLens(lens.factor, lens.k1 + step))
            by_lens = [(self.vectors(poses, other)[0] - residual) / step for other in others]
            columns = np.concatenate([columns, np.stack(by_lens, axis=2)], axis=2)
        weight = 1 / (1 + dot(residual, residual) / self.cauchy**2)
        flat = columns.reshape(-1, columns.shape[2])
        return normal_equations(flat, np.repeat(weight, 3), residual.ravel(), 3 * self.rays.starts)

    def stepped(self, poses: Poses, steps: Array) -> Poses:
        """The poses after steps (P, 3)."""
        return Poses(rotations(steps) @ poses.R, poses.t)


def cauchy_costs(rays: MatchedRays, squares: Array, width: float) -> Array:
    """Cauchy costs (P,) of squared residuals (O,), px²."""
    return rays.sums(0.5 * width**2 * np.log1p(squares / width**2))


def normal_equations(columns: Array, weight: Array, residual: Array, starts: NDArray[np.intp]) -> tuple[Array, Array]:
    """Jᵀ W J (P, n, n) and Jᵀ W r (P, n) of each pair's rows of J (O, n)."""
    weighted = columns * weight[:, None]
    count, n = len(starts) - 1, columns.shape[1]
    H, g = np.empty((count, n, n)), np.empty((count, n))
    for k in range(count):
        rows = slice(starts[k], starts[k + 1])
        H[k] = weighted[rows].T @ columns[rows]
        g[k] = residual[rows] @ weighted[rows]
    return H, g


def tangents(t: Array) -> Array:
    """Two unit vectors (P, 3, 2) at right angles to unit vectors t (P, 3) and to each other."""
    helper = np.eye(3)[np.abs(t).argmin(axis=1)]
    first = np.cross(t, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(t, first)], axis=2)
