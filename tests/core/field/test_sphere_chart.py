"""A chart of the sphere: rays and places of nodes are each other's inverse, all around."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.field.sphere_chart import SphereChart
from hypothesis import given, settings
from hypothesis import strategies as st

turns = st.tuples(*[st.floats(-3, 3)] * 3)


@settings(max_examples=60, deadline=None)
@given(turns, st.floats(0, 63), st.floats(-64, 200))
def test_places_are_where_rays_came_from(turn: tuple[float, float, float], row: float, column: float) -> None:
    chart = SphereChart.whole(rotation_from_vector(np.array(turn)), 64)
    ray = chart.rays(np.array([row]), np.array([column]))
    assert np.linalg.norm(ray) == pytest.approx(1)
    found = np.array(chart.places(ray)).ravel()
    # columns go around
    assert (found[0] - column + 64) % 128 == pytest.approx(64, abs=1e-6)
    assert found[1] == pytest.approx(row, abs=1e-6)


def test_nodes_lie_evenly_between_the_poles() -> None:
    chart = SphereChart.whole(np.eye(3), 90)
    ahead = chart.rays(np.array([44.5]), np.array([89.5]))[0, 0]
    assert np.allclose(ahead, [0, 0, 1]) and chart.shape == (90, 180)
    right = chart.rays(np.array([44.5]), np.array([134.5]))[0, 0]
    down = chart.rays(np.array([89.5]), np.array([0]))[0, 0]
    assert np.allclose(right, [1, 0, 0]) and np.allclose(down, [0, 1, 0])
    assert chart.per_radian == pytest.approx(90 / np.pi)
