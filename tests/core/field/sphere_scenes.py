"""Rigs of a known scene: inverse range on every ray from the viewpoint, and where cameras see it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.cameras.rig import Observations, Rig
from edf_stitch.core.field.sphere_points import seen_at

SIZE = (320, 240)


def unit_rays(seed: int, count: int, reach: float | None = None) -> np.ndarray:
    """Random unit rays (N, 3): all over the sphere, or within an angle of ahead, in radians."""
    random = np.random.default_rng(seed)
    z = random.uniform(-1 if reach is None else np.cos(reach), 1, count)
    turn = random.uniform(0, 2 * np.pi, count)
    level = np.sqrt(1 - z**2)
    return np.column_stack([level * np.cos(turn), level * np.sin(turn), z])


def room(rays: np.ndarray) -> np.ndarray:
    """Inverse range (…) of walls around the viewpoint that bulge smoothly."""
    x, y, z = np.moveaxis(rays, -1, 0)
    return 0.25 + 0.06 * np.sin(3 * x + 1) * np.cos(2 * y) + 0.05 * z


def camera_of(lens: Sequence[float] = (), focal: float = 280.0) -> Camera:
    K = np.array([[focal, 0, 161.0], [0, focal, 118.0], [0, 0, 1]])
    return Camera(K, SIZE, "by hand", 0.0, np.pad(np.array(lens, float), (0, 5 - len(lens))))


def rig_of(
    yaws: Sequence[float], seed: int = 0, depth: Callable[[np.ndarray], np.ndarray] = room, noise_px: float = 0.0,
    lens: Sequence[float] = (), points: int = 2500, moves: float = 1.0,
) -> Rig:  # fmt: skip
    """Cameras that look in these directions (degrees to the right of the first) from places about the first's, and all
    points that at least two of them see; moves: how far apart the places are, 0 for a tripod."""
    random = np.random.default_rng(seed)
    count = len(yaws)
    R = np.stack([
        rotation_from_vector(np.radians([random.uniform(-4, 4), -yaw, random.uniform(-2, 2)])) for yaw in yaws
    ])  # fmt: skip
    R = R @ R[0].T
    t = moves * random.normal(size=(count, 3)) * (1.0, 0.3, 1.0)
    t[0] = 0
    t /= max(np.linalg.norm(t, axis=1).max(), 1e-300)
    rays = unit_rays(seed + 1, points)
    inverse_ranges = depth(rays)
    cameras = tuple(camera_of(lens) for _ in yaws)
    bare = Rig(cameras, R, t, rays, inverse_ranges, np.zeros(points), _none())
    pixels = np.stack([seen_at(view, rays, inverse_ranges) for view in bare.views])
    with np.errstate(invalid="ignore"):
        seen = ((pixels >= 0) & (pixels <= np.array(SIZE) - 1)).all(axis=-1)
    seen &= seen.sum(axis=0) >= 2
    kept = np.cumsum(seen.any(axis=0)) - 1
    picture, point = np.nonzero(seen)
    measured = pixels[picture, point] + noise_px * random.normal(size=(len(point), 2))
    observations = Observations(picture, kept[point], measured, np.full(len(point), True))
    some = seen.any(axis=0)
    return Rig(cameras, R, t, rays[some], inverse_ranges[some], np.zeros(int(some.sum())), observations)


def _none() -> Observations:
    nothing = np.zeros(0, np.intp)
    return Observations(nothing, nothing, np.zeros((0, 2)), np.zeros(0, bool))
