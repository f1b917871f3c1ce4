"""Many rotations at once, against SciPy's."""

import numpy as np
from edf_stitch.core.rig.averaging.turns import degrees_between, rotation_vectors, rotations
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

vectors = st.lists(st.tuples(*[st.floats(-3.2, 3.2)] * 3), min_size=1, max_size=5).map(np.array)


@given(vectors)
def test_rotations_are_scipys(v):
    np.testing.assert_allclose(rotations(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


@given(vectors)
def test_vectors_lead_back_to_their_rotation(v):
    R = rotations(v)
    found = rotation_vectors(R)
    assert (np.linalg.norm(found, axis=-1) <= np.pi + 1e-12).all()
    np.testing.assert_allclose(rotations(found), R, atol=1e-12)


@given(st.floats(-14, -1), st.integers(0, 2))
def test_small_angles_keep_their_digits(exponent, axis):
    v = np.zeros((1, 3))
    v[0, axis] = 10.0**exponent
    np.testing.assert_allclose(rotation_vectors(rotations(v)), v, rtol=1e-6, atol=1e-16)


@given(vectors)
def test_degrees_between(v):
    expected = np.degrees(Rotation.from_rotvec(v).magnitude())
    np.testing.assert_allclose(degrees_between(rotations(v), np.eye(3)), expected, atol=1e-9)
