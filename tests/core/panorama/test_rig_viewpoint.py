"""A viewpoint that slides among N places: where it is, that points stay points, and how far it is chosen to go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import inverse_intrinsics, skew
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.field.sphere_field import SphereField, fit_sphere_field
from edf_stitch.core.panorama.choosing_slide import choose_rig_slide
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.rig_viewpoint import CarriedDepth, RigViewpoint, rig_viewpoint
from edf_stitch.core.panorama.rig_warp import RigSurface, build_rig_warp
from edf_stitch.core.panorama.upright_edges import StraightEdges
from edf_stitch.core.raster.lazy import whole
from hypothesis import given, settings
from hypothesis import strategies as st

from ..field.sphere_scenes import rig_of, unit_rays

# a walk to the right along a wall: each picture looks a little further to the right, from 0.4 further on
YAWS = (0, 25, 50, 75)


def wall(rays: np.ndarray) -> np.ndarray:
    """Inverse range of a cylinder about a place behind the first, nearer to the right."""
    return np.maximum(0.12 + 0.05 * rays[..., 0] + 0.02 * rays[..., 1], 0.02)


def walk(seed: int = 0) -> Rig:
    rig = rig_of(YAWS, seed, wall, points=6000)
    return rig


@pytest.fixture(scope="module")
def rig() -> Rig:
    return walk()


@pytest.fixture(scope="module")
def field(rig: Rig) -> SphereField:
    return fit_sphere_field(rig, with_slack=False)


def viewpoint_of(rig: Rig, field: SphereField) -> RigViewpoint:
    return rig_viewpoint(rig.views, RigSurface.of(field, rig.views).outlines, np.eye(3))


@pytest.fixture(scope="module")
def viewpoint(rig: Rig, field: SphereField) -> RigViewpoint:
    return viewpoint_of(rig, field)


def ray_at(degrees: float) -> np.ndarray:
    return np.array([np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))])


def test_where_one_picture_is_alone_it_is_seen_from_its_own_place(rig: Rig, viewpoint: RigViewpoint) -> None:
    """Pictures are 60 degrees wide: the first is alone to the left of −5°, the last to the right of 80°."""
    assert viewpoint.place(ray_at(-18)) == pytest.approx(rig.centres[0], abs=0.03)
    assert viewpoint.place(ray_at(98)) == pytest.approx(rig.centres[3], abs=0.03)
    # and beyond all pictures from that of the nearest
    assert viewpoint.place(ray_at(-60)) == pytest.approx(rig.centres[0], abs=0.03)
    assert viewpoint.place(ray_at(140)) == pytest.approx(rig.centres[3], abs=0.03)


@settings(max_examples=40)
@given(st.floats(-180, 180), st.floats(-80, 80), st.floats(0, 1))
def test_places_depend_on_the_heading_alone_and_go_with_the_slide(heading: float, elevation: float, s1: float) -> None:
    random = np.random.default_rng(1)
    viewpoint = RigViewpoint(1.0, np.eye(3), np.cumsum(random.normal(size=(1440, 3)), axis=0) / 100)
    level = ray_at(heading)
    up = np.radians(elevation)
    raised = np.array([level[0] * np.cos(up), np.sin(up), level[2] * np.cos(up)])
    assert viewpoint.place(7 * raised) == pytest.approx(viewpoint.place(level), abs=1e-9)
    assert viewpoint.sliding(s1).place(raised) == pytest.approx(s1 * viewpoint.place(raised), abs=1e-9)


def test_places_change_smoothly_all_around(viewpoint: RigViewpoint) -> None:
    """Also straight behind, where one picture is the nearest no longer; half degrees."""
    places = viewpoint.place(np.stack([ray_at(degrees) for degrees in np.arange(-181, 181, 0.5)]))
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert 0.01 < steps.max() < 0.1
    assert np.abs(np.diff(steps)).max() < 0.02


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_points_and_rays_find_each_other(field: SphereField, viewpoint: RigViewpoint, seed: int) -> None:
    """q / d = C(u) + u / d_u."""
    viewpoint = viewpoint.sliding(0.8)
    rays = unit_rays(seed, 100, 0.5)
    d = field.at(rays)
    seen, inverse = viewpoint.seen_from(rays, d)
    assert viewpoint.place(seen) + seen / inverse[:, None] == pytest.approx(rays / d[:, None], rel=1e-3, abs=1e-2)


def test_a_rays_depth_ends_on_the_surface(rig: Rig, field: SphereField, viewpoint: RigViewpoint) -> None:
    carried = CarriedDepth.of(field, rig.views, viewpoint)
    rays = np.stack([ray_at(degrees) for degrees in np.linspace(-25, 100, 60)])
    d, moved = carried.at(rays)
    assert moved == pytest.approx(d[:, None] * viewpoint.place(rays))
    point = viewpoint.place(rays) + rays / d[:, None]
    length = np.linalg.norm(point, axis=1)
    assert field.at(point / length[:, None]) == pytest.approx(1 / length, rel=5e-3)


def test_a_slid_warp_shows_one_point_in_all_pictures(rig: Rig, field: SphereField, viewpoint: RigViewpoint) -> None:
    """So that pixels lie on their epipolar lines; and each point lies where the warp says."""
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 140.0)
    warp = build_rig_warp(RigSurface.of(field, rig.views).seen_from(viewpoint), projection)
    assert warp.viewpoint is viewpoint
    canvas, maps = warp.canvas, [one.arrays() for one in warp.maps]
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    d = whole(warp.depth)[..., None]
    for view, one in zip(rig.views, maps, strict=True):
        q = ((rays + d * viewpoint.place(rays)) @ view.R.T + d * view.t) @ view.K.T
        shown = one.inside()
        assert shown.sum() > 4000
        assert one.x[shown] == pytest.approx((q[..., 0] / q[..., 2])[shown], abs=0.05)
    shared = 0
    for i in range(4):
        for j in range(i + 1, 4):
            both = maps[i].inside() & maps[j].inside()
            if not both.any():
                continue
            shared += int(both.sum())
            x, y = (np.column_stack([m.x[both], m.y[both], np.ones(both.sum())]) for m in (maps[i], maps[j]))
            R = rig.R[j] @ rig.R[i].T
            to_ray = inverse_intrinsics(rig.views[i].K), inverse_intrinsics(rig.views[j].K)
            line = x @ (to_ray[1].T @ skew(rig.t[j] - R @ rig.t[i]) @ R @ to_ray[0]).T
            off = np.abs((y * line).sum(axis=1)) / np.maximum(np.hypot(line[:, 0], line[:, 1]), 1e-12)
            assert np.percentile(off, 99.5) < 2e-3
    assert shared > 4000


def test_nearness_is_counted_from_where_a_pixel_is_seen(
    rig: Rig, field: SphereField, viewpoint: RigViewpoint
) -> None:
    """Baselines per distance along a picture's axis: of the point C + r / d, as that picture sees it."""
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 80.0)
    warp = build_rig_warp(RigSurface.of(field, rig.views).seen_from(viewpoint), projection)
    canvas, d = warp.canvas, whole(warp.depth).astype(float)
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    for number in (0, 3):
        view = rig.views[number]
        point = (viewpoint.place(rays) + rays / d[..., None]) @ view.R[2] + view.t[2]
        ahead = point > 0.5
        assert ahead.mean() > 0.3
        assert whole(warp.nearness(rig.views, number))[ahead] == pytest.approx(1 / point[ahead], rel=1e-3)


def test_what_one_picture_shows_alone_is_shown_as_it_was_taken(
    rig: Rig, field: SphereField, viewpoint: RigViewpoint
) -> None:
    """Only turned: where s1 = 1, wrong depth bends nothing of it."""
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 140.0)
    wrong = replace(field.depth, bounds=(0.3, 0.31))
    warp = build_rig_warp(RigSurface.of(replace(field, depth=wrong), rig.views).seen_from(viewpoint), projection)
    canvas = warp.canvas
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    last, own = rig.views[3], warp.maps[3].arrays()
    alone = own.inside() & (np.degrees(np.arctan2(rays[..., 0], rays[..., 2])) > 96)
    assert alone.sum() > 300
    q = rays @ (last.K @ last.R).T
    off = np.hypot(own.x - q[..., 0] / q[..., 2], own.y - q[..., 1] / q[..., 2])[alone]
    assert off.max() < 3
    still = build_rig_warp(RigSurface.of(replace(field, depth=wrong), rig.views), projection).maps[3].arrays()
    assert still.inside().any()


def test_no_slide_is_the_place_of_the_first(rig: Rig, field: SphereField, viewpoint: RigViewpoint) -> None:
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 100.0)
    still = build_rig_warp(RigSurface.of(field, rig.views), projection)
    same = build_rig_warp(RigSurface.of(field, rig.views).seen_from(viewpoint.sliding(0.0)), projection)
    assert same.viewpoint is None
    for one, other in zip(still.maps, same.maps, strict=True):
        assert np.array_equal(one.arrays().x, other.arrays().x, equal_nan=True)


def test_a_thing_before_which_the_viewpoint_passes_is_shown_twice() -> None:
    """The place jumps to the right between two headings: what is near is seen from both sides of it."""
    places = np.zeros((1440, 3))
    places[720:, 0] = 1.0
    viewpoint = RigViewpoint(1.0, np.eye(3), places)
    near, far = np.array([[0.5, 0.0, 1.0]]), np.array([[2.0, 0.0, 1.0]])
    inverse = np.array([1.0])
    # from x = 0 at headings to the left, from x = 1 to the right: at x = 0.5 it is ahead of neither
    assert not viewpoint.shows_twice(near, inverse)[0]
    places[:, 0] = np.where(np.arange(1440) < 720, 1.0, 0.0)
    assert RigViewpoint(1.0, np.eye(3), places).shows_twice(near, inverse)[0]
    assert not RigViewpoint(1.0, np.eye(3), places).shows_twice(far, inverse)[0]


def test_a_wrong_depth_beyond_the_overlaps_makes_it_go(rig: Rig, field: SphereField, viewpoint: RigViewpoint) -> None:
    """Straight uprights at the far end, which a ragged depth bends from the first place and not from their own."""
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 120.0)
    warp = build_rig_warp(RigSurface.of(field, rig.views), projection)
    ragged = whole(warp.depth).copy()
    heading = np.degrees((warp.canvas.xs - projection.centre[0]) / projection.focal)
    rows = np.arange(warp.canvas.height)[:, None]
    ragged += 0.08 * np.sin(rows / 9.0) * np.clip((heading - 80) / 8, 0, 1)
    base = replace(warp, depth=np.maximum(ragged, 0.01).astype(np.float32))
    ends = np.stack([
        np.stack([ray_at(degrees) + (0, tilt, 0) for tilt in (-0.3, 0.3)]) for degrees in (88, 92, 95, 98)
    ]) @ np.eye(3)  # fmt: skip
    none = StraightEdges(np.zeros((0, 2, 3)), np.zeros(0))
    edges = [none, none, none, StraightEdges(ends, np.full(4, 0.5))]
    down = np.array([0.0, 1, 0])
    choice = choose_rig_slide(base, rig.views, viewpoint, edges, down)
    assert choice.s1 == 1
    assert choice.costs[0].bend_px > 2 * choice.costs[-1].bend_px
    flat = choose_rig_slide(warp, rig.views, viewpoint, [none] * 4, None)
    assert flat.s1 == 0
