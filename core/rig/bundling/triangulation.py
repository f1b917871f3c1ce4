"""Points from the directions in which several cameras see them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...raster.arrays import Array
from .bundle_options import BUNDLE
from .solution import Problem, Solution, bearings, lens_of
from .tracks import Index


def triangulate(problem: Problem, solution: Solution) -> Solution:
    """All points anew, from their used observations: rays, ρ and which of them could be.

    A point behind, or no better off at a finite range, starts at infinity: noise puts far points behind the cameras,
    and from there no step leads back through infinity for all at once. So does one far nearer than pictures are apart:
    it is seen from places that are one but for rounding.
    """
    tracks = problem.tracks
    chosen = np.flatnonzero(solution.used)
    counts = np.bincount(tracks.point[chosen], minlength=len(tracks))
    chosen = chosen[counts[tracks.point[chosen]] >= 2]
    points, point, sizes = np.unique(tracks.point[chosen], return_inverse=True, return_counts=True)
    rays, inverse_ranges = solution.rays.copy(), np.zeros(len(tracks))
    solved = np.zeros(len(tracks), bool)
    solved[points] = True
    if len(points):
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        seen = bearings(problem, solution)[chosen]
        picture = tracks.picture[chosen]
        world = np.einsum("oji,oj->oi", solution.R[picture], seen)
        found, depth = _best(solution, picture, point, starts, seen, world)
        one = _of_one_place(problem.place[picture], starts)
        if one.any():
            kernel = BUNDLE.kernel_px * problem.scale / lens_of(problem, solution, picture).focal
            usual = _robust_ray(world, point, starts, kernel)[one]
            found[one], depth[one] = _at_usual_range(solution.centres[picture[starts[one]]], usual, depth[~one])
        rays[points], inverse_ranges[points] = found, depth
    return replace(solution, rays=rays, inverse_ranges=inverse_ranges, solved=solved)


def _best(
    solution: Solution, picture: Index, point: Index, starts: Index, seen: Array, world: Array
) -> tuple[Array, Array]:
    """Rays (P, 3) and ρ (P,), by linear least squares or at infinity; world (O, 3): what is seen, in the world."""
    rays, depth = _linear(solution, picture, starts, world)
    far = _mean_ray(world, starts)
    worst, worst_far = (
        np.maximum.reduceat(_off(solution, picture, r[point], d[point], seen), starts)
        for r, d in ((rays, depth), (far, np.zeros(len(far))))
    )
    at_infinity = (depth < 0) | (depth > BUNDLE.most_inverse_range) | (worst_far <= worst)
    return np.where(at_infinity[:, None], far, rays), np.where(at_infinity, 0.0, depth)


def _linear(solution: Solution, picture: Index, starts: Index, world: Array) -> tuple[Array, Array]:
    """The (r, ρ) of least Σ |b × R (r − ρ c)|², turned so that most cameras have it before them."""
    across = np.eye(3) - world[:, :, None] * world[:, None, :]  # [w]ₓᵀ [w]ₓ
    pulled = -np.einsum("oij,oj->oi", across, solution.centres[picture])
    equations = np.empty((len(picture), 4, 4))
    equations[:, :3, :3] = across
    equations[:, :3, 3] = equations[:, 3, :3] = pulled
    equations[:, 3, 3] = -np.einsum("oi,oi->o", solution.centres[picture], pulled)
    _, vectors = np.linalg.eigh(np.add.reduceat(equations, starts, axis=0))
    least = vectors[:, :, 0]
    mean = np.add.reduceat(world, starts, axis=0)
    least *= np.where((least[:, :3] * mean).sum(axis=1) < 0, -1, 1)[:, None]
    least /= np.maximum(np.linalg.norm(least[:, :3], axis=1, keepdims=True), 1e-12)  # (0, 1) is the origin itself
    return least[:, :3], least[:, 3]


def _mean_ray(world: Array, starts: Index) -> Array:
    """Where a point at infinity is seen, by all rays world (O, 3) together."""
    mean = np.add.reduceat(world, starts, axis=0)
    unit: Array = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    return unit


def _robust_ray(world: Array, point: Index, starts: Index, kernel: Array) -> Array:
    """The same by most of them, with Cauchy weights; kernel (O,), radians. From one place, outliers are all that rays
    differ by."""
    mean = _mean_ray(world, starts)
    for _ in range(BUNDLE.mean_rounds):
        off = np.linalg.norm(world - mean[point], axis=1)
        mean = _mean_ray(world / (1 + (off / kernel) ** 2)[:, None], starts)
    return mean


def _off(solution: Solution, picture: Index, rays: Array, depth: Array, seen: Array) -> Array:
    """1 − cosine (O,) of the angles between where points are and where they are seen."""
    q = np.matmul(solution.R[picture], (rays - depth[:, None] * solution.centres[picture])[:, :, None])[:, :, 0]
    off: Array = 1 - (q * seen).sum(axis=1) / np.maximum(np.linalg.norm(q, axis=1), 1e-12)
    return off


def _of_one_place(place: Index, starts: Index) -> Array:
    """Which points are seen from one place only."""
    one: Array = np.minimum.reduceat(place, starts) == np.maximum.reduceat(place, starts)
    return one


def _at_usual_range(centres: Array, rays: Array, depths: Array) -> tuple[Array, Array]:
    """Points (P, 3), (P,) on rays from places (P, 3) at the range that others have."""
    usual = 1 / max(float(np.median(np.abs(depths))) if len(depths) else 1.0, 1e-9)
    X = centres + usual * rays
    lengths = np.linalg.norm(X, axis=1)
    return X / lengths[:, None], 1 / lengths
