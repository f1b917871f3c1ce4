"""One homography: the direct linear transformation, and which plane it holds on to."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.rivals.homography import direct_linear, fit_one_homography
from edf_stitch.core.rivals.options import HOMOGRAPHY
from edf_stitch.core.system.errors import DegenerateGeometry
from hypothesis import given, settings
from hypothesis import strategies as st

from ..field.test_strict import SIDE, SIZE

properties = settings(max_examples=30)
small = st.floats(-0.2, 0.2)


@properties
@given(st.lists(small, min_size=4, max_size=4), st.floats(-300, 300), st.floats(-2e-4, 2e-4), st.integers(0, 99))
def test_exact_matches_give_the_homography(turn: list[float], shift: float, tilt: float, seed: int) -> None:
    H = np.array([[1 + turn[0], turn[1], shift], [turn[2], 1 + turn[3], -shift], [tilt, -tilt, 1.0]])
    x = np.random.default_rng(seed).uniform((0, 0), SIZE, (40, 2))
    ray = homogeneous(x) @ H.T
    assert (ray[:, 2] > 0.5).all()
    found = direct_linear(x, project(ray), np.random.default_rng(seed).uniform(0.1, 3, 40))
    assert np.abs(project(homogeneous(x) @ found.T) - project(ray)).max() < 1e-6
    assert (homogeneous(x) @ found.T)[:, 2].min() > 0, "its sign has the matches in front"


def test_weights_decide_between_contradicting_matches() -> None:
    x = np.random.default_rng(0).uniform((0, 0), SIZE, (60, 2))
    y = x + np.where(np.arange(60)[:, None] % 2, 5.0, -5.0)
    for odd in (False, True):
        weight = np.where(np.arange(60) % 2 == odd, 1e6, 1.0)
        moved = project(homogeneous(x) @ direct_linear(x, y, weight).T) - x
        assert np.abs(moved - (5.0 if odd else -5.0)).max() < 0.1


@pytest.mark.parametrize("points", [
    np.random.default_rng(0).uniform(0, 500, (HOMOGRAPHY.min_matches - 1, 2)), np.full((20, 2), 7.0),
    np.linspace((0, 0), (400, 300), 30),
], ids=["few", "spot", "line"])  # fmt: skip
def test_what_determines_no_homography_is_refused(points: np.ndarray) -> None:
    with pytest.raises(DegenerateGeometry, match="homography"):
        direct_linear(points, points + 1, np.ones(len(points)))


def test_of_two_planes_it_takes_the_larger_and_what_is_far_off_has_no_say() -> None:
    x = np.random.default_rng(0).uniform((0, 0), SIZE, (300, 2))
    near = np.arange(300) < 100
    y = x + np.where(near[:, None], (60.0, 0.0), (10.0, 0.0))
    field = fit_one_homography(SIDE, Matches(x, y))
    assert np.array_equal(field.fit.inliers_used, ~near) and field.fit.residual_px < 1e-6
    assert np.abs(field.predict(x) - x - (10.0, 0.0)).max() < 1e-6


def test_the_same_seed_gives_the_same_homography() -> None:
    x = np.random.default_rng(0).uniform((0, 0), SIZE, (300, 2))
    y = x + np.random.default_rng(1).normal(0, 6, x.shape)
    first, second = (fit_one_homography(SIDE, Matches(x, y), seed=5).two_view.H_inf for _ in range(2))
    assert np.array_equal(first, second)
