"""An equirectangular panorama as a World: the direction that a camera sees is the one that the panorama holds there."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.cameras.blender_camera import matrix_world_of
from edf_stitch.core.cameras.blender_world import world_rotation
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.panorama.projection import round_projection
from hypothesis import given
from hypothesis import strategies as st

turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: rotation_from_vector(np.array(v)))
K = np.array([[300.0, 0, 159.5], [0, 300.0, 119.5], [0, 0, 1]])


@given(turns, turns)
def test_blender_finds_each_direction_where_the_panorama_shows_it(R: np.ndarray, rotation: np.ndarray) -> None:
    """u = ½ − atan2(y, x) / 2π, v = ½ + atan2(z, hypot(x, y)) / π from below: Cycles' lookup; a slow test tries it."""
    projection = round_projection("equirectangular", K, rotation)
    ways = np.random.default_rng(0).normal(size=(100, 3))  # in the world
    x, y, z = (ways @ world_rotation(matrix_world_of(R, np.array([1.0, 2, 3])), rotation).T).T
    assert projection.sphere is not None
    left, top, width, height = projection.sphere
    u, v = 0.5 - np.arctan2(y, x) / (2 * np.pi), 0.5 + np.arctan2(z, np.hypot(x, y)) / np.pi
    found = np.column_stack([u * width - 0.5 + left, (1 - v) * height - 0.5 + top])
    apart = found - projection.points(ways @ R.T)
    apart[:, 0] -= width * np.round(apart[:, 0] / width)
    assert np.abs(apart).max() < 1e-8 * width


def test_an_upright_camera_along_y_needs_a_quarter_turn() -> None:
    """The camera of Create Cameras: at the origin, along +y with z up."""
    upright = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    turn = world_rotation(matrix_world_of(upright, np.zeros(3)), np.eye(3))
    assert np.allclose(turn @ (0, 1, 0), (1, 0, 0)) and np.allclose(turn @ (0, 0, 1), (0, 0, 1))
