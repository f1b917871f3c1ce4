"""What is clipped in camera RAW comes from a picture that was exposed shorter, where one shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.composition import composed
from edf_stitch.core.compose.tone.raw_highlights import without_clipped
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer, layer_of
from edf_stitch.core.panorama.reference_map import ReferenceMap
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.picture_map import PictureMap

from ...pairs import ON_REFERENCE

HEIGHT, WIDTH = 120, 300
SKY = np.s_[10:60, :]
NOTHING = np.zeros((HEIGHT, WIDTH), bool)


def scene() -> np.ndarray:
    """Light of a wall from 0.1 to 0.3 below a sky of 0.9 to 1.4."""
    light = np.random.default_rng(4).uniform(0.1, 0.3, (HEIGHT, WIDTH, 3)).astype(np.float32)
    light[SKY] = 0.9 + 0.5 * np.linspace(0, 1, WIDTH, dtype=np.float32)[:, None]
    return light


def layer(clips_at: float, columns: slice) -> Layer:
    shown = np.zeros((HEIGHT, WIDTH), bool)
    shown[:, columns] = True
    light = np.minimum(scene(), np.float32(clips_at)) * shown[..., None]
    return Layer(light.astype(np.float32), shown, clips_at)


def test_it_is_left_out_where_a_shorter_exposure_shows_it() -> None:
    longer, shorter = without_clipped([layer(0.5, np.s_[:200]), layer(2.0, np.s_[100:])], [NOTHING] * 2)
    assert not longer.alpha[15:55, 105:195].any() and longer.alpha[70:, :200].all()
    assert longer.alpha[15:55, :95].all(), "nobody else shows it"
    assert shorter.alpha[:, 100:].all() and not longer.pixels[15:55, 105:195].any()


def test_what_the_other_cannot_see_stays() -> None:
    hidden = NOTHING.copy()
    hidden[:, 150:] = True
    longer, _ = without_clipped([layer(0.5, np.s_[:200]), layer(2.0, np.s_[100:])], [NOTHING, hidden])
    assert not longer.alpha[15:55, 105:145].any() and longer.alpha[15:55, 155:200].all()


@pytest.mark.parametrize("clips", [(0.5, 0.55), (np.inf, np.inf), (2.0, 0.5)])
def test_a_picture_that_clips_at_no_less_keeps_all(clips: tuple[float, float]) -> None:
    first = layer(clips[0], np.s_[:200])
    assert without_clipped([first, layer(clips[1], np.s_[100:])], [NOTHING] * 2)[0] is first


def test_glints_and_what_stands_before_a_clipped_sky_stay() -> None:
    first = layer(0.5, np.s_[:])
    light = first.pixels.copy()
    light[20:24, 50:54], light[90:93, 150:153] = 0.2, 0.5  # a leaf, a glint
    found, _ = without_clipped([replace(first, light=light), layer(2.0, np.s_[:])], [NOTHING] * 2)
    assert not found.alpha[15:55, 20:100].any(), "the leaf goes with the sky"
    assert found.alpha[80:100, 140:160].all()


def test_a_layer_clips_where_its_picture_does() -> None:
    picture = replace(picture_from_array(scene()), clips_at=0.5)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    canvas, camera = Canvas(WIDTH, HEIGHT, (0, 0)), Camera(np.eye(3), (WIDTH, HEIGHT), "test", 0.0)
    for one in (PictureMap(x, y, camera.size), ReferenceMap(canvas, camera)):
        made = layer_of(picture, one)
        assert made.clips_at == made.within((10, 10, 20, 20)).clips_at == 0.5
        assert made.keep((slice(0, 10), slice(0, 10))).clips_at == 0.5


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("first", [0.5, 2.0])
def test_the_panorama_has_the_light_of_the_sky(count: int, first: float) -> None:
    """Whichever was exposed longer, where both show it; a third picture shows what the first does."""
    clips = [first, 1.0 / first, first][:count]
    layers = [layer(one, columns) for one, columns in zip(clips, (np.s_[:200], np.s_[100:], np.s_[:200]), strict=False)]
    canvas, camera = Canvas(WIDTH, HEIGHT, (0, 0)), Camera(np.eye(3), (WIDTH, HEIGHT), "test", 0.0)
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    same = PictureMap(x, y, camera.size)
    maps = (ReferenceMap(canvas, camera), *(same,) * (count - 1))
    warp = Warp(canvas, maps, np.full((HEIGHT, WIDTH), np.nan, np.float32))
    view = View(camera, np.eye(3), np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    made = composed(layers, warp, (view,) * count, ON_REFERENCE, (True,) * count, None, lambda *_: None)
    both = np.s_[15:50, 110:190]
    assert np.abs(made.panorama.pixels[both] / scene()[both] - 1).max() < 0.02
    assert (made.panorama.alpha > 0).all()
