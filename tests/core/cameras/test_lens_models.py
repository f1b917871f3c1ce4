"""Fisheyes and polynomials: both ways, against OpenCV where it has them, and where they end."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort, unused
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.cameras.options import LENS
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE = (800, 600)
EQUIDISTANT = LensProjection.EQUIDISTANT
# k1 to k4 and a, b, c as lenses have them
angular = st.tuples(*(st.floats(-most, most) for most in (0.1, 0.03, 0.01, 0.003)))
ptlens = st.tuples(*(st.floats(-0.05, 0.05) for _ in range(3)))
lenses = st.one_of(
    st.builds(Lens, st.sampled_from(list(LensProjection)), ptlens=ptlens, radius=st.floats(0.3, 1.5)),
    st.builds(Lens, st.just(EQUIDISTANT), angular),
)


def camera(lens: Lens, focal: float = 300.0) -> Camera:
    K = np.array([[focal, 0, 410.0], [0, focal, 290.0], [0, 0, 1]])
    return Camera(K, SIZE, "test", 0.0, lens=lens)


def rays_within(lens: Lens, most: float = np.pi) -> np.ndarray:
    """Rays all around the axis, up to the lens's limit or `most` rad."""
    angle, turn = np.meshgrid(np.linspace(0, min(lens.limit, most) * 0.9999, 40), np.linspace(0, 6, 13))
    return np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)], axis=-1)


@settings(max_examples=150)
@given(lenses)
def test_projecting_and_back_is_the_identity_up_to_the_limit(lens: Lens) -> None:
    rays = rays_within(lens)
    assert np.abs(lens.unproject(lens.project(rays)) - rays).max() < 1e-9


@settings(max_examples=60)
@given(lenses)
def test_beyond_the_limit_nothing_is_shown(lens: Lens) -> None:
    inside, beyond = (np.array([np.sin(a), 0, np.cos(a)]) for a in (0.999 * lens.limit, lens.limit + 0.002))
    assert np.isfinite(lens.project(inside)).all() and np.isnan(lens.project(beyond)).all()
    assert np.isnan(lens.unproject(1.0001 * lens.project(np.array([np.sin(lens.limit), 0, np.cos(lens.limit)])))).all()


@settings(max_examples=60)
@given(lenses)
def test_up_to_the_limit_the_radius_grows_and_beyond_it_folds_or_ends(lens: Lens) -> None:
    angles = np.linspace(0, lens.limit, 500)
    assert (np.diff(lens.shown_at(angles)) > 0).all()
    ends = np.radians((LENS.widest_flat, LENS.widest_round))
    assert np.isclose(lens.limit, ends).any() or np.isclose(lens.slope_at(np.array(lens.limit)), 0.05)


@pytest.mark.parametrize(("projection", "radius"), [
    (LensProjection.RECTILINEAR, np.tan(1.0)), (EQUIDISTANT, 1.0), (LensProjection.EQUISOLID, 2 * np.sin(0.5)),
    (LensProjection.STEREOGRAPHIC, 2 * np.tan(0.5)), (LensProjection.ORTHOGRAPHIC, np.sin(1.0)),
])  # fmt: skip
def test_each_projection_is_its_formula(projection: LensProjection, radius: float) -> None:
    assert np.allclose(Lens(projection).project(np.array([0, np.sin(1.0), np.cos(1.0)])), (0, radius))


@settings(max_examples=40)
@given(angular)
def test_kannala_brandt_is_opencvs_fisheye(k: tuple[float, ...]) -> None:
    lens = Lens(EQUIDISTANT, k)
    rays = rays_within(lens, 1.4)
    cam = camera(lens)
    seen, _ = cv2.fisheye.projectPoints(rays.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), cam.K, np.array(k))
    own = lens.project(rays).reshape(-1, 2) * 300 + (410, 290)
    assert np.abs(own - seen.reshape(-1, 2)).max() < 1e-8
    flat = rays[..., :2] / rays[..., 2:] * 300 + (410, 290)
    used = np.arccos(rays[..., 2]) < np.radians(LENS.widest_used)
    assert np.abs(distort(flat, cam)[used] - seen.reshape(*rays.shape[:-1], 2)[used]).max() < 1e-8


def test_a_polynomial_with_b_alone_is_browns_k1() -> None:
    """Panorama Tools: at b the radius is s (1 − b + b q²), q = s / half the shorter side; that is a focal length
    (1 − b) times as long with k1."""
    b, half, f = 0.03, 300.0, 700.0
    cam = camera(Lens(ptlens=(0, b, 0), radius=half / f), f)
    k1 = b / (1 - b) * (f / half) ** 2
    points = np.stack(np.meshgrid(np.linspace(0, 800, 21), np.linspace(0, 600, 17)), axis=-1).reshape(-1, 2)
    rays = np.column_stack([(points - (410, 290)) / f, np.ones(len(points))])
    K = cam.K.copy()
    K[0, 0] = K[1, 1] = f * (1 - b)
    # the radius that k1 multiplies is the ideal one in both
    seen, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array([k1, 0, 0, 0, 0]))
    assert np.abs(distort(points, cam) - seen.reshape(-1, 2)).max() < 1e-8


@settings(max_examples=60)
@given(lenses, st.floats(150, 900))
def test_in_pixels_it_can_be_undone_everywhere(lens: Lens, focal: float) -> None:
    """Beyond the angle that is used points go on in proportion to the radius, so that none comes back inside."""
    cam = camera(lens, focal)
    points = np.stack(np.meshgrid(np.linspace(-800, 1600, 49), np.linspace(-600, 1200, 37)), axis=-1)
    assert np.abs(distort(undistort(points, cam), cam) - points).max() < 1e-6


def test_what_is_shown_too_far_from_the_axis_is_not_used() -> None:
    cam = camera(Lens(EQUIDISTANT), 250.0)
    out = unused(cam)
    assert out is not None
    y, x = np.mgrid[:600, :800]
    assert np.array_equal(out, np.hypot(x - 410, y - 290) > 250 * np.radians(80))
    assert unused(camera(Lens(EQUIDISTANT), 400.0)) is None and unused(camera(Lens())) is None


def test_at_another_size_or_focal_length_the_same_pixels_move() -> None:
    cam = camera(Lens(ptlens=(0.01, -0.04, 0.02), radius=0.75), 400.0)
    points = np.array([[12.0, 30.0], [700.0, 500.0]])
    longer = cam.zoomed(1.3)
    assert np.allclose(distort(points, longer), distort(points, cam), atol=1e-9)
    half = cam.resized((400, 300))
    assert np.allclose(distort((points - 0.5) / 2, half), (distort(points, cam) - 0.5) / 2, atol=1e-9)


def test_a_lens_without_distortion_touches_nothing() -> None:
    cam, points = camera(Lens()), np.array([[1.0, 2.0]])
    assert distort(points, cam) is points and undistort(points, cam) is points
    assert not cam.bent and cam.lens_known and cam.without_lens().lens == Lens()


def test_angular_coefficients_of_no_lens_fold_without_a_word() -> None:
    assert Lens(EQUIDISTANT, (1e308, -1e308, 1e308, 1e308)).limit < 0.1


@pytest.mark.parametrize("ptlens", [(1e308, 0.0, 0.0), (0.0, -1e308, 1e308), (1e308, 1e308, 1e308)])
def test_coefficients_of_no_lens_fold_on_the_axis_without_a_word(ptlens: tuple[float, ...]) -> None:
    """As damaged files have them: NumPy would warn of what overflows, which pytest makes an error of."""
    assert Lens(ptlens=ptlens, radius=1.0).limit == 0
