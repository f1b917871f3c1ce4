"""The made scene is where its cameras say it is, to the pixel, and the same every time."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.measure.metrics import psnr
from edf_stitch.core.pose import features
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry
from edf_stitch.synthetic_scenes.two_planes import (
    FLOOR_Y,
    WALL_Z,
    Pair,
    SceneCamera,
    Textures,
    depth_at,
    make_pair,
    render,
)


def pixels_of(camera: SceneCamera) -> np.ndarray:
    return np.stack(np.meshgrid(*(np.arange(size) for size in camera.size)), axis=-1).astype(float)


def world_points(camera: SceneCamera, points: np.ndarray) -> np.ndarray:
    flat = points.reshape(-1, 2).T
    rays = np.linalg.solve(camera.K, np.vstack([flat, np.ones(flat.shape[1])]))
    seen = camera.R.T @ (rays * depth_at(camera, points).ravel() - camera.t[:, None])
    return seen.T.reshape(*points.shape[:-1], 3)


@pytest.mark.parametrize("which", ["reference_camera", "target_camera"])
def test_every_pixel_sees_a_point_of_the_wall_or_of_the_floor_and_the_nearer_one(pair: Pair, which: str) -> None:
    camera = getattr(pair, which)
    seen = world_points(camera, pixels_of(camera))
    on_wall, on_floor = np.abs(seen[..., 2] - WALL_Z) < 1e-9, np.abs(seen[..., 1] - FLOOR_Y) < 1e-9
    assert (on_wall | on_floor).all() and on_wall.mean() > 0.2 and on_floor.mean() > 0.2
    assert (seen[..., 2] < WALL_Z + 1e-9).all() and (seen[..., 1] < FLOOR_Y + 1e-9).all(), "nothing through the other"
    assert (depth_at(camera, pixels_of(camera)) > 0).all()


LEVEL = np.array([[100.0, 0, 50], [0, 100, 40], [0, 0, 1]])


def test_depths_of_a_level_camera_by_hand() -> None:
    camera = SceneCamera(LEVEL, np.eye(3), np.array([0.2, 0, -1.5]), (101, 81))
    assert np.allclose(camera.place, (-0.2, 0, 1.5))
    depth = depth_at(camera, np.array([[50.0, 40], [0, 0], [50, 80], [100, 60]]))
    assert np.allclose(depth, [WALL_Z - 1.5, WALL_Z - 1.5, FLOOR_Y * 100 / 40, WALL_Z - 1.5]), "1.3 · 100 / 20 > 4.5"


def test_a_ray_that_meets_nothing_goes_to_infinity() -> None:
    backwards = SceneCamera(LEVEL, np.diag([-1.0, 1, -1]), np.zeros(3), (101, 81))
    assert np.isinf(depth_at(backwards, np.array([[50.0, 10]]))).all()
    assert np.isfinite(depth_at(backwards, np.array([[50.0, 70]]))).all(), "the floor goes on behind"


def test_the_true_geometry_warps_the_target_onto_the_reference(pair: Pair) -> None:
    """At least 30 dB, and half a pixel to any side is worse: pictures, depths and cameras belong together."""
    points = pixels_of(pair.reference_camera)
    geometry = TrueGeometry.of(pair.reference_camera, pair.target_camera)
    there = geometry.target_pixels(points, depth_at(pair.reference_camera, points))
    inside = ((there >= 1) & (there <= (398, 298))).all(axis=-1)
    assert inside.sum() > 40_000

    def quality(dx: float, dy: float) -> float:
        map_x, map_y = ((there[..., k] + shift).astype(np.float32) for k, shift in ((0, dx), (1, dy)))
        return psnr(pair.reference, cv2.remap(pair.target, map_x, map_y, cv2.INTER_CUBIC), inside)

    right = quality(0, 0)
    assert right >= 30
    for shift in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5)):
        assert quality(*shift) < right - 3, shift


def test_a_render_is_the_same_every_time_and_another_seed_is_another_wall() -> None:
    one, again, other = make_pair(60, 45), make_pair(60, 45), make_pair(60, 45, seed=1)
    assert np.array_equal(one.reference, again.reference) and np.array_equal(one.target, again.target)
    assert (one.reference != other.reference).mean() > 0.5
    assert one.reference.shape == (45, 60, 3) and one.reference.dtype == np.uint8


def test_threads_do_not_matter() -> None:
    before = cv2.getNumThreads()
    try:
        pictures = []
        for threads in (1, 2):
            cv2.setNumThreads(threads)
            pictures.append(make_pair(60, 45).target)
        assert np.array_equal(*pictures)
    finally:
        cv2.setNumThreads(before)


def test_a_wider_sensor_sees_the_same_and_more() -> None:
    pair = make_pair(60, 45)
    wide = pair.target_camera.widened(-13, -7, 90, 70)
    picture = render(wide, Textures(0))
    assert picture.shape == (70, 90, 3) and np.array_equal(picture[7:52, 13:73], pair.target)
    assert np.array_equal(pair.target_camera.K, make_pair(60, 45).target_camera.K), "the first one stays as it was"


def test_pixels_show_the_light_of_the_points_they_see(pair: Pair) -> None:
    """Most of all that of the point in their middle: half a pixel to any side fits worse."""
    camera = pair.reference_camera

    def difference(dx: float, dy: float) -> np.ndarray:
        light = np.clip(Textures(0).light(world_points(camera, pixels_of(camera) + (dx, dy))), 0, 1)
        return pair.reference - 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)

    here = difference(0, 0)
    assert abs(np.median(here)) < 1 and np.median(np.abs(here)) < 5
    for shift in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5)):
        assert np.abs(difference(*shift)).mean() > 1.1 * np.abs(here).mean(), shift


def test_the_target_camera_stands_and_looks_to_the_right() -> None:
    pair = make_pair(60, 45, baseline=0.8, turn=20.0)
    first, second = pair.reference_camera, pair.target_camera
    assert np.allclose(first.place, 0) and np.allclose(second.place, (0.8, -0.08, 0.16))
    assert second.R[2, 0] > 0.3 and abs(first.R[2, 0]) < 1e-12, "its axis points towards +x"
    for camera in (first, second):
        assert np.allclose(camera.R @ camera.R.T, np.eye(3)) and np.linalg.det(camera.R) == pytest.approx(1)
        assert np.allclose(camera.R @ camera.place + camera.t, 0)
        assert np.allclose(camera.K, [[57, 0, 29.5], [0, 57, 22], [0, 0, 1]]), "pixel centres are integers"
    assert make_pair(60, 45, focal=80.0).reference_camera.K[0, 0] == 80


def test_there_is_enough_to_see(pair: Pair) -> None:
    found = features.match(features.detect(pair.reference), features.detect(pair.target))
    assert len(found) > 300
    assert pair.reference.std() > 20 and (pair.reference == 255).mean() < 0.02 and (pair.reference == 0).mean() < 0.02
