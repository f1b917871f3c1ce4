"""What is refined from the place of each picture, and how it is seen from the viewpoint."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.dense.sphere.fusing import fused
from edf_stitch.core.dense.sphere.options import CHART
from edf_stitch.core.dense.sphere.place import Place, Viewed
from edf_stitch.core.field.refined_sphere import RefinedSphere
from edf_stitch.core.field.sphere_chart import SphereChart
from edf_stitch.core.field.sphere_field import fit_sphere_field
from edf_stitch.core.field.sphere_points import seen_at

from .card_scenes import CARD, WALL, card_rig, inverse_range, on_card


@pytest.fixture(scope="module")
def rig() -> Rig:
    return card_rig()


@pytest.fixture(scope="module")
def viewed(rig: Rig) -> Viewed:
    return Viewed.of(fit_sphere_field(rig, with_slack=False), rig.views)


@pytest.fixture(scope="module")
def places(rig: Rig, viewed: Viewed) -> list[Place]:
    some = [Place.of(number, rig, viewed) for number in range(len(rig))]
    return [place for place in some if place is not None]


def true_from(centre: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """True inverse range (…) along unit rays (…, 3) from a place."""
    ahead = np.maximum(rays[..., 2], 1e-3)
    to_card, to_wall = (depth - centre[2] for depth in (CARD, WALL))
    hit = on_card(centre[:2] + to_card * rays[..., :2] / ahead[..., None])
    return np.where(rays[..., 2] > 0.05, ahead / np.where(hit, to_card, to_wall), 0.0)


def refined_of(place: Place) -> RefinedSphere:
    """The truth, as if it had been found."""
    d = true_from(place.centre, place.chart.all_rays).astype(np.float32)
    return RefinedSphere(place.chart, d, np.ones_like(d), np.full_like(d, 1e-4), place.inside)


def test_each_ray_belongs_to_the_picture_that_was_taken_nearest_to_it(rig: Rig, viewed: Viewed) -> None:
    # the first stands at the viewpoint itself: whatever it shows is its own
    cells = viewed.chart.smaller(CHART.cell)
    shown = seen_at(rig.views[0], cells.all_rays.reshape(-1, 3), np.zeros(cells.all_rays[..., 0].size))
    inside = ((shown > 5) & (shown < np.array(rig.views[0].size) - 6)).all(axis=-1).reshape(cells.shape)
    assert inside.any() and (viewed.owner[inside] == 0).all()
    assert ((viewed.owner >= 0) == (viewed.count > 0)).all() and (viewed.count > 1).mean() > 0.1


def test_a_moved_view_sees_the_same_points(rig: Rig, places: list[Place]) -> None:
    rays = places[0].chart.all_rays[::40, ::40].reshape(-1, 3)
    rays = rays[rays[:, 2] > 0.5]
    for place in places:
        d = true_from(place.centre, rays)
        seen = place.from_viewpoint(rays, d)
        length = np.linalg.norm(seen, axis=-1)
        for view in rig.views:
            here = seen_at(place.view_from(view), rays, d)
            from_first = seen_at(view, seen / length[:, None], d / length)
            assert np.nanmax(np.abs(here - from_first)) < 1e-6


def test_the_field_is_carried_to_each_place(rig: Rig, viewed: Viewed) -> None:
    rays = viewed.chart.all_rays
    wall = np.maximum(rays[..., 2], 1e-3) / WALL
    for number in range(len(rig)):
        place = Place.of(number, rig, replace(viewed, d=wall.astype(np.float32)))
        if place is None:
            continue
        rays = place.chart.all_rays
        true = rays[..., 2] / (WALL - place.centre[2])
        columns, rows = viewed.chart.places(place.from_viewpoint(rays, true))
        height, width = viewed.chart.shape
        inside = place.inside & (columns > 0) & (rows > 0) & (columns < width - 1) & (rows < height - 1)
        assert inside.any() and np.abs(place.d - true)[inside].max() < 0.005 * true.max()


def test_half_a_place_has_its_points_at_the_same_rays(places: list[Place]) -> None:
    place = places[-1]
    half = place.smaller(2)
    assert half.inside.shape == half.chart.shape == tuple(side // 2 for side in place.chart.shape)
    columns, rows, inverse = half.points
    near = (np.abs(columns - half.chart.shape[1] / 2) < 50) & (np.abs(rows - half.chart.shape[0] / 2) < 50)
    some = np.flatnonzero(near)[:20]
    for n in some:
        ray = half.chart.rays(rows[n : n + 1], columns[n : n + 1])[0, 0]
        again = place.chart.rays(place.points[1][n : n + 1], place.points[0][n : n + 1])[0, 0]
        assert np.allclose(ray, again, atol=1e-9)
    assert some.size and inverse is place.points[2]


def off_from(viewed: Viewed, refined: RefinedSphere) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """px by which inverse range is off, where several pictures show the scene, and where it jumps."""
    true = inverse_range(viewed.chart.all_rays)
    jumps = cv2.dilate(true, np.ones((7, 7))) - cv2.erode(true, np.ones((7, 7))) > 0.02
    several = np.repeat(np.repeat(viewed.count > 1, CHART.cell, axis=0), CHART.cell, axis=1)
    return np.abs(refined.inverse_range - true) * viewed.chart.per_radian, several, jumps


def test_what_is_known_from_each_place_is_seen_from_the_viewpoint(viewed: Viewed, places: list[Place]) -> None:
    assert len(places) > 1
    whole = fused(viewed, places, [refined_of(place) for place in places], np.ones_like(viewed.d))
    off, several, jumps = off_from(viewed, whole)
    assert np.percentile(off[several & ~jumps], 99) < 0.05
    assert (off[several & jumps] < 1).mean() > 0.8
    middle = cv2.erode(several.astype(np.uint8), np.ones((41, 41))) > 0
    assert whole.confidence[middle].min() > 0.9 and whole.deviation[middle].max() < 1e-3
    assert (whole.inverse_range[~several] >= 0).all() and (whole.deviation[~whole.shown] == 1).all()


def test_a_gap_is_filled_from_another_place(viewed: Viewed, places: list[Place]) -> None:
    assert places[0].number == 0
    good = [refined_of(place) for place in places]
    gap = good[0].shown.copy()
    rows, columns = (slice(side // 2 - 10, side // 2 + 10) for side in gap.shape)
    gap[rows, columns] = False
    off, several, jumps = off_from(
        viewed, fused(viewed, places, [replace(good[0], shown=gap), *good[1:]], np.ones_like(viewed.d))
    )  # fmt: skip
    assert np.percentile(off[several & ~jumps], 99) < 0.1


def test_a_picture_that_shows_nothing_best_has_no_place(rig: Rig, viewed: Viewed) -> None:
    assert Place.of(1, rig, replace(viewed, owner=np.zeros_like(viewed.owner))) is None
    assert isinstance(viewed.chart, SphereChart)
