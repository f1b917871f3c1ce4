"""Standard deviations from medians, and coordinates of resized pictures."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.raster.resizing import resized_points, size_change
from edf_stitch.core.raster.robust import sigma_of, sigma_of_lengths


def test_the_noise_is_found_whatever_outliers_do() -> None:
    random = np.random.default_rng(0)
    noise = random.normal(0, 0.3, 20_000)
    assert sigma_of(noise) == pytest.approx(0.3, rel=0.02)
    assert sigma_of_lengths(np.hypot(noise[::2], noise[1::2])) == pytest.approx(0.3, rel=0.02)
    noise[::50] = 1e6
    assert sigma_of(noise) == pytest.approx(0.3, rel=0.05)


def test_corners_of_a_picture_stay_its_corners_when_it_is_resized() -> None:
    corners = np.array([[-0.5, -0.5], [399.5, 299.5]])
    assert np.allclose(resized_points(corners, (400, 300), (100, 150)), [[-0.5, -0.5], [99.5, 149.5]])
    factor, shift = size_change((400, 300), (100, 150))
    assert np.allclose(factor * corners + shift, resized_points(corners, (400, 300), (100, 150)))
