"""What an artist wants to see of a picture comes from it, wherever it shows that."""

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.compose.wanted import wanted_on
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pictures.resized import resized
from edf_stitch.core.raster.picture_map import PictureMap

from .rings import HEIGHT, RING, WIDTH, compose, layers_of, wall, warp_of


@pytest.mark.parametrize("number", range(len(RING)))
def test_each_picture_of_a_set_can_be_chosen_whenever_it_is_added(number: int) -> None:
    layers, warp = layers_of([wall()] * len(RING)), warp_of()
    usual = compose(layers, warp)
    others = [one for one in range(len(RING)) if one != number]
    overlap = (layers[number].alpha > 0) & np.logical_or.reduce([layers[one].alpha > 0 for one in others])
    wanted = np.where(overlap, np.int16(number), np.int16(-1))
    made = compose(layers, warp, shown_from=wanted)
    assert usual.labels is not None and made.labels is not None
    assert (usual.labels[overlap] != number).any(), "else nothing is chosen"
    assert (made.labels[overlap] == number).all()


def test_what_is_wanted_is_found_on_the_canvas_and_the_later_picture_counts() -> None:
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    picture = picture_from_array(np.zeros((20, 30, 3), np.uint8))
    assert wanted_on([picture], [PictureMap(columns, rows, (30, 20))]) is None
    drawn = np.zeros((20, 30), bool)
    drawn[5:10, 5:10] = True
    first, second = replace(picture, wanted=drawn), replace(picture, wanted=np.roll(drawn, 2, axis=1))
    found = wanted_on([picture, first, second], [PictureMap(columns, rows, (30, 20))] * 3)
    assert found is not None and found.shape == (HEIGHT, WIDTH)
    assert (found[5:10, 5:7] == 1).all() and (found[5:10, 7:12] == 2).all()
    assert np.count_nonzero(found >= 0) == 5 * 7


def test_it_shrinks_with_its_picture() -> None:
    drawn = np.zeros((20, 30), bool)
    drawn[:, :10] = True
    small = resized(replace(picture_from_array(np.zeros((20, 30, 3), np.uint8)), wanted=drawn), 0.5)
    assert small.wanted is not None and np.array_equal(small.wanted, drawn[::2, ::2])
