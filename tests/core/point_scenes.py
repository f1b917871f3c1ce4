"""What the tests of two-view geometry build their point scenes from."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.cameras.projective import rotation_from_vector

SIZE = (1200, 900)
FOCAL = 1000.0


def unit(*v: float) -> np.ndarray:
    return np.array(v) / np.linalg.norm(v)


def turned_by(*degrees: float) -> np.ndarray:
    return rotation_from_vector(np.radians(degrees))


def spoiled(
    x: np.ndarray, y: np.ndarray, noise: float, outliers: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and y (N, 2) with noise (px, of each coordinate), target points anywhere for a share of them, and which."""
    x, y = x + random.normal(0, noise, x.shape), y + random.normal(0, noise, y.shape)
    wrong = np.zeros(len(x), bool)
    wrong[random.permutation(len(x))[: round(outliers * len(x))]] = True
    y[wrong] = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (int(wrong.sum()), 2))
    return x, y, wrong
