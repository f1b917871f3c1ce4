"""Values between those of a small picture: straight lines stay straight, and cuts change no bit."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.raster.enlarging import EnlargedImage, Enlargement, enlarged_box, reduced_box, repeated

SMALL = np.random.default_rng(0).standard_normal((7, 9)).astype(np.float32)


def of_whole(values: np.ndarray, times: int, goes_on: bool = False) -> np.ndarray:
    height, width = values.shape[:2]
    everything = slice(0, times * height), slice(0, times * width)
    return Enlargement(everything, times, (height, width)).of(values, goes_on)


@pytest.mark.parametrize("times", [1, 2, 3, 4, 8])
def test_a_plane_goes_on_to_the_outer_edge(times: int) -> None:
    """Pixel p of the small picture has its middle at times (p + ½) − ½."""
    y, x = np.mgrid[:7, :9].astype(np.float32)
    found = of_whole(2 * x - 3 * y + 1, times, goes_on=True)
    rows, columns = ((np.arange(times * side) + 0.5) / times - 0.5 for side in (7, 9))
    np.testing.assert_allclose(found, 2 * columns - 3 * rows[:, None] + 1, atol=1e-4)
    held = of_whole(x, times)
    assert held.min() == 0 and held.max() == 8, "without going on nothing leaves the values' range"


@pytest.mark.parametrize("times", [2, 3, 4])
@pytest.mark.parametrize("goes_on", [False, True])
def test_every_cut_gives_the_same_bits(times: int, goes_on: bool) -> None:
    whole, random = of_whole(SMALL, times, goes_on), np.random.default_rng(1)
    for _ in range(60):
        part = tuple(slice(*np.sort(random.choice(times * side + 1, 2, replace=False))) for side in SMALL.shape)
        here = Enlargement(part, times, SMALL.shape)
        np.testing.assert_array_equal(here.of(SMALL[here.cells], goes_on), whole[part])
    channels = np.stack([SMALL, -SMALL], axis=-1)
    np.testing.assert_array_equal(of_whole(channels, times, goes_on), np.stack([whole, -whole], axis=-1))


def test_what_is_not_known_spreads_no_further_than_its_neighbours() -> None:
    values = SMALL.copy()
    values[3, 4] = np.nan
    unknown = np.isnan(of_whole(values, 4))
    rows, columns = np.nonzero(unknown)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (10, 17, 14, 21)


def test_an_image_is_enlarged_where_it_is_read() -> None:
    image = EnlargedImage(SMALL, 4)
    assert image.shape == (28, 36)
    np.testing.assert_array_equal(image[5:9, 30:36], of_whole(SMALL, 4)[5:9, 30:36])


def test_masks_are_repeated_and_boxes_hold_one_another() -> None:
    mask = SMALL > 0
    assert repeated(mask, 3).shape == (21, 27) and (repeated(mask, 3)[1::3, 1::3] == mask).all()
    assert enlarged_box((1, 2, 3, 4), 4) == (4, 8, 12, 16)
    assert reduced_box((4, 8, 12, 16), 4) == (1, 2, 3, 4)
    assert reduced_box((-1, 7, 2, 2), 4) == (-1, 1, 2, 2), "over both edges"
