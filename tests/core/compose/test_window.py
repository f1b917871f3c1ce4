"""Windows of a canvas, also across ±180°."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.compose.window import Window, goes_round, window_of
from edf_stitch.core.compose.wraparound import WrappedImage
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap
from hypothesis import given, settings
from hypothesis import strategies as st

from .rings import CANVAS, HEIGHT, WIDTH, shown

FLAT = replace(CANVAS, projection=None)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, WIDTH - 1), st.integers(1, WIDTH - 1), st.integers(0, 60))
def test_a_window_holds_what_is_shown_and_no_more_than_a_margin(first: int, width: int, margin: int) -> None:
    shows = shown((first, width))
    tight = window_of(CANVAS, shows)
    assert tight is not None and tight.plane(shows).all() and tight.box == (first, 110, width, 140)
    window = tight.with_margin(margin)
    assert window.spread(window.plane(shows)).sum() == shows.sum()
    left, top, across, down = window.box
    assert left == (first - margin) % WIDTH and (top, down) == (max(0, 110 - margin), 140 + 2 * min(margin, 110))
    assert across == 2 * margin + (width if WIDTH - width > 2 * margin else WIDTH)


def test_a_canvas_that_ends_is_not_wrapped() -> None:
    shows = shown((WIDTH - 50, 100))
    for canvas in (FLAT, CANVAS.within((0, 0, WIDTH - 1, HEIGHT))):
        tight = window_of(canvas, shows[:, : canvas.width])
        assert tight is not None
        window = tight.with_margin(10)
        assert window.box[0] == 0 and window.box[2] == canvas.width
        assert len(window.parts) == 1 and not goes_round(canvas)
    assert goes_round(CANVAS) and window_of(CANVAS, np.zeros_like(shows)) is None


@pytest.mark.parametrize(
    "box", [(100, 20, 300, 90), (WIDTH - 130, 20, 300, 90), (0, 0, WIDTH, HEIGHT), (600, 20, WIDTH + 60, 90)]
)
def test_all_that_lies_on_the_canvas_is_cut_alike(box: tuple[int, int, int, int]) -> None:
    window = Window(box, (WIDTH, HEIGHT))
    left, top, width, height = box
    values = np.random.default_rng(0).random((HEIGHT, WIDTH, 3)).astype(np.float32)
    want = np.take(values, np.arange(left, left + width), axis=1, mode="wrap")[top : top + height]
    assert np.array_equal(window.plane(values), want) and window.shape == want.shape[:2]
    lazy = WrappedImage(values, 0)
    for image in (window.image(values), window.image(lazy)):
        assert image.shape == want.shape
        assert np.array_equal(image[5:60, 90:210], want[5:60, 90:210])
    layer = window.layer(Layer(lazy, values[..., 0] > 0.5))
    assert np.array_equal(layer.pixels, want) and np.array_equal(layer.alpha, want[..., 0] > 0.5)
    found = window.map(PictureMap(values[..., 0], values[..., 1], (30, 20)))
    assert np.array_equal(found.x, want[..., 0]) and np.array_equal(found.y, want[..., 1]) and found.size == (30, 20)
    out = np.zeros_like(values)
    window.put(want, out)
    assert np.array_equal(window.plane(out), want)
    own = want[:, window.overhang : width - window.overhang]
    assert np.count_nonzero(out) == np.count_nonzero(own), "nothing else is touched"
    closed = window.closed(np.random.default_rng(1).random((height, width)) > 0.5)
    assert np.array_equal(window.plane(window.spread(closed)), closed)
