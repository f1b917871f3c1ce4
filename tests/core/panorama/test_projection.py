"""Round panoramas: each point shows one ray, each ray is shown at one point, and a turned panorama is the same one."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous, rotation_from_vector
from edf_stitch.core.choices import PROJECTIONS
from edf_stitch.core.panorama.options import PROJECTION
from edf_stitch.core.panorama.projection import Projection, extent, round_projection
from hypothesis import given, settings
from hypothesis import strategies as st

ROUND = PROJECTIONS[1:]
kinds = st.sampled_from(ROUND)
turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda v: rotation_from_vector(np.array(v)))
seeds = st.integers(0, 2**32 - 1)


def intrinsics(focal: float = 700.0) -> np.ndarray:
    return np.array([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1.0]])


def made(kind: str, rotation: np.ndarray | None = None, focal: float = 700.0) -> Projection:
    return round_projection(kind, intrinsics(focal), np.eye(3) if rotation is None else rotation)


def any_rays(seed: int, count: int = 200, steepest: float = 2.5) -> np.ndarray:
    """Rays (N, 3) of the panorama's own axes, none steeper than a cylinder shows."""
    random = np.random.default_rng(seed)
    heading, rise = random.uniform(-np.pi, np.pi, count), random.uniform(-steepest, steepest, count)
    return np.stack([np.sin(heading), rise, np.cos(heading)], axis=-1)


@given(kind=kinds, rotation=turns, focal=st.floats(50, 20_000), seed=seeds)
def test_rays_and_points_are_inverse_to_each_other(kind: str, rotation: np.ndarray, focal: float, seed: int) -> None:
    projection = made(kind, rotation, focal)
    rays = any_rays(seed) @ rotation.T * np.random.default_rng(seed).uniform(0.1, 30, (200, 1))
    points = projection.points(rays)
    back = projection.rays(points)
    assert np.abs(np.linalg.norm(back, axis=-1) - 1).max() < 1e-12
    assert np.abs(back - rays / np.linalg.norm(rays, axis=-1, keepdims=True)).max() < 1e-12
    left, top, right, bottom = projection.limits
    # a circumference that is no whole number of px goes on for a part of one at both ends
    assert (points >= (left - 1, top)).all() and (points <= (right, bottom)).all()
    assert np.abs(projection.points(back) - points).max() < 1e-9 * focal


@pytest.mark.parametrize("kind", ROUND)
def test_the_middle_looks_ahead_and_the_rest_to_its_side(kind: str) -> None:
    rotation = rotation_from_vector(np.array([0.3, -0.2, 0.1]))
    projection, (u, v) = made(kind, rotation), made(kind).centre
    assert np.allclose(projection.rays(np.array([u, v])), rotation[:, 2])
    step = 700 * np.pi / 2
    assert np.allclose(projection.rays(np.array([u + projection.focal * np.pi / 2, v])), rotation[:, 0], atol=1e-12)
    assert projection.rays(np.array([u, v + step / 3])) @ rotation[:, 1] > 0.4, "down is down"
    # a step of a pixel in the middle is that of the reference's middle: 1 / focal
    for step in ((1, 0), (0, 1)):
        turn = np.linalg.norm(projection.rays(np.array([u, v]) + step) - projection.rays(np.array([u, v])))
        assert abs(turn * 700 - 1) < 1e-3


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


@given(kind=kinds, rotation=turns, turn=turns, seed=seeds)
def test_a_turned_world_in_a_panorama_turned_alike_lies_where_it_lay(
    kind: str, rotation: np.ndarray, turn: np.ndarray, seed: int
) -> None:
    rays = any_rays(seed) @ rotation.T
    assert np.abs(made(kind, turn @ rotation).points(rays @ turn.T) - made(kind, rotation).points(rays)).max() < 1e-8


@given(kind=kinds, rotation=turns)
def test_products_are_those_of_the_rays(kind: str, rotation: np.ndarray) -> None:
    projection = made(kind, rotation)
    rows = np.random.default_rng(1).normal(size=(2, 3))
    u, v = np.arange(-40.0, 60, 7), np.arange(200.0, 300, 9)
    rays = projection.rays(np.stack(np.meshgrid(u, v), axis=-1))
    for row, found in zip(rows, projection.project_rows(rows, u, v), strict=True):
        assert np.allclose(found, rays @ projection.K.T @ row, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("focal", [20.0, 333.3, 1234.56, 5000.0])
def test_the_whole_sphere_is_twice_as_wide_as_high_and_closes(focal: float) -> None:
    projection = made("equirectangular", focal=focal)
    assert projection.sphere is not None and made("cylindrical").sphere is None
    left, top, width, height = projection.sphere
    assert width == 2 * height and width % 4 == 0 and abs(projection.focal / focal - 1) < 1 / height
    first, last = projection.headings(np.array([left, left + width - 1.0]))
    assert abs(first + np.pi - 0.5 / projection.focal) < 1e-9, "the first pixel begins where the last one ends"
    assert abs(last - np.pi + 0.5 / projection.focal) < 1e-9
    above, below = projection.elevations(np.array([top, top + height - 1.0]))
    assert abs(above + np.pi / 2 - 0.5 / projection.focal) < 1e-9 and abs(below + above) < 1e-9


@pytest.mark.parametrize("kind", ROUND)
def test_where_a_pixel_of_the_reference_is_shown(kind: str) -> None:
    projection = made(kind, rotation_from_vector(np.array([0.2, 0.4, -0.1])))
    pixels = np.random.default_rng(2).uniform((0, 0), (639, 479), (50, 2))
    rays = projection.rays(projection.of_reference(pixels)) @ projection.K.T
    assert np.abs(rays[:, :2] / rays[:, 2:] - pixels).max() < 1e-8 and (rays[:, 2] > 0).all()


@settings(max_examples=200)
@given(kind=kinds, rotation=turns, seed=seeds)
def test_what_an_outline_encloses_lies_within_its_extent(kind: str, rotation: np.ndarray, seed: int) -> None:
    """Whichever way the picture is turned: across the line behind, over a pole, or neither."""
    projection = made(kind, rotation)
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
    for inside, outside, most, at in (
        (left, left - 1, np.pi, projection.headings),
        (right - 1, right, np.pi, projection.headings),
        (top, top - 1, np.arctan(PROJECTION.max_slope), projection.elevations),
        (bottom - 1, bottom, np.arctan(PROJECTION.max_slope), projection.elevations),
    ):
        assert abs(at(inside)) <= most + 1e-12 < abs(at(outside))
