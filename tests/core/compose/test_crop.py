"""What is kept of the panorama: never a pixel more than was asked for, and the most that can be."""

from __future__ import annotations

import time

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.crop import crop_box, largest_rectangle, parse_crop
from edf_stitch.core.system.errors import BadRequest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

SHOWS = np.zeros((30, 50), bool)
SHOWS[5:25, 10:40] = True
REFERENCE = (12, 6, 20, 15)


def box(kind: str | tuple) -> tuple[int, int, int, int]:
    return crop_box(kind, (0, 0, 50, 30), SHOWS, REFERENCE)


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


def test_the_four_kinds() -> None:
    assert box("full") == (0, 0, 50, 30)
    assert box("inscribed") == (10, 5, 30, 20)
    assert box("reference") == REFERENCE
    assert box((3, 4, 47, 26)) == (3, 4, 47, 26)
    assert box((49, 29, 1, 1)) == (49, 29, 1, 1) and box((0, 0, 50, 30)) == (0, 0, 50, 30)


@pytest.mark.parametrize("wrong", [
    (-1, 0, 5, 5), (0, -1, 5, 5), (46, 0, 5, 5), (0, 26, 5, 5), (0, 0, 51, 1), (0, 0, 1, 31), (0, 0, 0, 5),
    (0, 0, 5, -1), (50, 30, 1, 1),
])  # fmt: skip
def test_a_box_outside_is_refused_with_the_panoramas_size(wrong: tuple[int, int, int, int]) -> None:
    with pytest.raises(BadRequest, match="50×30 pixels") as caught:
        box(wrong)
    assert ",".join(map(str, wrong)) in str(caught.value) and caught.value.exit_code == 2


@pytest.mark.parametrize("wrong", ["", "everything", "Full", (1, 2, 3)])
def test_other_kinds_are_refused_by_name(wrong: str | tuple) -> None:
    with pytest.raises(BadRequest, match="full, inscribed, reference"):
        box(wrong)


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
        with pytest.raises(BadRequest, match="nothing"):
            largest_rectangle(mask)
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


@pytest.mark.parametrize(("text", "kind"), [
    ("full", "full"), ("inscribed", "inscribed"), ("reference", "reference"), ("1,2,3,4", (1, 2, 3, 4)),
    (" 10, 20 ,30, 40 ", (10, 20, 30, 40)), ("-5,0,9,9", (-5, 0, 9, 9)),
])  # fmt: skip
def test_what_the_command_line_says(text: str, kind: str | tuple) -> None:
    assert parse_crop(text) == kind


@pytest.mark.parametrize(
    "text", ["", "ful", "1,2,3", "1,2,3,4,5", "1,2,3,x", "1.5,2,3,4", "1,2,,4", "0,0,0,5", "0,0,5,-5"]
)
def test_nonsense_on_the_command_line_is_refused(text: str) -> None:
    with pytest.raises(BadRequest) as caught:
        parse_crop(text)
    assert text in str(caught.value) and ("inscribed" in str(caught.value) or "1 or more" in str(caught.value))
