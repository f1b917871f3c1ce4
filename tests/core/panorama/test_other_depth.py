"""Maps at another depth are those that this depth would have had, on any plane and from any viewpoint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.panorama.other_depth import every_nth, seen_at, with_depth
from edf_stitch.core.panorama.slid_warp import slid_warp
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.lazy import whole

from .test_slid_warp import on, rig


def warps(by_hand, kind: str) -> tuple[Warp, tuple]:
    base, views, viewpoint = rig(by_hand, 5)
    if kind == "still":
        return replace(base, beside=None), views
    return slid_warp(base, views, viewpoint.sliding(0.8), on(views, kind, np.random.default_rng(1))), views


@pytest.mark.parametrize("kind", ["still", "cylindrical", "equirectangular"])
def test_the_depth_it_has_gives_the_maps_it_has(by_hand, kind: str) -> None:
    warp, views = warps(by_hand, kind)
    box = slice(10, 90), slice(20, 160)
    for number in (0, 1):
        x, y = seen_at(warp, views, number, box, warp.inverse_depth[box])
        there = warp.maps[number].arrays()
        off = np.hypot(there.x[box] - x, there.y[box] - y)
        assert np.nanmax(off) < 0.05


@pytest.mark.parametrize("kind", ["still", "cylindrical"])
def test_another_depth_moves_only_what_takes_it(by_hand, kind: str) -> None:
    warp, views = warps(by_hand, kind)
    where = np.zeros(warp.inverse_depth.shape, bool)
    where[30:60, 40:120] = True
    depth = warp.inverse_depth + np.float32(0.05)
    found = with_depth(warp, views, depth, where)
    assert np.array_equal(found.inverse_depth, np.where(where, depth, warp.inverse_depth))
    assert found.refilled is not None and np.array_equal(found.refilled, where)
    assert found.behind is None or not found.behind[where].any()
    everywhere = slice(0, where.shape[0]), slice(0, where.shape[1])
    for number in (0, 1):
        x, _ = seen_at(warp, views, number, everywhere, found.inverse_depth)
        new, old = (one.maps[number].arrays().x for one in (found, warp))
        assert np.array_equal(new[~where], old[~where], equal_nan=True)
        assert np.nanmax(np.abs(new - x)[where]) < 0.05
    assert np.nanmin(np.abs(found.maps[1].arrays().x - warp.maps[1].arrays().x)[where]) > 1
    assert with_depth(warp, views, depth, np.zeros_like(where)) is warp


def test_a_coarser_look_shows_the_same_directions(by_hand) -> None:
    warp, views = warps(by_hand, "cylindrical")
    coarse = every_nth(replace(warp, refilled=warp.inverse_depth > 0.1), 4)
    assert np.array_equal(coarse.canvas.xs, warp.canvas.xs[2::4]) and np.array_equal(
        coarse.canvas.ys, warp.canvas.ys[2::4]
    )
    assert np.array_equal(coarse.inverse_depth, warp.inverse_depth[2::4, 2::4])
    assert np.array_equal(coarse.maps[1].arrays().y, warp.maps[1].arrays().y[2::4, 2::4], equal_nan=True)
    for name in ("slide", "lazy_confidence"):
        fine, found = getattr(warp, name), getattr(coarse, name)
        assert (fine is None) == (found is None)
        assert fine is None or np.allclose(whole(found), whole(fine)[2::4, 2::4], atol=1e-6)
    assert coarse.refilled is not None and coarse.refilled.shape == coarse.inverse_depth.shape
    near = whole(warp.nearness(views, 1))[2::4, 2::4]
    assert np.allclose(whole(coarse.nearness(views, 1)), near, rtol=1e-5, equal_nan=True)
