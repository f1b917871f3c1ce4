"""What a picture's border cuts is whole in the panorama or not there, whichever picture cuts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.view import View
from edf_stitch.core.compose.composition import Composition, composed
from edf_stitch.core.compose.seams import cut_things
from edf_stitch.core.compose.seams.cut_things import WAYS
from edf_stitch.core.compose.seams.min_cut import FIRST, SECOND
from edf_stitch.core.compose.seams.refills import improved
from edf_stitch.core.compose.seams.rough_seam import RoughSeam
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.panorama.other_depth import seen_at
from edf_stitch.core.panorama.viewpoint import Viewpoint
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.raster.colour import encode
from edf_stitch.core.raster.picture_map import PictureMap

W, H, SHIFT, FOCAL = 440, 300, 200, 400.0
FAR, NEAR = 0.02, 0.3
# Rows and columns, from the place of the picture that cuts it, of a thing that goes on to column 490; and the part of
# it that the picture shows. The other sees it 120 px further right, so that at the wall's depth it lies 112 px there.
THING, CUT = (slice(110, 170), slice(390, 490)), np.s_[110:170, 390:440]
ELSEWHERE = np.s_[112:168, 504:600]


def wall(u: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Tones of the wall by columns and rows, 0 to 1."""
    return np.asarray(0.55 + 0.15 * np.sin(u / 9) * np.cos(y / 7) + 0.1 * np.sin(u / 31 + y / 23))


class World:
    """A dark thing before a wall. `by`: the number of the picture whose right border cuts it, and from whose place the
    panorama is seen; size: how many times as large all of it is."""

    def __init__(self, by: int, size: int = 1) -> None:
        self.by, self.size = by, size
        self.pictures = tuple(self._picture(number) for number in (0, 1))
        self.views = tuple(self._view(number) for number in (0, 1))

    def starts(self, number: int) -> int:
        """The column of the panorama at which a picture starts, for what is infinitely far away."""
        return 0 if number == self.by else self.size * SHIFT

    def _view(self, number: int) -> View:
        size, focal = (self.size * W, self.size * H), self.size * FOCAL
        K, K_0 = (
            np.array([[focal, 0, -self.starts(k)], [0, focal, 0], [0, 0, 1]], float) for k in (number, 0)
        )  # fmt: skip
        # what is near lies further right in the picture that does not cut it
        t = number * np.array([1.0 if self.by == 0 else -1.0, 0, 0])
        return View(Camera(K, size, "given", 0.0), K, np.eye(3), t, K @ np.linalg.inv(K_0), K @ t)

    def _picture(self, number: int) -> Picture:
        n = self.size
        y, x = np.mgrid[: n * H, : n * W] / n
        u = x + self.starts(number) / n
        behind, before = ((u, u) if number == self.by else (u - FOCAL * d for d in (FAR, NEAR)))
        (top, bottom), (left, right) = ((part.start, part.stop) for part in THING)
        thing = (y >= top) & (y < bottom) & (before >= left) & (before < right)
        light = np.where(thing, 0.12 + 0.02 * np.sin(before), wall(behind, y))
        return picture_from_array(np.repeat((255 * light).astype(np.uint8)[..., None], 3, axis=2))

    def warp(self) -> Warp:
        """With a depth of rags where the thing is cut, and that of the wall around it."""
        n = self.size
        depth = np.full((n * H, n * (W + SHIFT - 8)), FAR, np.float32)
        rags = np.full((12, 10), 0.1, np.float32)
        rags[1:-1, 1:] = np.random.default_rng(4).choice(np.array([0.08, 0.1, 0.15, 0.2], np.float32), (10, 9))
        depth[tuple(slice(n * part.start, n * part.stop) for part in CUT)] = np.kron(rags, np.ones((5 * n, 5 * n)))
        canvas = Canvas(depth.shape[1], depth.shape[0], (self.starts(0), 0))
        slide = np.ones(depth.shape, np.float32) if self.by else None
        viewpoint = Viewpoint(1.0, -self.views[1].t, np.eye(3), np.array([1.0, 0]), (-9.0, -8.0)) if self.by else None
        empty = tuple(PictureMap(depth, depth, view.size) for view in self.views)
        warp = Warp(canvas, empty, depth, None, slide, None, viewpoint)
        everywhere = slice(0, depth.shape[0]), slice(0, depth.shape[1])
        maps = []
        for number, view in enumerate(self.views):
            x, y = seen_at(warp, self.views, number, everywhere, depth)
            maps.append(PictureMap(x.astype(np.float32), y.astype(np.float32), view.size))
        return replace(warp, maps=tuple(maps))

    def without_cut_things(self, warp: Warp, views: Sequence[View] | None = None) -> Warp:
        of = self.views if views is None else views
        return improved(warp, of, lambda focal: RoughSeam.of(self.pictures, of, focal), WAYS)

    def composed(self, warp: Warp, painted: np.ndarray | None = None) -> Composition:
        layers = [layer_of(picture, one) for picture, one in zip(self.pictures, warp.maps, strict=True)]
        options = StitchOptions(exposure="none", holes="transparent")
        return composed(layers, warp, self.views, options, [False, False], painted, lambda stage, share: None)

    def off(self, made: Composition) -> float:
        """By how much, at most and on average over 9 x 9 px, the panorama differs from the wall where the thing is cut.
        """
        y, u = np.mgrid[: H * self.size, : made.panorama.alpha.shape[1]] / self.size
        away = np.abs(encode(made.panorama.pixels.mean(axis=-1), 8) / 255 - wall(u, y)).astype(np.float32)
        return float(cv2.blur(away, (9, 9))[self.at(CUT)].max())

    def dark(self, made: Composition, part: tuple[slice, slice]) -> float:
        """The share of a part of the panorama that shows the thing."""
        return float((made.panorama.pixels[self.at(part)].mean(axis=-1) < 0.04).mean())

    def at(self, part: tuple[slice, slice]) -> tuple[slice, slice]:
        return tuple(slice(self.size * one.start, self.size * one.stop) for one in part)  # type: ignore[return-value]


@pytest.mark.parametrize(("by", "size"), [(0, 1), (1, 1), (0, 2), (1, 2)])
def test_what_a_border_cuts_gives_way_to_what_is_behind_it(by: int, size: int) -> None:
    world = World(by, size)
    before = world.warp()
    assert world.off(world.composed(before)) > 0.12, "or the test tells nothing"
    after = world.without_cut_things(before)
    assert after.refilled is not None
    inside = world.at(np.s_[112:168, 394:438])
    assert after.refilled[inside].all() and np.allclose(after.inverse_depth[inside], FAR, rtol=0.1)
    made = world.composed(after)
    assert world.off(made) < 0.08 and world.dark(made, CUT) == 0, "gone here"
    assert world.dark(made, ELSEWHERE) > 0.97, "and whole there"
    assert made.panorama.alpha[world.at(np.s_[100:180, 370:620])].all(), "and nothing is hidden behind it any more"
    far = ~after.refilled
    for number in (0, 1):
        assert np.array_equal(after.maps[number].arrays().x[far], before.maps[number].arrays().x[far])


@pytest.mark.parametrize("by", [0, 1])
def test_an_artists_mask_wins(by: int) -> None:
    world = World(by)
    after = world.without_cut_things(world.warp())
    painted = np.zeros(after.inverse_depth.shape, np.int8)
    painted[CUT] = SECOND if by else FIRST
    assert world.dark(world.composed(after, painted), CUT) == 1


def test_what_is_shown_well_stays() -> None:
    """A depth that is right, and a thing that both pictures show whole."""
    world = World(0)
    warp = world.warp()
    flat = replace(warp, depth=np.full_like(warp.inverse_depth, FAR))
    assert world.without_cut_things(flat) is flat


def test_nothing_is_refilled_that_would_be_seen_more(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(0)
    warp = world.warp()
    worse = cut_things._refill

    def ragged(*args: object) -> object:
        found = worse(*args)  # type: ignore[arg-type]
        assert found is not None
        rags = np.random.default_rng(0).choice(np.array([0.1, 0.2], np.float32), found.depth.shape)
        return replace(found, depth=rags)

    monkeypatch.setattr(cut_things, "_refill", ragged)
    assert world.without_cut_things(warp) is warp


def test_without_a_baseline_there_is_nothing_to_do() -> None:
    world = World(0)
    warp, (first, second) = world.warp(), world.views
    still = (first, replace(second, t=np.zeros(3), e_prime=np.zeros(3)))
    assert world.without_cut_things(warp, still) is warp


def test_what_was_refilled_is_free_to_the_seam() -> None:
    world = World(0)
    warp = world.warp()
    everywhere = np.ones(warp.inverse_depth.shape, bool)
    assert world.composed(warp).decided[1].hidden.any()
    assert not world.composed(replace(warp, refilled=everywhere)).decided[1].hidden.any()
