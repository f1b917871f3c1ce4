"""What a sliding viewpoint sees: both maps on their epipolar lines, each picture as it was taken beyond the slide,
points that stay where they are in space, and near things whole."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import distance_to_line, fundamental_from_pose, rotation_from_vector
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.field.strict import fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import Projection, round_projection
from edf_stitch.core.panorama.slid_warp import slid_warp
from edf_stitch.core.panorama.viewpoint import Viewpoint, viewpoint_between
from edf_stitch.core.panorama.warp import Warp, build_warp
from edf_stitch.core.raster.lazy import whole
from edf_stitch.core.raster.picture_map import PictureMap
from hypothesis import given, settings
from hypothesis import strategies as st

from ...pairs import own_map

SIZE, TARGET, FOCAL = (320, 240), (300, 260), 300.0
FIT_SEEDS = st.integers(0, 2**16)


def rig(by_hand: SimpleNamespace, seed: int, kind: str = "cylindrical") -> tuple[Warp, tuple[View, ...], Viewpoint]:
    """Two cameras side by side before a hilly scene, and the panorama of its strict field."""
    random = np.random.default_rng(seed)
    side = random.choice([-1, 1])
    camera, camera_prime = by_hand.camera(SIZE, FOCAL), by_hand.camera(TARGET, 310.0)
    turn = random.uniform(-4, 4, 3) - [0, side * random.uniform(16, 28), 0]
    view = by_hand.view(camera, camera_prime, tuple(turn), (-side, *random.uniform(-0.2, 0.2, 2)))
    hills, far = random.uniform(0, 0.03), random.uniform(0.03, 0.12)

    def depth(points: np.ndarray) -> np.ndarray:
        return far + hills * np.sin(points[..., 0] / 60) * np.cos(points[..., 1] / 45)

    x = random.uniform((0, 0), np.array(SIZE) - 1, (150, 2))
    y = target_points(view, x, depth(x))
    inside = np.isfinite(y).all(axis=1) & (y > 0).all(axis=1) & (y < np.array(TARGET) - 1).all(axis=1)
    field = fit_strict(view, Matches(x[inside], y[inside]), SIZE, TARGET)
    views = views_of(view, (camera, camera_prime))
    base = build_warp(field, views, on(views, kind, random), hold=True)
    viewpoint = viewpoint_between(base, views)
    assert viewpoint is not None
    return base, views, viewpoint


def on(views: tuple[View, ...], kind: str, random: np.random.Generator) -> Projection:
    return round_projection(kind, views[0].K, rotation_from_vector(random.uniform(-0.1, 0.1, 3)))


def rays_of(warp: Warp) -> np.ndarray:
    assert warp.canvas.projection is not None
    return warp.canvas.projection.rays(np.stack(np.meshgrid(warp.canvas.xs, warp.canvas.ys), axis=-1))


def places(warp: Warp, number: int) -> np.ndarray:
    seen = warp.maps[number].arrays()
    return np.stack([seen.x, seen.y], axis=-1).astype(float)


@given(seed=FIT_SEEDS, s1=st.floats(0, 1), kind=st.sampled_from(["cylindrical", "equirectangular"]))
@settings(max_examples=4, deadline=None)
def test_both_maps_lie_on_their_epipolar_lines(by_hand: SimpleNamespace, seed: int, s1: float, kind: str) -> None:
    base, views, viewpoint = rig(by_hand, seed, kind)
    warp = slid_warp(base, views, viewpoint.sliding(s1), base.canvas.projection)
    x, y = places(warp, 0), places(warp, 1)
    near = (np.abs(x) < 2000).all(axis=-1) & (np.abs(y) < 2000).all(axis=-1)
    assert near.mean() > 0.5
    F = fundamental_from_pose(views[0].K, views[1].K, views[1].R, views[1].t)
    assert distance_to_line(F, x[near], y[near]).max() < 5e-3, "float32"


@given(seed=FIT_SEEDS)
@settings(max_examples=3, deadline=None)
def test_what_a_picture_alone_shows_is_shown_as_it_was_taken(by_hand: SimpleNamespace, seed: int) -> None:
    base, views, viewpoint = rig(by_hand, seed)
    warp = slid_warp(base, views, viewpoint, base.canvas.projection)
    rays, shown = rays_of(warp), [one.inside() for one in warp.maps]
    for number, (view, end) in enumerate(zip(views, (0, 1), strict=True)):
        p = rays @ (view.K @ view.R).T
        turned = p[..., :2] / p[..., 2:]
        alone = shown[number] & ~shown[1 - number]
        there = alone & (np.abs(whole(warp.slide) - end) < 1e-6)
        assert there.sum() > 0.6 * alone.sum() > 1000
        assert np.abs(places(warp, number) - turned)[there].max() < 2e-3


@given(seed=FIT_SEEDS)
@settings(max_examples=2, deadline=None)
def test_a_slide_of_nothing_gives_the_same_maps(by_hand: SimpleNamespace, seed: int) -> None:
    base, views, viewpoint = rig(by_hand, seed)
    warp = slid_warp(base, views, viewpoint.sliding(0.0), base.canvas.projection)
    left, top = (a - b for a, b in zip(base.canvas.offset, warp.canvas.offset, strict=True))
    same = base.within((left, top, warp.canvas.width, warp.canvas.height))
    for number in (0, 1):
        shown = same.maps[number].inside() & warp.maps[number].inside()
        assert shown.sum() > 0.99 * base.maps[number].inside().sum()
        assert np.abs(places(same, number) - places(warp, number))[shown].max() < 0.02
    assert not whole(warp.slide).any() and not warp.behind.any()


def test_without_dense_refinement_there_is_no_confidence(by_hand: SimpleNamespace) -> None:
    base, views, viewpoint = rig(by_hand, 1)
    sure = np.ones((base.canvas.height, base.canvas.width), np.float32)
    refined = replace(base, lazy_confidence=sure, beside=np.dstack([0 * sure, 0 * sure, sure]))
    found = [slid_warp(one, views, viewpoint.sliding(0.5), base.canvas.projection) for one in (base, refined)]
    assert found[0].confidence is None, "where it is 0, visibility takes it that the pictures do not agree"
    assert found[1].confidence is not None and found[1].confidence.max() == 1


WALL, CARD = 6.0, 2.5
LEFT, RIGHT, TOP, BOTTOM = -0.35, 0.25, -0.6, 0.5


def card_before_wall(by_hand: SimpleNamespace) -> tuple[Warp, tuple[View, ...], Viewpoint]:
    """A card 2.5 baselines away before a wall, with their true depth from the reference's place."""
    camera = by_hand.camera(SIZE, FOCAL)
    views = views_of(by_hand.view(camera, camera, (0, -14, 0), (-1.0, 0, 0)), (camera, camera))
    c = np.array([1.0, 0, 0])
    t = -views[1].R @ c
    views = views[0], replace(views[1], t=t, e_prime=views[1].K @ t)
    projection = round_projection("cylindrical", views[0].K, np.eye(3))
    canvas = Canvas(600, 400, (240, 200), projection=projection)
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    card = rays / rays[..., 2:] * CARD
    on_card = (card[..., 0] > LEFT) & (card[..., 0] < RIGHT) & (card[..., 1] > TOP) & (card[..., 1] < BOTTOM)
    d = np.where(on_card, rays[..., 2] / CARD, rays[..., 2] / WALL)
    p = (rays @ views[1].R.T + d[..., None] * t) @ views[1].K.T
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (np.where(p[..., 2] > 1e-6, p[..., k] / p[..., 2], np.nan).astype(np.float32) for k in (0, 1))
    base = Warp(canvas, (own_map(canvas, camera), PictureMap(x, y, SIZE)), d.astype(np.float32))
    viewpoint = viewpoint_between(base, views)
    assert viewpoint is not None
    return base, views, viewpoint


@pytest.mark.parametrize("s1", [0.5, 1.0])
def test_near_things_stay_whole_and_all_points_where_they_are(by_hand: SimpleNamespace, s1: float) -> None:
    base, views, viewpoint = card_before_wall(by_hand)
    warp = slid_warp(base, views, viewpoint.sliding(s1), base.canvas.projection)
    rays, shown = rays_of(warp), warp.maps[0].inside() | warp.maps[1].inside()
    starts = whole(warp.slide)[..., None] * viewpoint.c
    with np.errstate(divide="ignore", invalid="ignore"):
        points = starts + rays / warp.inverse_depth[..., None]
    # what a ray meets from its own place: the card, or the wall
    with np.errstate(divide="ignore", invalid="ignore"):
        at_card = starts + rays * ((CARD - starts[..., 2:]) / rays[..., 2:])
    x, y = at_card[..., 0], at_card[..., 1]
    on_card = (x > LEFT) & (x < RIGHT) & (y > TOP) & (y < BOTTOM)
    rim = cv2.morphologyEx(on_card.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    away = np.abs(points[..., 2] - np.where(on_card, CARD, WALL)) / np.where(on_card, CARD, WALL)
    assert away[on_card & ~rim].max() < 0.01, "no cracks and no specks"
    # what has come out behind the card goes on from beside it
    assert np.percentile(away[shown & ~on_card & ~rim], 99.5) < 0.02 and away[shown & ~on_card & ~rim].max() < 0.15
    # beside the card the reference cannot see the wall that has come out behind it
    with np.errstate(divide="ignore", invalid="ignore"):
        to_place = points * (CARD / points[..., 2:])
    blocked = (to_place[..., 0] > LEFT) & (to_place[..., 0] < RIGHT) & (to_place[..., 1] > TOP)
    blocked &= (to_place[..., 1] < BOTTOM) & ~on_card & ~rim & warp.maps[0].inside()
    assert blocked.sum() > 100
    assert (warp.behind & blocked).sum() > 0.9 * blocked.sum()
    assert (warp.behind & ~blocked & ~rim).sum() < 0.05 * blocked.sum()


def test_the_number_of_threads_changes_nothing(by_hand: SimpleNamespace) -> None:
    base, views, viewpoint = rig(by_hand, 3)
    before, found = cv2.getNumThreads(), []
    try:
        for threads in (1, 3):
            cv2.setNumThreads(threads)
            found.append(slid_warp(base, views, viewpoint.sliding(0.5), base.canvas.projection))
    finally:
        cv2.setNumThreads(before)
    first, second = found
    assert first.canvas.offset == second.canvas.offset
    for one, other in ((first.inverse_depth, second.inverse_depth), (first.behind, second.behind)):
        assert np.array_equal(one, other)
    for number in (0, 1):
        assert np.array_equal(places(first, number), places(second, number), equal_nan=True)
