"""Lens distortion: OpenCV's model inside the picture, its own inverse, and no folding back outside."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE = (1000, 750)
# k1, k2, p1, p2, k3 and the focal length in units of the picture's width
LENSES = {
    "barrel": ((-0.1, 0, 0, 0, 0), 0.7),
    "strong barrel": ((-0.3, 0.1, 0, 0, 0), 0.9),
    "barrel, off-centre": ((-0.25, 0.08, 0.002, -0.001, 0), 0.9),
    "pincushion": ((0.1, 0, 0, 0, 0), 0.7),
    "strong pincushion": ((0.3, 0, 0, 0, 0), 0.9),
    "telephoto pincushion": ((0.5, 0, 0, 0, 0), 1.5),
    "moustache": ((-0.15, 0.2, -0.001, 0.001, -0.05), 0.9),
    "tangential alone": ((0, 0, 0.003, -0.002, 0), 0.9),
}
every_lens = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())


def camera(distortion: tuple[float, ...], focal: float, skew: float = 0.0) -> Camera:
    f = focal * SIZE[0]
    K = np.array([[f, skew, 508.0], [0, 1.01 * f, 371.0], [0, 0, 1]])
    return Camera(K, SIZE, "test", 0.0, np.array(distortion, float))


def grid(beyond: float = 0.0) -> np.ndarray:
    """Pixels over the whole picture, and as far as `beyond` pictures around it."""
    w, h = SIZE
    xs, ys = (np.linspace(-beyond * side, (1 + beyond) * side - 1, count) for side, count in ((w, 61), (h, 47)))
    return np.stack(np.meshgrid(xs, ys), axis=-1)


def by_opencv(ideal: np.ndarray, camera: Camera) -> np.ndarray:
    rays = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ np.linalg.inv(camera.K).T
    K = camera.K.copy()
    # OpenCV knows no skew: put it in afterwards, in units of y
    pixels, _ = cv2.projectPoints(rays.reshape(-1, 3), np.zeros(3), np.zeros(3), K, camera.distortion)
    pixels = pixels.reshape(ideal.shape)
    pixels[..., 0] += K[0, 1] * (pixels[..., 1] - K[1, 2]) / K[1, 1]
    return pixels


@every_lens
def test_raw_to_ideal_and_back_is_the_identity_inside_the_picture(lens: tuple[tuple[float, ...], float]) -> None:
    cam = camera(*lens)
    assert np.abs(distort(undistort(grid(), cam), cam) - grid()).max() <= 1e-6
    # and the other way round, for the ideal points of the picture
    ideal = undistort(grid(), cam)
    assert np.abs(undistort(distort(ideal, cam), cam) - ideal).max() <= 1e-6


@every_lens
@pytest.mark.parametrize("skew", [0.0, 8.0])
def test_inside_the_picture_it_is_opencvs_model(lens: tuple[tuple[float, ...], float], skew: float) -> None:
    cam = camera(*lens, skew)
    ideal = undistort(grid(), cam)
    assert np.abs(distort(ideal, cam) - by_opencv(ideal, cam)).max() < 1e-8
    assert np.abs(by_opencv(ideal, cam) - grid()).max() <= 1e-6


def test_barrel_pulls_corners_in_and_pincushion_pushes_them_out() -> None:
    corner = np.array([[999.0, 749.0]])
    centre = np.array([508.0, 371.0])
    barrel, pincushion = camera((-0.1, 0, 0, 0, 0), 0.9), camera((0.1, 0, 0, 0, 0), 0.9)
    assert np.linalg.norm(distort(corner, barrel) - centre) < np.linalg.norm(corner - centre) - 10
    assert np.linalg.norm(distort(corner, pincushion) - centre) > np.linalg.norm(corner - centre) + 10


@every_lens
def test_outside_the_picture_rays_run_outwards_for_ever(lens: tuple[tuple[float, ...], float]) -> None:
    """Along every ideal ray from the principal point the raw radius grows, and what left the picture stays out."""
    cam = camera(*lens)
    centre = cam.K[:2, 2]
    radius = np.linspace(0, 20 * SIZE[0], 4001)
    for angle in np.linspace(0, 2 * np.pi, 48, endpoint=False):
        ray = centre + radius[:, None] * (np.cos(angle), np.sin(angle))
        raw = distort(ray, cam)
        assert (np.diff(np.linalg.norm(raw - centre, axis=1)) > 0).all()
        outside = ((raw < 0) | (raw > np.array(SIZE) - 1)).any(axis=1)
        assert outside[int(np.argmax(outside)) :].all() and outside.any()
        # no leap where the polynomial ends: a step of the ray is at most a few steps of the raw pixel
        assert np.linalg.norm(np.diff(raw, axis=0), axis=1).max() < 4 * (radius[1] - radius[0])


@every_lens
def test_far_outside_the_lens_only_scales(lens: tuple[tuple[float, ...], float]) -> None:
    cam = camera(*lens)
    centre = cam.K[:2, 2]
    ray = np.random.default_rng(0).normal(size=(40, 2))
    ray *= 4 * SIZE[0] / np.linalg.norm(ray, axis=1, keepdims=True)
    near, far = (distort(centre + times * ray, cam) - centre for times in (1, 3))
    assert np.allclose(far, 3 * near, rtol=1e-9)


def test_the_polynomial_itself_would_fold_back() -> None:
    """What the trusted radius is for: OpenCV's model brings far points back into the picture, this one does not."""
    cam = camera((-0.3, 0.1, 0, 0, 0), 0.9)
    cam_without_k2 = camera((-0.3, 0, 0, 0, 0), 0.9)
    far = np.array([[508.0 + 1650, 371.0]])
    inside = by_opencv(far, cam_without_k2)[0]
    assert 0 < inside[0] < SIZE[0]
    for one in (cam, cam_without_k2):
        assert distort(far, one)[0, 0] > SIZE[0] + 100


@every_lens
def test_neighbours_in_the_picture_stay_neighbours(lens: tuple[tuple[float, ...], float]) -> None:
    """The inverse does not jump: raw steps of a pixel are ideal steps of a few pixels at most."""
    cam = camera(*lens)
    x = np.arange(0, SIZE[0], dtype=float)
    for y in (0.0, 371.0, 749.0):
        ideal = undistort(np.column_stack([x, np.full(len(x), y)]), cam)
        steps = np.linalg.norm(np.diff(ideal, axis=0), axis=1)
        assert 0.2 < steps.min() and steps.max() < 4


tangential = st.floats(-2e-3, 2e-3)


@settings(max_examples=40)
@given(st.floats(-0.15, 0.15), st.floats(-0.03, 0.03), tangential, tangential, st.floats(0.9, 3))
def test_usual_lenses_agree_with_opencv_and_invert(k1: float, k2: float, p1: float, p2: float, focal: float) -> None:
    cam = camera((k1, k2, p1, p2, 0), focal)
    ideal = undistort(grid(), cam)
    assert np.abs(by_opencv(ideal, cam) - grid()).max() <= 1e-6
    assert np.abs(distort(undistort(grid(0.5), cam), cam) - grid(0.5)).max() <= 1e-6


def test_without_distortion_nothing_is_touched() -> None:
    cam = camera((0, 0, 0, 0, 0), 0.9)
    points = grid(2.0)
    assert distort(points, cam) is points and undistort(points, cam) is points


def test_any_shape_and_points_behind_the_camera_pass_through() -> None:
    cam = camera(*LENSES["barrel"])
    points = grid()
    assert distort(points, cam).shape == undistort(points, cam).shape == points.shape
    flat = points.reshape(-1, 2)
    assert np.array_equal(undistort(points, cam).reshape(-1, 2), undistort(flat, cam))
    assert undistort(np.empty((0, 2)), cam).shape == (0, 2)
    # a map is NaN behind the camera: that stays, and disturbs no neighbour
    holes = flat.copy()
    holes[::7] = np.nan
    for function in (distort, undistort):
        out = function(holes, cam)
        assert np.isnan(out[::7]).all()
        assert np.allclose(np.delete(out, np.s_[::7], axis=0), np.delete(function(flat, cam), np.s_[::7], axis=0),
                           rtol=0, atol=1e-8)  # fmt: skip
