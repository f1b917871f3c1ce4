"""What moved between the pictures, and has a ragged depth, is shown whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.seams import torn_things
from edf_stitch.core.compose.seams.refills import improved
from edf_stitch.core.compose.seams.rough_seam import RoughSeam
from edf_stitch.core.compose.seams.torn_things import untorn
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.other_depth import seen_at
from edf_stitch.core.panorama.viewpoint import Viewpoint
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.raster.picture_map import PictureMap

W, H, SHIFT, FOCAL, FAR = 440, 300, 160, 400.0, 0.02
# Rows and columns of the panorama where somebody stands in either picture, and by how much further right in the second.
PART, FURTHER = np.s_[90:220, 250:340], 40
K = np.array([[FOCAL, 0, 0], [0, FOCAL, 0], [0, 0, 1]])
FROM_LEFT = np.array([[FOCAL, 0, -SHIFT], [0, FOCAL, 0], [0, 0, 1]])


def picture(number: int, moved: bool) -> Picture:
    """A wall of gentle waves, and before it somebody in stripes, who may have moved."""
    y, x = np.mgrid[:H, :W].astype(float)
    # from the middle between both places the wall lies half of its parallax to either side
    u = x + number * (SHIFT - FAR * FOCAL) + FAR * FOCAL / 2
    light = 0.55 + 0.15 * np.sin(u / 9) * np.cos(y / 7)
    person = u - FURTHER * number * moved
    inside = (y >= 90) & (y < 220) & (person >= 250) & (person < 300)
    light = np.where(inside, 0.3 + 0.25 * np.sign(np.sin(y / 5 + number * moved) * np.sin(person / 6)), light)
    return picture_from_array(np.repeat((255 * light).astype(np.uint8)[..., None], 3, axis=2))


def views() -> tuple[View, View]:
    first = View(Camera(K, (W, H), "given", 0.0), K, np.eye(3), np.zeros(3), np.eye(3), np.zeros(3))
    t = np.array([1.0, 0, 0])
    return first, View(
        Camera(FROM_LEFT, (W, H), "given", 0.0), FROM_LEFT, np.eye(3), t, FROM_LEFT @ np.linalg.inv(K), FROM_LEFT @ t
    )  # fmt: skip


def warped(depth: np.ndarray) -> Warp:
    """Both pictures, seen from the middle between their places, by an inverse depth."""
    slide = np.full(depth.shape, 0.5, np.float32)
    viewpoint = Viewpoint(0.5, -views()[1].t, np.eye(3), np.array([1.0, 0]), (-9.0, -8.0))
    empty = tuple(PictureMap(depth, depth, view.size) for view in views())
    warp = Warp(Canvas(depth.shape[1], depth.shape[0], (0, 0)), empty, depth, None, slide, None, viewpoint)
    everywhere = slice(0, depth.shape[0]), slice(0, depth.shape[1])
    maps = (seen_at(warp, views(), number, everywhere, depth) for number in (0, 1))
    made = tuple(PictureMap(x.astype(np.float32), y.astype(np.float32), (W, H)) for x, y in maps)
    return replace(warp, maps=made)


def ragged() -> Warp:
    """With a depth of rags where the person is seen, in either picture."""
    depth = np.full((H, W + SHIFT - 8), FAR, np.float32)
    rags = np.random.default_rng(1).choice(np.array([0.02, 0.05, 0.08, 0.1], np.float32), (13, 9))
    depth[PART] = np.kron(rags, np.ones((10, 10)))
    return warped(depth)


def mended(warp: Warp, moved: bool = True, of: tuple[View, View] | None = None) -> Warp:
    pictures = picture(0, moved), picture(1, moved)
    return improved(warp, of or views(), lambda focal: RoughSeam.of(pictures, views(), focal), [untorn])


def test_who_moved_is_shown_whole() -> None:
    before = ragged()
    after = mended(before)
    assert after.refilled is not None and after.refilled[PART].mean() > 0.98
    there = after.refilled[PART][:, 1:] & after.refilled[PART][:, :-1]
    for number in (0, 1):
        jumps = [
            np.abs(np.diff(warp.maps[number].arrays().x[PART], axis=1) - 1)[there] > 0.5 for warp in (before, after)
        ]
        assert jumps[0].mean() > 0.05 and jumps[1].mean() < 0.002, "hardly any map jumps within the person"
        far = ~after.refilled
        assert np.array_equal(after.maps[number].arrays().x[far], before.maps[number].arrays().x[far])


def test_where_the_pictures_agree_nothing_is_refilled() -> None:
    depth = np.full((H, W + SHIFT - 8), FAR, np.float32)
    warp = warped(depth)
    assert mended(warp, moved=False) is warp


def test_nothing_takes_a_depth_that_draws_it_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its map does not jump, so that no seam is seen, but it is no picture of the person any more."""
    smooth = torn_things._refill

    def drawn_out(*args: object) -> object:
        found = smooth(*args)  # type: ignore[arg-type]
        assert found is not None
        away = 2 / FOCAL * 0.95 * np.arange(found.depth.shape[1], dtype=np.float32)
        return replace(found, depth=found.depth + away, weight=found.part.astype(np.float32))

    monkeypatch.setattr(torn_things, "_refill", drawn_out)
    warp = ragged()
    assert mended(warp) is warp


def test_without_a_baseline_there_is_nothing_to_do() -> None:
    warp, (first, second) = ragged(), views()
    still = (first, replace(second, t=np.zeros(3), e_prime=np.zeros(3)))
    assert mended(warp, of=still) is warp
