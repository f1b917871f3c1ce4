"""Panoramas: each point shows one ray, each ray is shown at one point, and a turned panorama is the same one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, rotation_from_vector
from edf_stitch.core.panorama.options import PROJECTION
from edf_stitch.core.panorama.projection import Projection, extent, focal_of, round_projection
from hypothesis import given, settings
from hypothesis import strategies as st

ROUND = ("cylindrical", "equirectangular")
SURFACES = (("perspective", 0.0), ("pannini", 0.4), ("pannini", 1.0), *((kind, 0.0) for kind in ROUND))
kinds = st.sampled_from(ROUND)
surfaces = st.one_of(
    st.sampled_from([("perspective", 0.0), *((kind, 0.0) for kind in ROUND)]),
    st.tuples(st.just("pannini"), st.floats(0, 1)),
)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: rotation_from_vector(np.array(v)))
seeds = st.integers(0, 2**32 - 1)


def intrinsics(focal: float = 700.0) -> np.ndarray:
    return np.array([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1.0]])


def made(
    kind: str, rotation: np.ndarray | None = None, focal: float = 700.0, distance: float = 0.0
) -> Projection:
    rotation = np.eye(3) if rotation is None else rotation
    if kind in ROUND:
        return round_projection(kind, intrinsics(focal), rotation)
    return Projection(kind, focal, (0.0, 0.0), rotation, intrinsics(focal), distance)


def any_rays(seed: int, count: int = 200, steepest: float = 2.5) -> np.ndarray:
    """Rays (N, 3) of the panorama's own axes, none steeper than a cylinder shows."""
    random = np.random.default_rng(seed)
    heading, rise = random.uniform(-np.pi, np.pi, count), random.uniform(-steepest, steepest, count)
    return np.stack([np.sin(heading), rise, np.cos(heading)], axis=-1)


@given(surface=surfaces, rotation=turns, focal=st.floats(50, 20_000), seed=seeds)
def test_rays_and_points_are_inverse_to_each_other(
    surface: tuple[str, float], rotation: np.ndarray, focal: float, seed: int
) -> None:
    projection = made(surface[0], rotation, focal, surface[1])
    limits = projection.limits
    random = np.random.default_rng(seed)
    points = random.uniform(limits[:2], limits[2:] - 1, (200, 2))
    rays = projection.rays(points)
    assert np.abs(np.linalg.norm(rays, axis=-1) - 1).max() < 1e-12
    again = projection.points(rays * random.uniform(0.1, 30, (200, 1)))
    poles = np.abs(rays @ rotation[:, 1]) > 1 - 1e-6  # where a column is a point
    assert np.abs(again - points)[~poles].max() < 1e-8 * focal
    assert np.abs(projection.rays(again) - rays).max() < 1e-11


@given(surface=surfaces, rotation=turns, seed=seeds)
def test_what_is_not_shown_lies_beyond_the_limits(
    surface: tuple[str, float], rotation: np.ndarray, seed: int
) -> None:
    """Of all directions those come back that lie within the limits, and no two lie on one point."""
    projection = made(surface[0], rotation, distance=surface[1])
    limits = projection.limits
    rays = any_rays(seed, steepest=20) @ rotation.T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    points = projection.points(rays)
    shown = (points >= limits[:2]).all(axis=1) & (points < limits[2:]).all(axis=1)
    assert np.isfinite(points).all()
    assert np.abs(projection.rays(points[shown]) - rays[shown]).max(initial=0) < 1e-9


@given(distance=st.floats(0, 1), heading=st.floats(-1.5, 1.5), rise=st.floats(-2, 2))
def test_pannini_looks_at_a_cylinder_from_behind_its_middle(distance: float, heading: float, rise: float) -> None:
    """The eye stands `distance` behind the axis, and the picture plane touches the cylinder ahead."""
    on_cylinder = np.array([np.sin(heading), rise, np.cos(heading)])
    eye = np.array([0, 0, -distance])
    towards = on_cylinder - eye
    if towards[2] < 0.05:
        return
    on_plane = eye + towards * (1 + distance) / towards[2]
    assert np.allclose(made("pannini", distance=distance).points(on_cylinder), 700 * on_plane[:2], rtol=1e-9)


@given(rotation=turns, seed=seeds)
def test_a_plane_shows_straight_lines_straight(rotation: np.ndarray, seed: int) -> None:
    ends = homogeneous(np.random.default_rng(seed).uniform(-2, 2, (2, 2))) @ rotation.T
    points = made("perspective", rotation).points(ends[0] + np.linspace(0, 1, 9)[:, None] * (ends[1] - ends[0]))
    across = points[-1] - points[0]
    off = (points - points[0]) @ np.array([-across[1], across[0]]) / np.linalg.norm(across)
    assert np.abs(off).max() < 1e-8 * 700


@pytest.mark.parametrize("surface", SURFACES)
def test_an_upright_is_shown_upright(surface: tuple[str, float]) -> None:
    rise = np.linspace(-1, 1, 7)
    rays = np.stack([np.full(7, 0.5), rise, np.full(7, 0.8)], axis=-1)
    assert np.ptp(made(surface[0], distance=surface[1]).points(rays)[:, 0]) < 1e-9


@pytest.mark.parametrize("surface", SURFACES)
def test_the_area_is_that_of_a_small_patch(surface: tuple[str, float]) -> None:
    rotation = rotation_from_vector(np.array([0.3, -0.2, 0.1]))
    projection = made(surface[0], rotation, distance=surface[1])
    limits = projection.limits * 0.6
    points = np.random.default_rng(3).uniform(limits[:2], limits[2:], (100, 2))
    ray, across, down = (projection.rays(points + step) for step in ((0, 0), (0.01, 0), (0, 0.01)))
    patch = np.linalg.norm(np.cross(across - ray, down - ray), axis=1)  # steradian per 1e-4 px²
    assert np.allclose(projection.area(ray) * patch, 1e-4, rtol=1e-3)


def test_there_is_no_area_that_is_not_shown() -> None:
    behind = np.array([[0.1, 0.2, -1.0]]) / np.linalg.norm([0.1, 0.2, 1])
    for kind, distance in (("perspective", 0.0), ("pannini", 0.5)):
        assert np.isinf(made(kind, distance=distance).area(behind)).all()
    assert np.isfinite(made("cylindrical").area(behind)).all()


@pytest.mark.parametrize("surface", SURFACES)
def test_the_middle_looks_ahead_and_has_the_references_pixels(surface: tuple[str, float]) -> None:
    rotation = rotation_from_vector(np.array([0.3, -0.2, 0.1]))
    projection = made(surface[0], rotation, distance=surface[1])
    middle = np.array(projection.centre)
    assert np.allclose(projection.rays(middle), rotation[:, 2])
    assert projection.rays(middle + (200, 0)) @ rotation[:, 0] > 0.2, "right is right"
    assert projection.rays(middle + (0, 200)) @ rotation[:, 1] > 0.2, "down is down"
    for step in ((1, 0), (0, 1)):
        turn = np.linalg.norm(projection.rays(middle + step) - projection.rays(middle))
        assert abs(turn * 700 - 1) < 1e-3


def test_a_window_is_all_that_is_shown_and_no_more_than_there_is() -> None:
    whole = made("pannini", distance=0.5)
    assert np.array_equal(replace(whole, window=(-50, -20, 101, 31)).limits, (-50, -20, 101, 31))
    assert whole.cuts and not replace(whole, window=(-50, -20, 101, 31)).cuts and not made("equirectangular").cuts
    left, _, _, bottom = whole.limits
    assert np.array_equal(replace(whole, window=(-9e9, -20, 101, 9e9)).limits, (left, -20, 101, bottom))


@pytest.mark.parametrize("kind", ["perspective", "pannini"])
@pytest.mark.parametrize("focal", [100.3, 200.0])
def test_a_plane_ends_at_its_steepest(kind: str, focal: float) -> None:
    limits = made(kind, focal=focal).limits
    most = np.floor(PROJECTION.max_slope * focal)
    assert np.array_equal(limits, (-most, -most, most + 1, most + 1))


@given(kind=kinds, rotation=turns, angle=st.floats(-3, 3), seed=seeds)
def test_a_turn_about_the_upright_axis_moves_the_picture_sideways(
    kind: str, rotation: np.ndarray, angle: float, seed: int
) -> None:
    plain, turned = made(kind, rotation), made(kind, rotation @ rotation_from_vector(np.array([0, angle, 0])))
    rays = any_rays(seed) @ rotation.T
    moved = plain.points(rays) - turned.points(rays)
    around = 2 * np.pi * plain.focal
    off = moved[:, 0] - angle * plain.focal
    assert np.abs(off - around * np.round(off / around)).max() < 1e-6 and np.abs(moved[:, 1]).max() < 1e-9


@given(surface=surfaces, rotation=turns, turn=turns, seed=seeds)
def test_a_turned_world_in_a_panorama_turned_alike_lies_where_it_lay(
    surface: tuple[str, float], rotation: np.ndarray, turn: np.ndarray, seed: int
) -> None:
    one, other = (made(surface[0], a, distance=surface[1]) for a in (turn @ rotation, rotation))
    rays = any_rays(seed)
    rays = rays[rays[:, 2] > 0.1] @ rotation.T
    assert np.abs(one.points(rays @ turn.T) - other.points(rays)).max(initial=0) < 1e-7


@given(surface=surfaces, rotation=turns)
def test_products_are_those_of_the_rays(surface: tuple[str, float], rotation: np.ndarray) -> None:
    projection = made(surface[0], rotation, distance=surface[1])
    rows = np.random.default_rng(1).normal(size=(2, 3))
    u, v = np.arange(-40.0, 600, 70), np.arange(200.0, 700, 90)
    rays = projection.rays(np.stack(np.meshgrid(u, v), axis=-1))
    for row, found in zip(rows, projection.project_rows(rows, u, v), strict=True):
        assert found.shape == (len(v), len(u))
        assert np.allclose(found, rays @ projection.K.T @ row, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("focal", [20.0, 333.3, 1234.56, 5000.0])
def test_the_whole_sphere_is_twice_as_wide_as_high_and_closes(focal: float) -> None:
    projection = made("equirectangular", focal=focal)
    assert projection.sphere is not None and made("cylindrical").sphere is None
    left, top, width, height = projection.sphere
    assert width == 2 * height and width % 4 == 0 and abs(projection.focal / focal - 1) < 1 / height
    assert projection.focal == pytest.approx(focal_of(projection.K), rel=1 / height)
    corners = np.array([[left, top], [left + width - 1.0, top + height - 1.0]])
    (first, above), (last, below) = (corners - np.array(projection.centre)) / projection.focal
    assert abs(first + np.pi - 0.5 / projection.focal) < 1e-9, "the first pixel begins where the last one ends"
    assert abs(last - np.pi + 0.5 / projection.focal) < 1e-9
    assert abs(above + np.pi / 2 - 0.5 / projection.focal) < 1e-9 and abs(below + above) < 1e-9


@pytest.mark.parametrize("surface", SURFACES)
def test_where_a_pixel_of_the_reference_is_shown(surface: tuple[str, float]) -> None:
    projection = made(surface[0], rotation_from_vector(np.array([0.2, 0.4, -0.1])), distance=surface[1])
    pixels = np.random.default_rng(2).uniform((0, 0), (639, 479), (50, 2))
    rays = projection.rays(projection.of_reference(pixels)) @ projection.K.T
    assert np.abs(rays[:, :2] / rays[:, 2:] - pixels).max() < 1e-8 and (rays[:, 2] > 0).all()


@settings(max_examples=200)
@given(surface=surfaces, rotation=turns, seed=seeds)
def test_what_an_outline_encloses_lies_within_its_extent(
    surface: tuple[str, float], rotation: np.ndarray, seed: int
) -> None:
    """Whichever way the picture is turned: across the line behind, over a pole, or neither."""
    projection = made(surface[0], rotation, distance=surface[1])
    K = np.array([[260.0, 0, 319.5], [0, 260.0, 239.5], [0, 0, 1]])
    u = np.linspace(0, 1, 40, endpoint=False)
    around = np.concatenate([np.column_stack(p) for p in ((u, 0 * u), (0 * u + 1, u), (1 - u, 0 * u + 1),
                                                          (0 * u, 1 - u))])  # fmt: skip

    def shows(ray: np.ndarray) -> bool:
        p = K @ ray
        return bool(p[2] > 0 and 0 <= p[0] <= 639 * p[2] and 0 <= p[1] <= 479 * p[2])

    outline = homogeneous(around * (639, 479)) @ np.linalg.inv(K).T
    left, top, right, bottom = extent(projection, outline, shows)
    inner = homogeneous(np.random.default_rng(seed).uniform((0, 0), (639, 479), (400, 2))) @ np.linalg.inv(K).T
    points = projection.points(inner)
    limits = projection.limits
    shown = (points >= limits[:2]).all(axis=1) & (points < limits[2:]).all(axis=1)
    # the outline is known at some points only: between two of them it bulges by up to a few px
    assert (points[shown] > (left - 8, top - 8)).all() and (points[shown] < (right + 8, bottom + 8)).all()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_pole_just_inside_takes_the_whole_width(sign: float) -> None:
    """Between two points of an outline the direction may swing by almost half a turn."""
    K = np.array([[260.0, 0, 319.5], [0, 260.0, 239.5], [0, 0, 1]])
    u = np.linspace(0, 1, 40, endpoint=False)
    around = np.concatenate([np.column_stack(p) for p in ((u, 0 * u), (0 * u + 1, u), (1 - u, 0 * u + 1),
                                                          (0 * u, 1 - u))])  # fmt: skip
    ray = np.linalg.inv(K) @ (325.0, 4.0, 1.0)  # 4 px from the edge, between points 16 px apart
    down = sign * ray / np.linalg.norm(ray)
    ahead = np.cross(down, (1.0, 0, 0)) / np.linalg.norm(np.cross(down, (1.0, 0, 0)))
    projection = made("equirectangular", np.column_stack([np.cross(down, ahead), down, ahead]))

    def shows(ray: np.ndarray) -> bool:
        p = K @ ray
        return bool(p[2] > 0 and 0 <= p[0] <= 639 * p[2] and 0 <= p[1] <= 479 * p[2])

    outline = homogeneous(around * (639, 479)) @ np.linalg.inv(K).T
    left, top, right, bottom = extent(projection, outline, shows)
    limits = projection.limits
    assert (left, right) == (limits[0], limits[2])
    assert (bottom == limits[3]) if sign > 0 else (top == limits[1])


@pytest.mark.parametrize("focal", [100.3, 57.9, 200.0])
def test_a_cylinder_has_the_pixels_whose_centres_lie_within_a_turn_and_below_its_steepest(focal: float) -> None:
    projection = Projection("cylindrical", focal, (0.0, 0.0), np.eye(3), np.diag([focal, focal, 1.0]))
    left, top, right, bottom = projection.limits
    for inside, outside, most in (
        (left, left - 1, np.pi), (right - 1, right, np.pi),
        (top, top - 1, PROJECTION.max_slope), (bottom - 1, bottom, PROJECTION.max_slope),
    ):  # fmt: skip
        assert abs(inside / focal) <= most + 1e-12 < abs(outside / focal)
