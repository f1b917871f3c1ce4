"""Many rotations at once."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ...raster.arrays import Array


def rotations(vectors: Array) -> Array:
    """Rotations (…, 3, 3) about vectors (…, 3), by their lengths in radians."""
    turned: Array = Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3)
    return turned


def rotation_vectors(R: Array) -> Array:
    """The inverse of `rotations`, lengths from 0 to π."""
    vectors: Array = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec().reshape(R.shape[:-1])
    return vectors


def dot(first: Array, second: Array) -> Array:
    """Inner products (O,) of rows (O, n); several times faster than a sum over so short an axis."""
    return np.asarray(np.einsum("oi,oi->o", first, second))


def degrees_between(first: Array, second: Array) -> Array:
    """Angles (…) between rotations (…, 3, 3)."""
    between: Array = np.degrees(np.linalg.norm(rotation_vectors(first @ np.swapaxes(second, -1, -2)), axis=-1))
    return between
