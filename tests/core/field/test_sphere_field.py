"""The field on the sphere: what it finds, what it is held to, how sure it is, and what pictures are off beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import ViewOf
from edf_stitch.core.cameras.rig import Observations, Rig
from edf_stitch.core.field.sphere_field import Nearby, SphereField, even_rays, fit_sphere_field
from edf_stitch.core.field.sphere_options import SPHERE, SPHERE_SLACK
from edf_stitch.core.field.sphere_points import angular_unit, points_of, px_scale, seen_at
from edf_stitch.core.system.errors import DegenerateGeometry
from hypothesis import given, settings
from hypothesis import strategies as st

from .sphere_scenes import rig_of, room, unit_rays

AROUND = tuple(range(0, 360, 30))
properties = settings(max_examples=8, deadline=None)


@pytest.fixture(scope="module")
def ring() -> Rig:
    return rig_of(AROUND, noise_px=0.3, lens=(-0.05,))


@pytest.fixture(scope="module")
def field(ring: Rig) -> SphereField:
    return fit_sphere_field(ring)


def px_off(rig: Rig, field: SphereField) -> np.ndarray:
    """px (M,) between where pictures see the true scene and where the field puts it, without slack."""
    rays = rig.rays
    off = []
    for view in rig.views:
        true, found = seen_at(view, rays, room(rays)), seen_at(view, rays, field.at(rays))
        with np.errstate(invalid="ignore"):
            inside = ((true >= 0) & (true <= np.array(view.size) - 1)).all(axis=1)
        off.append(np.linalg.norm(true - found, axis=1)[inside])
    return np.concatenate(off)


def with_pixels(rig: Rig, pixels: np.ndarray) -> Rig:
    seen = rig.observations
    return replace(rig, observations=Observations(seen.picture, seen.point, pixels, seen.used))


def test_a_ring_of_pictures_is_found_to_half_a_pixel(ring: Rig, field: SphereField) -> None:
    off = px_off(ring, field)
    assert len(off) > 1500
    assert np.percentile(off, 95) < 0.5
    assert not field.warnings


def test_in_whatever_order_the_pictures_come_no_bit_changes() -> None:
    """Where the bundle told no deviations, points are weighed by sums over the pictures, here three or more."""
    ring = rig_of(tuple(range(0, 120, 10)), noise_px=0.3)
    ring = replace(ring, deviations=np.zeros(len(ring.rays)))
    order = [0, *np.random.default_rng(2).permutation(range(1, len(ring))).tolist()]
    field, other = fit_sphere_field(ring), fit_sphere_field(ring.renumbered(order))
    assert other.leave_one_out_px == field.leave_one_out_px
    rays = unit_rays(0, 500)
    assert other.at(rays).tobytes() == field.at(rays).tobytes()
    for number, before in enumerate(order):
        one, same = other.slack(number, rays), field.slack(before, rays)
        assert (one is None) == (same is None) and (one is None or same is None or one.tobytes() == same.tobytes())


@properties
@given(st.integers(0, 10_000), st.sampled_from(["plane", "sphere"]))
def test_a_plane_and_a_sphere_about_the_viewpoint_are_exact_where_points_are(seed: int, kind: str) -> None:
    def depth(rays: np.ndarray) -> np.ndarray:
        return 0.3 * np.ones(len(rays)) if kind == "sphere" else np.maximum(rays @ (0.03, 0.06, 0.25), 0.02)

    rig = rig_of((0, 12, -15, 25), seed, depth, points=8000)
    field = fit_sphere_field(rig, with_slack=False)
    assert field.at(rig.rays) == pytest.approx(depth(rig.rays), abs=1e-6)


def test_one_place_has_no_depth_at_all() -> None:
    field = fit_sphere_field(rig_of((0, 20, 40), moves=0.0))
    rays = unit_rays(0, 300)
    assert not field.at(rays).any()
    assert not field.deviation(rays).any()
    assert field.leave_one_out_px == 0
    assert not field.warnings


def test_a_picture_that_none_of_its_points_fit_has_no_slack() -> None:
    rig = rig_of((0, 20, 40), moves=0.0)
    far = rig.observations.pixels + np.where(rig.observations.picture == 1, 500, 0)[:, None]
    slacks = fit_sphere_field(with_pixels(rig, far)).slacks
    assert slacks[1] is None


def test_a_view_of_a_sphere_has_no_slack(ring: Rig) -> None:
    bent = ring.observations.pixels.copy()
    own = ring.observations.picture == 1
    bent[own] += 3 * np.sin(bent[own] / 60)
    rig = with_pixels(ring, bent)
    assert fit_sphere_field(rig).slacks[1] is not None
    view = replace(rig.cameras[1], view_of=ViewOf(0, "sphere.jpg", np.eye(3)))
    assert fit_sphere_field(replace(rig, cameras=(rig.cameras[0], view, *rig.cameras[2:]))).slacks[1] is None


def test_a_rig_whose_points_tell_no_range_is_refused(ring: Rig) -> None:
    seen = ring.observations
    once = np.unique(seen.point, return_index=True)[1]
    alone = Observations(seen.picture[once], seen.point[once], seen.pixels[once], seen.used[once])
    with pytest.raises(DegenerateGeometry, match="only 0 points tell how far"):
        fit_sphere_field(replace(ring, observations=alone))


def test_points_that_miss_their_pictures_are_left_out(ring: Rig) -> None:
    everything = points_of(ring)
    wrong = ring.observations.pixels.copy()
    wrong[ring.observations.point < 20] += 40
    assert len(points_of(with_pixels(ring, wrong))) == len(everything) - 20
    assert everything.noise.min() >= SPHERE.noise_range[0]
    assert everything.noise.max() <= SPHERE.noise_range[1]
    assert np.median(everything.noise) == pytest.approx(1.0, rel=0.01)


def test_sensitivity_is_how_far_a_point_moves_in_all_pictures(ring: Rig) -> None:
    points, step = points_of(ring), 1e-6
    seen = ring.observations
    straight = replace(ring, cameras=tuple(replace(camera, distortion=np.zeros(5)) for camera in ring.cameras))
    squared = np.zeros(len(ring.rays))
    for number, view in enumerate(straight.views):
        point = seen.point[seen.picture == number]
        rays, d = ring.rays[point], ring.inverse_ranges[point]
        moved = (seen_at(view, rays, d + step) - seen_at(view, rays, d - step)) / (2 * step)
        np.add.at(squared, point, np.square(moved).sum(axis=1))
    index = np.flatnonzero(np.isin(ring.inverse_ranges, points.inverse_ranges))
    assert points.sensitivity == pytest.approx(np.sqrt(squared[index]), rel=1e-4)


def test_points_count_by_the_deviation_that_the_bundle_gives_them(ring: Rig) -> None:
    """Half of the points are wrong, and are known to be: without that the field is far off."""
    random = np.random.default_rng(7)
    wrong = random.random(len(ring.rays)) < 0.5
    ranges = ring.inverse_ranges + np.where(wrong, 0.02, 0) * random.normal(size=len(wrong))
    seen = ring.observations
    pixels = np.empty_like(seen.pixels)
    for number, view in enumerate(ring.views):
        here = seen.picture == number
        pixels[here] = seen_at(view, ring.rays[seen.point[here]], ranges[seen.point[here]])
    noisy = with_pixels(replace(ring, inverse_ranges=ranges), pixels)
    known = replace(noisy, deviations=np.where(wrong, 0.02, 0.001))
    off = [np.median(px_off(ring, fit_sphere_field(one, with_slack=False))) for one in (known, noisy)]
    assert off[0] < 0.6 * off[1]


def test_scattered_wrong_ranges_do_not_bend_the_field(ring: Rig) -> None:
    """Ranges that lie on their epipolar lines pass every test but that of their neighbours."""
    random = np.random.default_rng(4)
    wrong = random.random(len(ring.rays)) < 0.05
    ranges = np.where(wrong, ring.inverse_ranges * random.uniform(3, 6, len(wrong)), ring.inverse_ranges)
    seen = ring.observations
    pixels = np.empty_like(seen.pixels)
    for number, view in enumerate(ring.views):
        here = seen.picture == number
        pixels[here] = seen_at(view, ring.rays[seen.point[here]], ranges[seen.point[here]])
    bad = with_pixels(replace(ring, inverse_ranges=ranges), pixels)
    assert np.percentile(px_off(ring, fit_sphere_field(bad, with_slack=False)), 95) < 1.0


def test_a_thing_in_front_of_a_wall_keeps_its_points() -> None:
    """A few points that agree with each other and with nobody else."""

    def depth(rays: np.ndarray) -> np.ndarray:
        return np.where(np.arccos(np.clip(rays @ (0.0, 0, 1), -1, 1)) < 0.05, 0.5, 0.1)

    rig = rig_of((0, 8, -8), 2, depth, points=24_000)
    near = rig.inverse_ranges > 0.3
    assert 5 <= near.sum() <= 30
    found = fit_sphere_field(rig, with_slack=False).at(rig.rays[near])
    assert np.median(found) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("waves", "most"), [(12, 0.012), (18, 0.002)])
def test_things_of_a_deep_scene_are_no_gross_errors(waves: int, most: float) -> None:
    """A wall with many things in front of it, four times as near: a stiff spline alone drops those of wide waves, a
    flexible one those of narrow ones."""

    def depth(rays: np.ndarray) -> np.ndarray:
        wave = np.sin(waves * np.arctan2(rays[:, 0], rays[:, 2]))
        return 0.1 + 0.35 * np.clip(1.5 * wave - 0.5, 0, 1)

    rig = rig_of((-30, 0, 30), 0, depth, noise_px=0.3, points=20_000)
    found = fit_sphere_field(rig, with_slack=False).at(rig.rays)
    assert np.abs(found - depth(rig.rays)).mean() < most


def test_beyond_the_points_d_goes_over_to_that_of_the_nearest() -> None:
    """Points in the lower half alone, nearer the lower they lie: above, nothing goes negative, near or far."""

    def depth(rays: np.ndarray) -> np.ndarray:
        return 0.05 + 0.3 * np.maximum(rays[..., 1], 0)

    rig = rig_of(AROUND, 3, depth, points=8000)
    seen = rig.observations
    low = rig.rays[seen.point][:, 1] > 0.1
    rig = replace(rig, observations=Observations(*(part[low] for part in (
        seen.picture, seen.point, seen.pixels, seen.used
    ))))  # fmt: skip
    field = fit_sphere_field(rig)
    rays = unit_rays(4, 4000)
    found = field.at(rays)
    high = (rays[:, 1] < -0.15) & (rays[:, 1] > -0.4)
    assert 0 <= found.min()
    assert found.max() <= SPHERE.nearest * rig.inverse_ranges.max()
    assert found[high].min() > 0.015
    assert found[high].max() < 0.15
    # and how sure that is falls with the distance
    assert np.median(field.deviation(rays[high])) > 3 * np.median(field.deviation(rig.rays[seen.point[low]]))


def test_it_is_less_sure_where_points_disagree(ring: Rig) -> None:
    random = np.random.default_rng(5)
    left = ring.rays[:, 0] < 0
    noisy = ring.inverse_ranges + np.where(left, 0.03, 0) * random.normal(size=len(left))
    seen = ring.observations
    pixels = np.empty_like(seen.pixels)
    for number, view in enumerate(ring.views):
        here = seen.picture == number
        pixels[here] = seen_at(view, ring.rays[seen.point[here]], noisy[seen.point[here]])
    field = fit_sphere_field(with_pixels(replace(ring, inverse_ranges=noisy), pixels), with_slack=False)
    rays = unit_rays(6, 2000)
    rays = rays[np.abs(rays[:, 1]) < 0.3]
    sides = [np.median(field.deviation(rays[side])) for side in (rays[:, 0] < -0.3, rays[:, 0] > 0.3)]
    assert sides[0] > 4 * sides[1]


def test_too_deep_a_scene_is_said() -> None:
    def depth(rays: np.ndarray) -> np.ndarray:
        return 0.4 + 0.35 * np.sign(np.sin(40 * rays[..., 0]) * np.sin(40 * rays[..., 1]))

    field = fit_sphere_field(rig_of((0, 10, -10), 1, depth, points=3000), with_slack=False)
    assert field.leave_one_out_px > SPHERE.deep_px
    assert "too near and deep" in field.warnings[0]


def bent(ring: Rig, number: int) -> tuple[Rig, np.ndarray]:
    """The rig with a picture that is bent by up to three px, smoothly, and by how much (N, 2) at its points."""
    here = ring.observations.picture == number
    pixels = ring.observations.pixels.copy()
    bend = 3 * np.column_stack([np.sin(pixels[here, 1] / 60), np.cos(pixels[here, 0] / 80)])
    pixels[here] += bend
    return with_pixels(ring, pixels), bend


def test_slack_is_what_a_pictures_own_points_leave_across_its_lines(ring: Rig) -> None:
    rig, bend = bent(ring, 4)
    field, view = fit_sphere_field(rig), ring.views[4]
    rays = ring.rays[ring.observations.point[ring.observations.picture == 4]]
    slack = field.slack(4, rays)
    assert slack is not None
    # lines run along what a change of d moves a point by
    along = seen_at(view, rays, field.at(rays) + 1e-4) - seen_at(view, rays, field.at(rays))
    across = along[:, ::-1] * (1, -1) / np.linalg.norm(along, axis=1, keepdims=True)
    expected = (bend * across).sum(axis=1)
    steady = np.linalg.norm(along, axis=1) > 0.2 * np.median(np.linalg.norm(along, axis=1))
    assert np.median(np.abs((slack * across).sum(axis=1) - expected)[steady]) < 0.4 * np.median(np.abs(expected))
    assert np.median(np.linalg.norm(slack - (slack * across).sum(axis=1)[:, None] * across, axis=1)[steady]) < 0.4
    other = field.slack(9, rays)
    assert other is None or np.median(np.linalg.norm(other, axis=1)) < 0.3
    assert fit_sphere_field(rig, with_slack=False).slack(4, rays) is None


def test_the_viewpoints_own_picture_has_slack_in_both_directions(ring: Rig) -> None:
    rig, bend = bent(ring, 0)
    rays = ring.rays[ring.observations.point[ring.observations.picture == 0]]
    slack = fit_sphere_field(rig).slack(0, rays)
    assert slack is not None
    assert np.median(np.linalg.norm(slack - bend, axis=1)) < 0.8


def test_where_points_are_off_by_chance_alone_there_is_no_slack() -> None:
    field = fit_sphere_field(rig_of(AROUND, 5, noise_px=0.5))
    assert sum(slack is not None for slack in field.slacks) <= 2


def test_slack_is_bounded_and_ends_beyond_its_points(ring: Rig) -> None:
    seen = ring.observations
    pixels = seen.pixels.copy()
    pixels[seen.picture == 4] += (25, 0)
    wide = replace(SPHERE, max_error_px=1e9)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("edf_stitch.core.field.sphere_points.SPHERE", wide)
        field = fit_sphere_field(with_pixels(ring, pixels))
    everywhere = field.slack(4, even_rays(0.1))
    assert everywhere is not None
    length = np.linalg.norm(everywhere, axis=-1)
    assert length.max() == pytest.approx(SPHERE_SLACK.max_px * px_scale(ring))
    away = even_rays(0.1) @ ring.R[4][2] < np.cos(1.3)
    assert not length[away].any()


def test_a_picture_with_few_points_has_no_slack(ring: Rig) -> None:
    seen = ring.observations
    few = np.flatnonzero(seen.picture == 4)[SPHERE_SLACK.min_centres - 1 :]
    used = seen.used.copy()
    used[few] = False
    rig, _ = bent(ring, 4)
    assert fit_sphere_field(rig).slack(4, ring.rays) is not None
    fewer = fit_sphere_field(replace(rig, observations=replace(rig.observations, used=used)))
    assert fewer.slack(4, ring.rays) is None


def test_even_rays_are_even() -> None:
    rays = even_rays(0.1)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(np.ones(len(rays)))
    cosines = rays @ rays.T - 2 * np.eye(len(rays))
    nearest = np.arccos(cosines.max(axis=1))
    assert 0.07 < nearest.min()
    assert nearest.max() < 0.12


def test_a_mean_nearby_is_that_of_what_is_nearby() -> None:
    nearby = Nearby(np.eye(3), np.array([1.0, 2.0, 3.0]), 0.01)
    assert nearby.at(np.eye(3)) == pytest.approx([1, 2, 3], rel=1e-3)
    assert nearby.at(np.full((1, 3), np.sqrt(1 / 3))) == pytest.approx([2.0])


def test_the_unit_is_the_side_of_the_middle_picture(ring: Rig) -> None:
    assert angular_unit(ring) == pytest.approx(np.sqrt(320 * 240) / 280)
