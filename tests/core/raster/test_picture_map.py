"""Maps from the canvas to a picture."""

import numpy as np
from edf_stitch.core.raster.picture_map import PictureMap


def test_between_pixels_a_map_is_bilinear_and_unknown_outside():
    y, x = np.mgrid[0:3, 0:4].astype(np.float32)
    found = PictureMap(10 + 2 * x, 20 + 3 * y, (50, 50)).between(np.array([[1.25, 0.5], [3.0, 2.0], [3.1, 1.0]]))
    np.testing.assert_allclose(found[:2], [[12.5, 21.5], [16.0, 26.0]])
    assert np.isnan(found[2]).all()


def test_a_map_of_a_picture_beyond_the_canvas_is_unknown_everywhere():
    nothing = np.empty((0, 0), np.float32)
    assert np.isnan(PictureMap(nothing, nothing, (50, 50)).between(np.zeros((2, 2)))).all()
