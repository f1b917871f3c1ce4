"""A picture on the canvas: small ones are fetched once, and show the same as those that are fetched where they are
read."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.panorama import layers
from edf_stitch.core.panorama.layers import Fetched, layer_of
from edf_stitch.core.panorama.options import LayerOptions
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.colour import encode
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


def branches_before_a_sky() -> np.ndarray:
    """Light (400, 400, 1) of dark lines across a bright ground."""
    random = np.random.default_rng(4)
    drawn = np.full((400, 400), 1.0, np.float32)
    for _ in range(60):
        ends = random.integers(-40, 440, (2, 2))
        cv2.line(drawn, *(tuple(map(int, end)) for end in ends), float(random.uniform(0.01, 0.1)), 5, cv2.LINE_AA)
    return drawn[..., None]


def seen_from(light: np.ndarray, shift: int) -> np.ndarray:
    """What pixels of 4 × 4 of its values see, beginning `shift` further to the right and down."""
    part = light[shift : shift + 392, shift : shift + 392]
    return part.reshape(98, 4, 98, 4, -1).mean(axis=(1, 3)).astype(np.float32)


def halfway(picture: np.ndarray, by_root: bool) -> np.ndarray:
    """A picture fetched half a pixel to the right and down, without its rim."""
    y, x = np.mgrid[: len(picture), : len(picture)].astype(np.float32) + np.float32(0.5)
    layer = layer_of(picture_from_array(picture), PictureMap(x, y, picture.shape[1::-1]), by_root)
    return layer.pixels[4:-4, 4:-4]


def test_the_root_of_light_is_interpolated_closer_to_what_is_seen_there() -> None:
    """Dark lines before a bright sky, half a pixel off: against what pixels in that place see."""
    light = branches_before_a_sky()
    picture, truth = seen_from(light, 0), seen_from(light, 2)[4:-4, 4:-4]
    off = [np.std(encode(halfway(picture, by_root), 16).astype(float) - encode(truth, 16)) for by_root in (True, False)]
    assert off[0] < 0.9 * off[1]


def test_how_bright_a_picture_is_has_no_part_in_its_interpolation() -> None:
    picture = seen_from(branches_before_a_sky(), 0)
    assert np.allclose(halfway(16 * picture, True), 16 * halfway(picture, True), rtol=1e-5)


def test_light_below_black_stays_below_it() -> None:
    """Pictures in float have such values, and roots do not."""
    flat = np.full((20, 20, 3), -0.25, np.float32)
    assert np.allclose(halfway(flat, True), -0.25, rtol=1e-5)


def test_light_by_its_root_is_not_multiplied_by_alpha() -> None:
    picture = np.full((20, 20, 4), 0.36, np.float32)
    picture[..., 3] = np.linspace(0.2, 1, 20)
    assert np.allclose(halfway(picture, True), 0.36, rtol=1e-5)
