"""Where points are seen, how far that is from where they were found, and its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from .bundle_options import BUNDLE
from .solution import LensOfPictures, Problem, Solution, bending_of, fold_of, lens_of, stretch_of
from .tracks import Index

# Parameters of a camera: rotation vector, place, log f, k1, principal point.
CAMERA = 10


@dataclass(frozen=True, eq=False)
class Reprojection:
    """Of observations `chosen`: errors (O, 2) px of the picture, seen minus found; q (O, 3) = R (r − ρ c); ideal (O, 2)
    normalised; behind (O,): not before its camera, there the error is of a fixed size."""

    chosen: Index
    errors: Array
    q: Array
    ideal: Array
    behind: NDArray[np.bool_]


def reproject(problem: Problem, solution: Solution, chosen: Index) -> Reprojection:
    tracks = problem.tracks
    picture, point = tracks.picture[chosen], tracks.point[chosen]
    lens = lens_of(problem, solution, picture)
    away = solution.rays[point] - solution.inverse_ranges[point][:, None] * solution.centres[picture]
    q = np.matmul(solution.R[picture], away[:, :, None])[:, :, 0]
    behind = q[:, 2] <= BUNDLE.least_ahead
    ideal = q[:, :2] / np.where(behind, 1.0, q[:, 2])[:, None]
    errors = (lens.focal * stretch_of(ideal, lens.k1))[:, None] * ideal
    errors[:, 1] *= lens.aspect
    errors += lens.principal - tracks.pixels[chosen]
    errors[behind] = BUNDLE.behind_px
    return Reprojection(chosen, errors, q, ideal, behind)


def lengths_of_errors(problem: Problem, solution: Solution) -> Array:
    """Of all observations (O,), px; NaN where the point is not solved."""
    tracks = problem.tracks
    chosen = np.flatnonzero(solution.solved[tracks.point])
    lengths = np.full(len(tracks.point), np.nan)
    lengths[chosen] = np.linalg.norm(reproject(problem, solution, chosen).errors, axis=1)
    return lengths


def tangents(rays: Array) -> Array:
    """Two unit vectors (P, 3, 2) at right angles to each ray (P, 3) and to each other."""
    aside = np.where(np.abs(rays[:, :1]) < 0.6, np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]]))
    first = np.cross(rays, aside)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(rays, first)], axis=-1)


def derivatives(problem: Problem, solution: Solution, seen: Reprojection, bases: Array) -> tuple[Array, Array]:
    """Of the errors by the camera (O, 2, CAMERA) and by the point (O, 2, 3).

    Rotations turn from the left, exp(ω) R; a ray moves in `bases` (P, 3, 2) of its tangent plane; the point's third
    parameter is ρ.
    """
    tracks = problem.tracks
    picture, point = tracks.picture[seen.chosen], tracks.point[seen.chosen]
    lens = lens_of(problem, solution, picture)
    by_q = _by_direction(lens, seen)
    by_world = np.matmul(by_q, solution.R[picture])
    camera = np.empty((len(picture), 2, CAMERA))
    camera[:, :, :3] = np.cross(seen.q[:, None, :], by_q)
    camera[:, :, 3:6] = -solution.inverse_ranges[point][:, None, None] * by_world
    along = lens.focal[:, None] * seen.ideal
    along[:, 1] *= lens.aspect
    camera[:, :, 6] = stretch_of(seen.ideal, lens.k1)[:, None] * along
    camera[:, :, 7] = bending_of(seen.ideal, lens.k1)[:, None] * along
    camera[:, :, 8:] = np.eye(2)
    by_point = np.empty((len(picture), 2, 3))
    by_point[:, :, :2] = np.matmul(by_world, bases[point])
    by_point[:, :, 2] = -np.matmul(by_world, solution.centres[picture][:, :, None])[:, :, 0]
    return camera, by_point


def _by_direction(lens: LensOfPictures, seen: Reprojection) -> Array:
    """Of the errors by q (O, 2, 3)."""
    x, y = seen.ideal.T
    depth = np.where(seen.behind, 1.0, seen.q[:, 2])
    stretch = stretch_of(seen.ideal, lens.k1)
    bend = 2 * np.where((lens.k1 < 0) & (x * x + y * y > fold_of(lens.k1)), 0.0, lens.k1)
    by_q = np.empty((len(x), 2, 3))
    by_q[:, 0, 0] = stretch + bend * x * x
    by_q[:, 0, 1] = bend * x * y
    by_q[:, 1, 0] = lens.aspect * bend * x * y
    by_q[:, 1, 1] = lens.aspect * (stretch + bend * y * y)
    by_q[:, :, :2] *= (lens.focal / depth)[:, None, None]
    by_q[:, :, 2] = -(by_q[:, :, 0] * x[:, None] + by_q[:, :, 1] * y[:, None])
    return by_q
