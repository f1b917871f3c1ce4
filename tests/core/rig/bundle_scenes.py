"""Small scenes whose bundle is known: what some cameras see of points, and the solution that is true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from edf_stitch.core.cameras.bodies import Bodies
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.rig.averaging.turns import rotations
from edf_stitch.core.rig.bundling.polishing import start
from edf_stitch.core.rig.bundling.reprojection import reproject
from edf_stitch.core.rig.bundling.solution import Problem, Solution, lenses_of
from edf_stitch.core.rig.bundling.tracks import Tracks
from numpy.typing import NDArray


def believed_cameras(count: int, log_sigma: float = 0.05, focal: float = 500.0) -> list[Camera]:
    K = np.array([[focal, 0, 399.5], [0, 1.02 * focal, 299.5], [0, 0, 1]])
    return [Camera(K, (800, 600), "test", log_sigma, principal_sigma=0.01, knowledge=Knowledge.EXIF)] * count


def bundled_scene(
    seed: int, pictures: int = 4, points: int = 60, noise_px: float = 0.0, k1: float = -0.05,
    cameras: list[Camera] | None = None, held: NDArray[np.bool_] | None = None,
) -> tuple[Problem, Solution]:  # fmt: skip
    """Cameras that look the same way from places side by side, and the solution that is true."""
    rng = np.random.default_rng(seed)
    lenses = lenses_of(cameras or believed_cameras(pictures))
    picture, point = np.tile(np.arange(pictures), points), np.repeat(np.arange(points), pictures)
    tracks = Tracks(
        picture, point, point, np.zeros((len(point), 2)), np.arange(points) * pictures, np.zeros(points, np.intp)
    )
    held = np.zeros(pictures, bool) if held is None else held
    problem = Problem(tracks, lenses, 1.0, 0.5, np.arange(pictures), held, Bodies.alone(pictures))
    lens = np.tile([0.02, k1, 3.0, -2.0], (len(lenses), 1))
    true = start(problem, rotations(rng.normal(0, 0.05, (pictures, 3))), np.where(lenses.free, lens, 0))
    rays = np.column_stack([rng.uniform(-0.5, 0.5, (points, 2)), np.ones(points)])
    centres = rng.normal(0, 0.4, (pictures, 3)) * [1, 1, 0.2]
    solution = replace(
        true, centres=centres - centres[0], rays=rays / np.linalg.norm(rays, axis=1, keepdims=True),
        inverse_ranges=rng.uniform(0.0, 0.4, points), solved=np.ones(points, bool),
    ).seen_from(0).rescaled()  # fmt: skip
    everything = np.arange(len(point))
    found = reproject(problem, solution, everything)
    assert not found.behind.any()
    pixels = found.errors + rng.normal(0, noise_px, (len(point), 2))
    return replace(problem, tracks=replace(tracks, pixels=pixels)), solution


def disturbed(solution: Solution, seed: int, by: float = 0.01) -> Solution:
    rng = np.random.default_rng(seed + 1)
    turned = rotations(rng.normal(0, by, (len(solution.R), 3)))
    turned[0] = np.eye(3)
    rays = solution.rays + rng.normal(0, by, solution.rays.shape)
    centres = solution.centres + rng.normal(0, by, solution.centres.shape) * (np.arange(len(turned)) > 0)[:, None]
    return replace(
        solution, R=turned @ solution.R, centres=centres, rays=rays / np.linalg.norm(rays, axis=1, keepdims=True),
        inverse_ranges=solution.inverse_ranges + rng.normal(0, by, len(rays)),
    )  # fmt: skip
