"""A picture on the canvas: small ones are fetched once, and show the same as those that are fetched where they are
read."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.panorama import layers
from edf_stitch.core.panorama.layers import Fetched, layer_of
from edf_stitch.core.panorama.options import LayerOptions
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.picture_map import PictureMap


def test_a_small_layer_is_fetched_once_and_shows_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = picture_from_array(np.random.default_rng(0).integers(0, 256, (60, 80, 3), np.uint8))
    y, x = np.mgrid[:70, :90].astype(np.float32)
    picture_map = PictureMap(0.9 * x + 3.3, 0.95 * y - 2.7, (80, 60))
    fetches = []
    fetched = Fetched.__getitem__
    monkeypatch.setattr(Fetched, "__getitem__", lambda *asked: (fetches.append(asked), fetched(*asked))[1])

    small = layer_of(picture, picture_map)
    shown = [small.pixels for _ in range(3)]
    assert len(fetches) == 1
    monkeypatch.setattr(layers, "LAYER", LayerOptions(held_values=0))
    large = layer_of(picture, picture_map)
    assert len(fetches) == 1
    assert np.array_equal(large.pixels, shown[0]) and len(fetches) == 2
    assert np.array_equal(large.alpha, small.alpha)
