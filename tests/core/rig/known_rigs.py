"""A rig that is known in full, without any estimation: cameras on a ring, what they see, and their matches."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import project, rotation_from_vector
from edf_stitch.core.cameras.rig import Observations, PictureMatches, Registration, Rig, RigEdge
from edf_stitch.core.rig.matching import Matched

SIZE = (400, 300)
K = np.array([[380.0, 0, 199.5], [0, 380.0, 149.5], [0, 0, 1]])


def known_rig(count: int = 4, seed: int = 0, extent: float = 0.1, points: int = 300) -> tuple[Rig, Matched]:
    """Cameras side by side, each turned by 12°, before points 2 to 20 baselines away; and all that they match."""
    rng = np.random.default_rng(seed)
    R = np.stack([rotation_from_vector(np.array([0.02 * rng.normal(), -0.21 * j, 0])) for j in range(count)])
    centres = extent * rng.normal(size=(count, 3))
    centres[0], R[0] = 0, np.eye(3)
    t = -np.einsum("nij,nj->ni", R, centres)
    t /= np.linalg.norm(t, axis=1).max() or 1.0
    angle = rng.uniform(-0.5, 0.21 * (count - 1) + 0.5, points)
    rays = np.column_stack([np.sin(angle), rng.uniform(-0.4, 0.4, points), np.cos(angle)])
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    inverse = 1 / rng.uniform(2, 20, points) if extent else np.zeros(points)

    seen, features, cameras = [], [], []
    for j in range(count):
        cameras.append(Camera(K, SIZE, "test", 0.0))
        q = (rays @ R[j].T + inverse[:, None] * t[j]) @ K.T
        with np.errstate(divide="ignore", invalid="ignore"):
            px = project(q)
        inside = np.flatnonzero((q[:, 2] > 0) & (px >= 0).all(axis=1) & (px <= np.array(SIZE) - 1).all(axis=1))
        seen.append(inside)
        features.append(px[inside])
    picture = np.concatenate([np.full(len(one), j) for j, one in enumerate(seen)])
    point = np.concatenate(seen)
    observations = Observations(picture, point, np.concatenate(features), np.ones(len(point), bool))
    matches, edges = [], []
    for i, j in combinations(range(count), 2):
        _, first, second = np.intersect1d(seen[i], seen[j], return_indices=True)
        if len(first) >= 20:
            matches.append(PictureMatches(i, j, np.column_stack([first, second])))
            edges.append(RigEdge(i, j, len(first), len(first), 0.5, 3.0, 0.01))
    rig = Rig(
        tuple(cameras), R, t, rays, inverse, np.full(points, 0.01), observations, tuple(edges), (),
        (0,) * count, np.full(count, 0.01), np.full(count, 0.02), (), 0.5, 0.05,
    )  # fmt: skip
    return rig, Matched(tuple(features), tuple(matches), 1.0)


def pixels_seen(rig: Rig) -> np.ndarray:
    """Where the pictures of all observations see their points (O, 2), px."""
    seen = rig.observations
    R, t = rig.R[seen.picture], rig.t[seen.picture]
    rays, inverse = rig.rays[seen.point], rig.inverse_ranges[seen.point]
    q = np.einsum("oij,oj->oi", R, rays) + inverse[:, None] * t
    cameras = np.stack([camera.K for camera in rig.cameras])[seen.picture]
    return project(np.einsum("oij,oj->oi", cameras, q))


def registration_of(rig: Rig, left_out: dict[int, str] | None = None) -> Registration:
    return Registration(rig, tuple(range(len(rig))), left_out or {})
