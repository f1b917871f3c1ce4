"""A click is moved to where the target shows the same."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

pytest.importorskip("bpy")

from edf_stitch.edf_addon.operators.fine_tune import SEARCH, fine_tuned  # noqa: E402


@pytest.fixture(scope="module")
def texture() -> np.ndarray:
    noise = np.random.default_rng(3).normal(size=(160, 200)).astype(np.float32)
    return cv2.GaussianBlur(noise, None, 2.0)


def shifted(texture: np.ndarray, dx: float, dy: float, gain: float = 1.0) -> np.ndarray:
    """What lay at p lies at p + (dx, dy)."""
    return gain * cv2.warpAffine(texture, np.float32([[1, 0, dx], [0, 1, dy]]), texture.shape[::-1],
                                 flags=cv2.INTER_CUBIC)  # fmt: skip


@pytest.mark.parametrize("shift", [(3.0, -5.0), (0.4, 0.3), (-7.25, 6.5), (0, 0)])
@pytest.mark.parametrize("x", [(90.0, 80.0), (100.3, 70.6)])
def test_a_click_some_px_off_finds_the_place(texture, shift, x):
    target = shifted(texture, *shift, gain=0.6) + 0.2  # another exposure does not matter
    found, score = fine_tuned(texture, target, np.array(x), np.array(x) + 2.0)
    assert score > 0.9
    np.testing.assert_allclose(found, np.array(x) + shift, atol=0.1)


@pytest.mark.parametrize("why", ["too far", "something else", "nothing there", "at the border"])
def test_otherwise_the_click_stands(texture, why):
    x = y = np.array([90.0, 80.0])
    target = texture
    if why == "too far":
        y = x + [SEARCH + 9, 0]
    elif why == "something else":
        target = np.ascontiguousarray(texture[::-1, ::-1])
    elif why == "nothing there":
        return np.testing.assert_array_equal(fine_tuned(np.ones_like(texture), texture, x, y)[0], y)
    else:
        y = np.array([3.0, 80.0])
    np.testing.assert_array_equal(fine_tuned(texture, target, x, y)[0], y)
