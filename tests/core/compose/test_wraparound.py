"""A whole sphere's panorama does not depend on where it was cut open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.composition import Composition, composed
from edf_stitch.core.compose.pooling import pooled_decision
from edf_stitch.core.compose.wraparound import WrappedImage, roll_for, rolled, rolled_map
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.picture_map import PictureMap

from ...pairs import ON_REFERENCE, own_map

H, W = 180, 360
FOCAL = H / np.pi
SPHERE = Projection("equirectangular", FOCAL, (-0.5, -0.5), np.eye(3), np.diag([FOCAL, FOCAL, 1.0]))
CANVAS = Canvas(W, H, (W // 2, H // 2), projection=SPHERE)
# no depth, no baseline
VIEWS = (View(Camera(np.eye(3), (W, H), "test", 0.0), np.eye(3), np.eye(3), np.zeros(3), np.eye(3), np.zeros(3)),) * 2


def world(turn: int) -> tuple[Layer, Layer, Warp]:
    """Two pictures of a wall, one lit more strongly, on a sphere that begins `turn` columns further on."""
    random = np.random.default_rng(0)
    wall = (0.3 + 0.02 * random.random((H, W, 3))).astype(np.float32)
    layers = []
    for columns, gain in ((slice(60, 200), 1.0), (slice(150, 290), 1.2)):
        alpha = np.zeros((H, W), np.float32)
        alpha[40:140, columns] = 1
        light = (gain * wall * alpha[..., None]).astype(np.float32)
        layers.append(Layer(rolled(light, turn), rolled(alpha, turn)))
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    flat = np.full((H, W), np.nan, np.float32)
    maps = own_map(CANVAS, VIEWS[0].camera), PictureMap(rolled(x, turn), rolled(y, turn), (W, H))
    warp = Warp(CANVAS, maps, flat, rolled(layers[1].alpha, 0))
    return layers[0], layers[1], warp


def compose(turn: int, decided: Any = None, painted: np.ndarray | None = None, **options: Any) -> Composition:
    *layers, warp = world(turn)
    return composed(layers, warp, VIEWS, replace(ON_REFERENCE, exposure="none", **options), (True, True), painted,
                    lambda *_: None, decided, keep=True)  # fmt: skip


# where the sphere is cut open: where nothing is, in the reference alone, in the overlap, in the target alone
@pytest.mark.parametrize("turn", [100, 175, 195, 250])
@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}, {"seam": "none"}])
def test_it_looks_the_same_wherever_it_was_cut_open(turn: int, options: dict) -> None:
    whole, cut = compose(0, **options), compose(turn, **options)
    assert np.allclose(cut.panorama.pixels, rolled(whole.panorama.pixels, turn), atol=2e-3)
    assert np.array_equal(cut.panorama.alpha, rolled(whole.panorama.alpha, turn))
    chosen, chosen_too = whole.decided[1].chosen, cut.decided[1].chosen
    if chosen is not None:
        assert (chosen_too != rolled(chosen, turn)).mean() < 1e-3


def test_paint_and_a_clips_decision_stay_where_they_are() -> None:
    painted = np.zeros((H, W), np.int8)
    painted[60:80, 160:190] = 1
    first = compose(175, painted=rolled(painted, 175))
    found = first.decided[1].chosen
    assert rolled(found, -175)[60:80, 160:190].all()
    shared = pooled_decision([first.decided, first.decided])
    assert np.array_equal(shared[1].chosen, found)
    again = compose(175, decided=shared)
    assert again.decided[1] is shared[1] and np.array_equal(again.panorama.pixels, first.panorama.pixels)


def test_a_canvas_that_ends_is_left_alone() -> None:
    first, second, _ = world(175)
    assert roll_for(CANVAS, first, second) and not roll_for(CANVAS, *world(0)[:2])
    assert not roll_for(replace(CANVAS, projection=None), first, second)
    wider = replace(SPHERE, focal=2 * FOCAL)
    assert not roll_for(replace(CANVAS, projection=wider), first, second)


def test_round_a_pole_it_is_cut_open_where_the_pictures_share_least() -> None:
    first, second, _ = world(175)
    first.alpha[:20] = second.alpha[:20] = 1
    found = roll_for(CANVAS, first, second)
    assert first.alpha[20:, found].sum() + second.alpha[20:, found].sum() == 0


@pytest.mark.parametrize("columns", [0, 1, 77, W - 1])
def test_rolled_light_is_rolled_however_it_is_cut_up(columns: int) -> None:
    light = np.random.default_rng(0).random((H, W, 3)).astype(np.float32)
    one, whole = WrappedImage(light, columns), rolled(light, columns)
    for part in (np.s_[:, :], np.s_[10:20, 5:300], np.s_[:, W - 80 :], np.s_[3:4, :1], np.s_[5:9, 7:7]):
        assert np.array_equal(one[part], whole[part])


def test_a_map_is_rolled_in_both_directions() -> None:
    x, y = np.random.default_rng(0).random((2, 5, 8)).astype(np.float32)
    found = rolled_map(PictureMap(x, y, (30, 20)), 3)
    for values, whole in ((found.x, x), (found.y, y)):
        assert np.array_equal(values, np.concatenate([whole[:, 3:], whole[:, :3]], axis=1))
    assert found.size == (30, 20) and np.array_equal(rolled_map(found, -3).x, x)
