"""The largest rectangle within a mask, against every rectangle there is."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest
from edf_stitch.core.raster.rectangle import largest_rectangle
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays


def largest_area(mask: np.ndarray) -> int:
    """By trying every rectangle."""
    total = np.pad(mask.astype(int).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    height, width = mask.shape
    best = 0
    for h in range(1, height + 1):
        for w in range(1, width + 1):
            inside = total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w]
            best = max(best, h * w if (inside == h * w).any() else 0)
    return best


def blobs(seed: int, height: int, width: int) -> np.ndarray:
    """A random picture of smooth shapes, with some holes."""
    noise = np.random.default_rng(seed).standard_normal((height, width))
    smooth = cv2.GaussianBlur(noise, (0, 0), 1 + seed % 5)
    return smooth > np.quantile(smooth, 0.1 + 0.08 * (seed % 9))


@pytest.mark.parametrize("seed", range(30))
def test_inscribed_is_the_largest_of_all_rectangles(seed: int) -> None:
    mask = blobs(seed, 10 + seed, 45 - seed)
    left, top, width, height = largest_rectangle(mask)
    assert mask[top : top + height, left : left + width].shape == (height, width)
    assert mask[top : top + height, left : left + width].all()
    assert width * height == largest_area(mask)


@settings(max_examples=150)
@given(arrays.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_inscribed_on_any_mask(mask: np.ndarray) -> None:
    if not mask.any():
        assert largest_rectangle(mask) == (0, 0, 0, 0)
        return
    left, top, width, height = largest_rectangle(mask)
    assert mask[top : top + height, left : left + width].all() and width * height == largest_area(mask) > 0
    assert left >= 0 and top >= 0 and left + width <= mask.shape[1] and top + height <= mask.shape[0]


def test_of_equals_the_first_from_the_top_and_the_left_is_taken() -> None:
    assert largest_rectangle(np.array([[0, 0, 0], [1, 0, 1], [0, 0, 0]], bool)) == (0, 1, 1, 1)
    assert largest_rectangle(np.array([[0, 1, 0], [0, 0, 0], [1, 0, 1]], bool)) == (1, 0, 1, 1)


def test_twelve_megapixels_take_less_than_a_second() -> None:
    mask = np.zeros((3000, 4000), np.uint8)
    cv2.fillConvexPoly(mask, np.array([[100, 200], [3900, 0], [3700, 2950], [0, 2700]]), 1)
    began = time.process_time()
    left, top, width, height = largest_rectangle(mask > 0)
    assert time.process_time() - began < 1
    assert mask[top : top + height, left : left + width].all() and width * height > 9_000_000
