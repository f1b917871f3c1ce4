"""Where a canvas shows a picture's pixel: the inverse of a map that only exists as an array."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.measure.metrics import shown_at
from edf_stitch.core.raster.picture_map import PictureMap


def test_a_pixel_is_found_where_the_map_shows_it_and_nowhere_else() -> None:
    x, y = np.meshgrid(np.arange(200.0), np.arange(150.0))
    seen = PictureMap(
        (0.8 * x + 0.05 * y + 3 * np.sin(y / 40)).astype(np.float32), (0.9 * y + 2 * np.cos(x / 30)).astype(np.float32),
        (180, 140),
    )  # fmt: skip
    places = np.random.default_rng(0).uniform((5, 5), (190, 140), (100, 2))
    found = shown_at(seen, seen.between(places))
    assert np.abs(found - places).max() < 0.05
    assert np.isnan(shown_at(seen, np.array([[-40.0, 60.0], [400.0, 60.0]]))).all()
    hidden = PictureMap(np.full_like(seen.x, np.nan), seen.y, seen.size)
    assert np.isnan(shown_at(hidden, np.array([[50.0, 60.0]]))).all()
