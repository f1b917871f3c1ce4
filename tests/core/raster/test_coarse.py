"""What is smooth, between the places it is worked out at."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.raster.coarse import coarse_places, in_between


@pytest.mark.parametrize("shape", [(30, 41), (7, 3), (1, 9)])
@pytest.mark.parametrize("step", [2, 4])
def test_what_is_smooth_is_right_between_the_places_it_is_worked_out_at(
    shape: tuple[int, int], step: int
) -> None:
    """Up to the border, for a function that is nearly straight; and NaN does not spread far."""

    def work(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        x, y = u[None, :], v[:, None]
        return np.stack([3 * x - 2 * y + 500 + 0.001 * x * y, np.where(x + 0 * y > 30, np.nan, y)], axis=-1)

    whole = work(np.arange(shape[1]), np.arange(shape[0]))
    bent, broken = in_between(shape, work(*coarse_places(shape, step)), step)
    assert bent.shape == shape and bent.dtype == np.float32
    np.testing.assert_allclose(bent, whole[..., 0], atol=1e-3)
    near = 30 - step
    np.testing.assert_allclose(broken[:, :near], whole[:, :near, 1], atol=1e-4)
    assert np.isnan(broken[:, 31:]).all()
