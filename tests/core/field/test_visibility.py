"""What the target cannot see is found, to a pixel; what it can see is never called hidden."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import undistort
from edf_stitch.core.cameras.projective import homogeneous, infinite_homography
from edf_stitch.core.cameras.view import View
from edf_stitch.core.field import folding, visibility
from edf_stitch.core.field.folding import turned_over, turning
from edf_stitch.core.field.options import VISIBILITY
from edf_stitch.core.field.visibility import _folded_blocks, by_agreement, occluded
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.reference_map import ReferenceMap
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.lazy import whole
from edf_stitch.core.raster.picture_map import PictureMap
from hypothesis import given, settings
from hypothesis import strategies as st

from ...pairs import with_map
from ..point_scenes import turned_by, unit

OFFSET = (40, 25)
SHAPE = (230, 360)  # of the canvas, larger than the target
TARGET = (300, 200)
K = np.array([[280.0, 0, 150], [0, 280, 100], [0, 0, 1]])


@dataclass
class Cards:
    """Cards parallel to the reference's picture before a wall at depth 10: (left, top, right, bottom, depth) each, in
    the reference camera's frame, baselines as unit."""

    cards: tuple[tuple[float, float, float, float, float], ...]
    R: np.ndarray
    t: np.ndarray
    zoom: float = 1.0

    @property
    def K_prime(self) -> np.ndarray:
        return np.diag([self.zoom, self.zoom, 1.0]) @ K

    @property
    def views(self) -> tuple[View, View]:
        cameras = (Camera(K, TARGET, "test", 0.0), Camera(self.K_prime, self.target_size, "test", 0.0))
        H_inf = infinite_homography(K, self.K_prime, self.R)
        return (View(cameras[0], K, np.eye(3), np.zeros(3), np.eye(3), np.zeros(3)),
                View(cameras[1], self.K_prime, self.R, self.t, H_inf, self.K_prime @ self.t))  # fmt: skip

    @property
    def target_size(self) -> tuple[int, int]:
        return round(TARGET[0] * self.zoom), round(TARGET[1] * self.zoom)

    def seen_along(self, place: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Distance along rays (…, 3) from a place to what is seen first, in lengths of the rays."""
        nearest = (10.0 - place[2]) / rays[..., 2]
        for left, top, right, bottom, depth in self.cards:
            along = (depth - place[2]) / rays[..., 2]
            x, y = place[0] + along * rays[..., 0], place[1] + along * rays[..., 1]
            hit = (x >= left) & (x <= right) & (y >= top) & (y <= bottom) & (along > 0)
            nearest = np.where(hit, np.minimum(nearest, along), nearest)
        return nearest

    def warp(self, depth: np.ndarray) -> Warp:
        d = 1 / depth
        reference, target = self.views
        x = homogeneous(points()) @ target.H_inf.T + d[..., None] * target.e_prime
        x[x[..., 2] <= 0] = np.nan
        canvas = Canvas(SHAPE[1], SHAPE[0], OFFSET)
        x, y = ((x[..., k] / x[..., 2]).astype(np.float32) for k in range(2))
        maps = ReferenceMap(canvas, reference.camera), PictureMap(x, y, target.size)
        return Warp(canvas, maps, d.astype(np.float32))

    def occluded(self, warp: Warp) -> np.ndarray:
        return occluded(warp.maps[1].arrays(), warp.nearness(self.views, 1))

    def truth(self) -> tuple[Warp, np.ndarray]:
        """The true warp, and what is really hidden from the target by cards that the canvas shows."""
        rays = homogeneous(points()) @ np.linalg.inv(K).T
        depth = self.seen_along(np.zeros(3), rays)
        world = rays * depth[..., None]
        place = -self.R.T @ self.t
        warp = self.warp(depth)
        return warp, warp.maps[1].inside() & (self.seen_along(place, world - place) < 1 - 1e-6)


def points() -> np.ndarray:
    x, y = np.meshgrid(np.arange(SHAPE[1]) - OFFSET[0], np.arange(SHAPE[0]) - OFFSET[1])
    return np.stack([x, y], axis=-1).astype(float)


CARDS = ((-1.2, -0.8, 0.0, 0.9, 4.0), (-0.1, -0.5, 0.6, 0.4, 3.0))
SIDEWAYS = Cards(CARDS, turned_by(0, -3, 1), unit(-1, 0.1, 0.05))


@pytest.mark.parametrize("cards", [
    SIDEWAYS,
    replace(SIDEWAYS, t=unit(1, 0.2, -0.3), R=turned_by(1, 4, -2)),
    replace(SIDEWAYS, t=unit(0.2, 0.1, -1.0), R=np.eye(3)),  # a step forward: the epipole lies in the picture
    replace(SIDEWAYS, R=turned_by(0, -3, 33)),  # a camera held aslant
    replace(SIDEWAYS, zoom=2.9),  # target pixels between the canvas's samples
    replace(SIDEWAYS, zoom=0.4),  # many canvas pixels on each target pixel
], ids=["sideways", "other side", "forward", "aslant", "target finer", "target coarser"])  # fmt: skip
def test_finds_what_cards_hide(cards: Cards) -> None:
    warp, hidden = cards.truth()
    found = cards.occluded(warp)
    assert found.dtype == bool and found.shape == SHAPE
    assert hidden.mean() > 0.005, "else there is nothing to find"
    right = (found & hidden).sum()
    assert right >= 0.8 * found.sum(), "precision"
    assert right >= 0.8 * hidden.sum(), "recall"


def test_the_nearest_to_the_target_owns_the_pixel_not_the_nearest_to_the_reference() -> None:
    """x'₃ / d is the depth in front of the target camera, in baselines."""
    warp, hidden = SIDEWAYS.truth()
    near = whole(warp.nearness(SIDEWAYS.views, 1))
    world = homogeneous(points()) @ np.linalg.inv(K).T / warp.inverse_depth[..., None]
    there = (world @ SIDEWAYS.R.T + SIDEWAYS.t)[..., 2]
    assert np.allclose(near, 1 / there, rtol=1e-4)


def test_depth_in_front_of_the_target_is_that_of_the_undistorted_point() -> None:
    warp, _ = SIDEWAYS.truth()
    lens = Camera(K, (TARGET[0], TARGET[1]), "test", 0.0, np.array([-0.2, 0, 0, 0, 0]))
    reference, target = SIDEWAYS.views
    near = whole(warp.nearness((replace(reference, camera=lens), target), 1))
    world = homogeneous(undistort(points(), lens)) @ np.linalg.inv(K).T / warp.inverse_depth[..., None]
    there = (world @ SIDEWAYS.R.T + SIDEWAYS.t)[..., 2]
    assert np.allclose(near, 1 / there, rtol=1e-4)
    assert np.abs(near / whole(warp.nearness(SIDEWAYS.views, 1)) - 1).max() > 1e-3, "the lens matters here"


@settings(max_examples=20)
@given(
    st.floats(-60, 60), st.floats(-60, 60), st.floats(1.5, 20), st.floats(0.3, 3), st.integers(0, 2**16),
)  # fmt: skip
def test_a_plane_hides_nothing_of_itself(yaw: float, pitch: float, depth: float, zoom: float, seed: int) -> None:
    """However obliquely either camera sees it, and at any magnification."""
    random = np.random.default_rng(seed)
    normal = turned_by(pitch, yaw, 0)[:, 2]
    d = (homogeneous(points()) @ np.linalg.inv(K).T) @ normal / (depth * normal[2])
    cards = Cards((), turned_by(*random.uniform(-15, 15, 3)), unit(*random.normal(size=3)), zoom)
    with np.errstate(divide="ignore"):
        warp = cards.warp(1 / d)
    assert not cards.occluded(warp).any()


def test_a_smooth_hill_without_folds_hides_nothing() -> None:
    x, y = np.moveaxis(points(), -1, 0)
    d = 0.12 + 0.05 * np.sin(x / 25) * np.cos(y / 30)
    warp = SIDEWAYS.warp(1 / d)
    assert (np.diff(warp.maps[1].x, axis=1) > 0).all()
    assert not SIDEWAYS.occluded(warp).any()
    steep = SIDEWAYS.warp(1 / (0.4 + 0.38 * np.sin(x / 25) * np.cos(y / 30)))
    assert (np.diff(steep.maps[1].x, axis=1) < 0).any()
    assert SIDEWAYS.occluded(steep).any(), "where the map folds, something is hidden"


@pytest.mark.parametrize("t", [(-1, 0.1, 0.05), (1, 0.2, -0.3), (0.2, 0.1, -1.0)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_where_the_map_folds_is_all_that_has_to_be_looked_at(
    t: tuple[float, ...], mirrored: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = replace(SIDEWAYS, t=unit(*t))
    warp, _ = scene.truth()
    if mirrored:
        warp = with_map(warp, scene.target_size[0] - 1 - warp.maps[1].x)
    in_pieces = replace(visibility.VISIBILITY, strip_pixels=5000)
    monkeypatch.setattr(visibility, "VISIBILITY", in_pieces)
    seen = visibility._folded_blocks(warp.maps[1])
    assert seen.any()
    found = scene.occluded(warp)
    monkeypatch.setattr(visibility, "_folded_blocks", lambda *_: np.ones_like(seen))
    assert found.any() and (found == scene.occluded(warp)).all()


def test_infinity_and_beyond_are_one_depth() -> None:
    warp, _ = SIDEWAYS.truth()
    d = warp.inverse_depth - 0.3  # the wall and most of the cards behind infinity
    far = replace(warp, depth=np.minimum(d, 0).astype(np.float32))
    assert not SIDEWAYS.occluded(far).any()
    assert (whole(far.nearness(SIDEWAYS.views, 1)) == 0).all()


def test_without_depth_nothing_is_hidden() -> None:
    warp, _ = SIDEWAYS.truth()
    unknown = replace(warp, depth=np.full(SHAPE, np.nan, np.float32))
    assert not SIDEWAYS.occluded(unknown).any()
    same_place = replace(SIDEWAYS, t=np.zeros(3))
    assert not same_place.occluded(replace(warp, depth=np.zeros(SHAPE, np.float32))).any()


def test_only_what_falls_into_the_target_counts() -> None:
    warp, _ = SIDEWAYS.truth()
    x = warp.maps[1].x.copy()
    x[:, :150] = np.nan
    found = SIDEWAYS.occluded(with_map(warp, x))
    assert not found[:, :150].any() and not (found & ~warp.maps[1].inside()).any()


# --- what turns over ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("strip", [10**6, 700])  # in one piece, and in strips of two rows
@pytest.mark.parametrize("mirrored", [False, True])
def test_what_turns_over_is_found_and_nothing_else(
    monkeypatch: pytest.MonkeyPatch, strip: int, mirrored: bool
) -> None:
    monkeypatch.setattr(folding, "FOLDING", replace(folding.FOLDING, strip_pixels=strip))
    y, x = np.mgrid[0:60, 0:350].astype(np.float32)
    x[20:31, 100:120] = 219 - x[20:31, 100:120]
    found = turned_over(turning(PictureMap(349 - x if mirrored else x, y, (350, 60))))
    assert found[20:30, 100:119].all() and not found[:18].any() and not found[33:].any()
    assert found.sum() < 20 * 22
    outside = PictureMap(x * 0 - 9, y, (350, 60))
    assert not turned_over(turning(outside)).any(), "outside the target"


# --- put right by what both pictures agree on -----------------------------------------------------------------------


def agreement() -> tuple[Warp, np.ndarray, np.ndarray, np.ndarray]:
    """A warp, what its depth order hides, what really is hidden, and confidence: none where it is, full elsewhere."""
    warp, hidden = SIDEWAYS.truth()
    told = np.roll(hidden, 1, axis=1) & warp.maps[1].inside()
    return warp, told, hidden, np.where(hidden, np.float32(0), np.float32(1))


def test_rims_follow_what_both_pictures_agree_on() -> None:
    warp, told, hidden, sure = agreement()
    everywhere = np.ones(SHAPE, bool)
    assert (told != hidden).sum() > 50
    right = by_agreement(told, warp.maps[1], sure, everywhere)
    assert np.array_equal(right, hidden)
    assert np.array_equal(told, agreement()[1]), "what was given stays as it is"


def test_without_dense_refinement_the_depth_order_has_the_last_word() -> None:
    warp, told, _, _ = agreement()
    assert np.array_equal(by_agreement(told, warp.maps[1], None, np.ones(SHAPE, bool)), told)


def test_nothing_lies_beside_a_speck() -> None:
    """Noise on a bare wall turns a few pixels over: they stay what they are."""
    warp, _, _, _ = agreement()
    speck = np.zeros(SHAPE, bool)
    speck[SHAPE[0] // 2, SHAPE[1] // 2 : SHAPE[1] // 2 + 3] = True
    unsure, everywhere = np.zeros(SHAPE, np.float32), np.ones(SHAPE, bool)
    assert warp.maps[1].inside()[speck].all()
    assert np.array_equal(by_agreement(speck, warp.maps[1], unsure, everywhere), speck)


def test_doubt_alone_hides_nothing() -> None:
    """A bare wall is agreed on nowhere: it is hidden only close by what the depth order hides, and where the reference
    shows it."""
    warp, told, hidden, _ = agreement()
    unsure, everywhere = np.zeros(SHAPE, np.float32), np.ones(SHAPE, bool)
    out = by_agreement(told, warp.maps[1], unsure, everywhere)
    reach = round(VISIBILITY.max_growth * max(TARGET))
    near = cv2.dilate(told.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0
    assert (out & ~told).any() and not (out & ~near).any() and not (out & ~warp.maps[1].inside()).any()
    assert np.array_equal(by_agreement(told, warp.maps[1], unsure, ~everywhere), told), "beyond the reference: nothing"
    nothing = np.zeros(SHAPE, bool)
    assert not by_agreement(nothing, warp.maps[1], unsure, everywhere).any()


def test_a_wall_at_infinity_is_hidden_by_what_stands_before_it() -> None:
    """Points that are infinitely far off own nothing, and are hidden all the same."""
    warp, hidden = SIDEWAYS.truth()
    d = whole(warp.depth)
    wall = np.isclose(d, 0.1)
    far = SIDEWAYS.warp(1 / np.where(wall, 1e-9, d))
    found = SIDEWAYS.occluded(far)
    assert found.sum() > 0.8 * hidden.sum() and wall[found].mean() > 0.5


# --- which part of the target folds fall on -------------------------------------------------------------------------


def folded_by_hand(picture_map: PictureMap, mirrored: bool) -> np.ndarray:
    """Cell by cell: both triangles of each, and the blocks that its corners' bounding box touches, grown by one."""
    blocks = np.zeros((picture_map.size[1] // 16 + 1, picture_map.size[0] // 16 + 1), np.uint8)
    at = np.stack([picture_map.x, picture_map.y], axis=-1).astype(float)
    sign, last = -1 if mirrored else 1, np.array(picture_map.size) - 1

    def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        (x, y), (u, v) = b - a, c - a
        return sign * (x * v - y * u)

    for i in range(at.shape[0] - 1):
        for j in range(at.shape[1] - 1):
            corners = at[i, j], at[i, j + 1], at[i + 1, j], at[i + 1, j + 1]
            if turn(*corners[:3]) <= 0 or turn(corners[3], corners[2], corners[1]) <= 0:
                low, high = np.nanmin(corners, axis=0), np.nanmax(corners, axis=0)
                if (high >= 0).all() and (low <= last).all():
                    (x0, y0), (x1, y1) = ((np.clip(end, 0, last) + 0.5).astype(int) // 16 for end in (low, high))
                    blocks[y0 : y1 + 1, x0 : x1 + 1] = 1
    return cv2.dilate(blocks, np.ones((3, 3), np.uint8)) > 0


@pytest.mark.parametrize("strip", [10**6, 60])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_folds_fall_on_the_blocks_that_their_cells_touch(
    monkeypatch: pytest.MonkeyPatch, seed: int, mirrored: bool, strip: int
) -> None:
    monkeypatch.setattr(visibility, "VISIBILITY", replace(visibility.VISIBILITY, strip_pixels=strip))
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:30, 0:40] * 9.0 - 12 + random.normal(0, 1.7, (2, 30, 40))
    x[3, 5] = y[3, 5] = np.nan
    x, y = ((320 - x if mirrored else x).astype(np.float32), y.astype(np.float32))
    picture_map = PictureMap(x, y, (321, 230))
    found = _folded_blocks(picture_map)
    assert np.array_equal(found[:15, :21], folded_by_hand(picture_map, mirrored)[:15, :21])
    assert 0.02 < found.mean() < 0.6


@pytest.mark.parametrize("fold, counts", [
    ((-9.0, 5, 0, 9), True), ((-9.0, 5, -0.5, 9), False), ((99.0, 5, 120, 9), True), ((99.5, 5, 120, 9), False),
    ((5, -9.0, 9, 0), True), ((5, -9.0, 9, -0.5), False), ((5, 79.0, 9, 90), True), ((5, 79.5, 9, 90), False),
])  # fmt: skip
def test_a_fold_that_touches_the_last_line_of_the_target_counts(fold: tuple, counts: bool) -> None:
    """left, top, right, bottom of a cell that a map flattens, between others that it does not."""
    left, top, right, bottom = fold
    x, y = np.array([[left, right], [left, right]], np.float32), np.array([[top, top], [bottom, bottom]], np.float32)
    x[1, 1], y[1, 1] = left, top
    assert _folded_blocks(PictureMap(x, y, (100, 80))).any() == counts
