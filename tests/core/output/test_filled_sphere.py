"""A sphere without holes: what is shown stays, the rest goes on from its rim, closed at the poles and at ±180°."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.output.filled_sphere import filled_sphere
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.lazy import whole

HEIGHT, WIDTH = 512, 1024


def band() -> Layer:
    """What lies within 45° of the horizon: a gradient by height, and a red side at ±180°."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    light = np.stack([y / HEIGHT, y / HEIGHT, np.full_like(y, 0.5)], axis=-1)
    light[np.abs(x - WIDTH / 2) > WIDTH * 0.4] = 4.0, 0, 0
    alpha = ((y > HEIGHT / 4) & (y < HEIGHT * 3 / 4)).astype(np.float32)
    return Layer(light * alpha[..., None], alpha)


def test_what_is_shown_stays_and_nothing_is_open() -> None:
    before = band()
    after = filled_sphere(before)
    shown = before.alpha == 1
    assert after.alpha.all() and (whole(after.light)[shown] == before.light[shown]).all()


def test_each_pole_is_one_colour_of_its_own_rim() -> None:
    light = whole(filled_sphere(band()).light)
    for pole in (0, -1):
        assert np.ptp(light[pole], axis=0).max() < 0.05
    assert light[0, :, 1].mean() < 0.35 < 0.4 < light[-1, :, 1].mean(), "dark above, bright below"


def test_light_goes_on_from_the_rim_and_across_the_sides() -> None:
    light = whole(filled_sphere(band()).light)
    rim, beyond = light[HEIGHT // 4 + 1], light[HEIGHT // 4 - 2]
    assert np.abs(rim - beyond).mean() < 0.05
    assert np.abs(light[:, 0] - light[:, -1]).max() < 0.1


def test_parts_of_it_are_the_same_as_the_whole() -> None:
    after = filled_sphere(band())
    part = slice(40, 170), slice(900, 1010)
    np.testing.assert_allclose(after.light[part], whole(after.light)[part], atol=1e-5)
