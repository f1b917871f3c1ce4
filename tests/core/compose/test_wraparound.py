"""A whole sphere's panorama does not depend on where it was cut open."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.compose.composition import composed, pooled_decision
from edf_stitch.core.compose.wraparound import WrappedImage, roll_for, rolled, rolled_maps
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.panorama.warp import Warp

H, W = 180, 360
FOCAL = H / np.pi
SPHERE = Projection("equirectangular", FOCAL, (-0.5, -0.5), np.eye(3), np.diag([FOCAL, FOCAL, 1.0]))
CANVAS = Canvas(W, H, (W // 2, H // 2), projection=SPHERE)
NO_DEPTH: Any = SimpleNamespace(H_inf=np.eye(3), e_prime=np.zeros(3))


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
    warp = Warp(CANVAS, rolled(x, turn), rolled(y, turn), flat, rolled(layers[1].alpha, 0))
    return layers[0], layers[1], warp


def compose(turn: int, decided: Any = None, painted: np.ndarray | None = None, **options: Any) -> tuple:
    first, second, warp = world(turn)
    return composed(first, second, warp, NO_DEPTH, (W, H), StitchOptions(exposure=False, **options), (True, True),
                    painted, lambda *_: None, decided, keep=True)  # fmt: skip


# where the sphere is cut open: where nothing is, in the reference alone, in the overlap, in the target alone
@pytest.mark.parametrize("turn", [100, 175, 195, 250])
@pytest.mark.parametrize("options", [{}, {"blend": "feather"}, {"blend": "feather", "seam": "none"}, {"seam": "none"}])
def test_it_looks_the_same_wherever_it_was_cut_open(turn: int, options: dict) -> None:
    whole, _, found = compose(0, **options)
    cut, _, found_too = compose(turn, **options)
    assert np.allclose(cut.pixels, rolled(whole.pixels, turn), atol=2e-3)
    assert np.array_equal(cut.alpha, rolled(whole.alpha, turn))
    if found.from_target is not None:
        assert (found_too.from_target != rolled(found.from_target, turn)).mean() < 1e-3


def test_paint_and_a_clips_decision_stay_where_they_are() -> None:
    painted = np.zeros((H, W), np.int8)
    painted[60:80, 160:190] = 1
    *_, found = compose(175, painted=rolled(painted, 175))
    assert rolled(found.from_target, -175)[60:80, 160:190].all()
    shared = pooled_decision([found, found])
    assert np.array_equal(shared.from_target, found.from_target)
    again, _, kept = compose(175, decided=shared)
    assert kept is shared and np.array_equal(again.pixels, compose(175, painted=rolled(painted, 175))[0].pixels)


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


def test_a_warp_is_rolled_with_all_that_it_says() -> None:
    random = np.random.default_rng(0)
    x, y, depth, confidence = random.random((4, 5, 8)).astype(np.float32)
    canvas = replace(CANVAS, width=8, height=5)
    found = rolled_maps(Warp(canvas, x, y, depth, confidence), 3)
    pairs = (found.map_x, x), (found.map_y, y), (found.inverse_depth, depth), (found.confidence, confidence)
    for values, whole in pairs:
        assert np.array_equal(values, np.concatenate([whole[:, 3:], whole[:, :3]], axis=1))
    assert found.canvas == canvas and rolled_maps(Warp(canvas, x, y, depth), -2).confidence is None
