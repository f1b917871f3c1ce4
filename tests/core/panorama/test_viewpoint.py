"""The sliding viewpoint: where it starts and ends, what it leaves where it is, and when it stands still."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.field.strict import fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.viewpoint import Viewpoint, viewpoint_between
from edf_stitch.core.panorama.warp import Warp, build_warp
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE, TARGET = (320, 240), (300, 260)
# how the target camera stands to the reference
STANDS = {
    "right": ((0, -25, 0), (-1.0, 0.1, 0.05)),
    "left": ((0, 25, 0), (1.0, 0.1, 0.05)),
    "below": ((20, 2, 0), (0.1, -1.0, 0.05)),
    "corner": ((14, -18, 0), (-1.0, -0.6, 0.05)),
    "forward": ((0, 8, 0), (0.05, 0.02, -1.0)),
    "surrounded": ((0, 2, 0), (-1.0, 0.0, 0.0)),
}


def made(along: tuple[float, float], s1: float, seed: int) -> Viewpoint:
    random = np.random.default_rng(seed)
    c = random.normal(size=3)
    turn = rotation_from_vector(random.uniform(-2, 2, 3))
    return Viewpoint(s1, c / np.linalg.norm(c), turn, np.array(along), (-0.4, 0.5))


@given(
    seed=st.integers(0, 2**32 - 1), s1=st.floats(0, 1),
    along=st.sampled_from([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.6, -0.8)]),
)  # fmt: skip
@settings(max_examples=40, deadline=None)
def test_points_stay_where_they_are(seed: int, s1: float, along: tuple[float, float]) -> None:
    viewpoint = made(along, s1, seed)
    random = np.random.default_rng(seed)
    q = np.stack([random.uniform(-1, 1, 300), random.uniform(-1, 1, 300), np.ones(300)], axis=-1) @ viewpoint.rotation.T
    d = random.uniform(0.01, 0.5, 300)
    rays, inverse_range = viewpoint.seen_from(q, d)
    assert np.allclose(np.linalg.norm(rays, axis=1), 1)
    # C + u / d_u = q / d, with the s of the ray that comes out
    off = (viewpoint.place(rays) + rays / inverse_range[:, None]) * d[:, None] - q
    assert np.abs(off).max() < 2e-3


def test_it_slides_from_the_reference_to_the_target_by_a_smooth_step() -> None:
    viewpoint = made((1.0, 0.0), 0.75, 1)
    heading = np.linspace(-1, 1, 401)
    for rise in (0.0, 0.7):  # the same at any elevation, so that uprights stay upright
        own = np.stack([np.sin(heading), np.full_like(heading, rise), np.cos(heading)], axis=-1)
        slide = viewpoint.slide_at(own @ viewpoint.rotation.T)
        assert (slide[heading <= -0.4] < 1e-20).all()
        assert np.allclose(slide[heading >= 0.5], 0.75)
        assert (np.diff(slide) >= 0).all()
        assert np.abs(np.diff(slide, n=2)).max() < 0.75 * 8 * 0.005**2 / 0.9**2
    assert np.allclose(viewpoint.place(own @ viewpoint.rotation.T), slide[:, None] * viewpoint.c)


def rig(by_hand: SimpleNamespace, stand: str, focal: float = 310.0) -> tuple[Warp, tuple[View, ...]]:
    """A coarse panorama of both pictures, from the reference's place; the target looks to the side that `stand` says.
    """
    camera, camera_prime = by_hand.camera(SIZE, 300.0), by_hand.camera(TARGET, focal)
    view = by_hand.view(camera, camera_prime, *STANDS[stand])
    x = np.random.default_rng(0).uniform((0, 0), np.array(SIZE) - 1, (200, 2))
    y = target_points(view, x, np.full(200, 0.1))
    inside = np.isfinite(y).all(axis=1) & (y > 0).all(axis=1) & (y < np.array(TARGET) - 1).all(axis=1)
    field = fit_strict(view, Matches(x[inside], y[inside]), SIZE, TARGET)
    views = views_of(view, (camera, camera_prime))
    return build_warp(field, views, round_projection("cylindrical", views[0].K / 2, np.eye(3))), views


@pytest.mark.parametrize("stand", list(STANDS)[:-1])
def test_it_slides_along_the_line_between_the_pictures(by_hand: SimpleNamespace, stand: str) -> None:
    base, views = rig(by_hand, stand)
    viewpoint = viewpoint_between(base, views)
    if stand == "forward":
        assert viewpoint is None  # around the point that both move towards nothing can slide
        return
    assert viewpoint is not None
    centre = views[1].R.T @ np.array([0, 0, 1.0])
    expected = {"right": [1, 0], "left": [-1, 0], "below": [0, 1], "corner": viewpoint.along}[stand]
    assert np.allclose(viewpoint.along, expected)
    assert viewpoint.along @ centre[:2] > 0.9 * np.linalg.norm(centre[:2])
    away = np.tan(1.4 * np.arcsin(np.linalg.norm(centre[:2]))) * centre[:2] / np.linalg.norm(centre[:2])
    assert np.allclose(viewpoint.slide_at(np.array([[*-away, 1.0], [*away, 1.0]])), [0, 1])
    assert np.allclose(viewpoint.c, -views[1].R.T @ views[1].t)


def test_it_stands_still_where_there_is_nothing_to_slide_along(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, "right")
    for nothing in (0.0, np.nan):  # a rotation; a plane without a pose
        assert viewpoint_between(base, (views[0], replace(views[1], t=np.full(3, nothing)))) is None
    assert viewpoint_between(*rig(by_hand, "surrounded", focal=700.0)) is None
