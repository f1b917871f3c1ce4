"""What is called true agrees with plain projection, and errors are measured in the units they are named by."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import fundamental_from_pose, infinite_homography, rotation_from_vector
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry, flat, pose_errors, seen_from, steepness, visible
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at

SIZE = (400, 300)


@pytest.fixture
def truth(pair: Pair) -> TrueGeometry:
    return TrueGeometry.of(pair.reference_camera, pair.target_camera)


def seen_by(camera: SceneCamera, world: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixels and depths of world points (N, 3)."""
    there = world @ camera.R.T + camera.t
    pixels = there @ camera.K.T
    return pixels[:, :2] / pixels[:, 2:], there[:, 2]


def view_of(truth: TrueGeometry, by_hand: SimpleNamespace, **changed: np.ndarray) -> TwoView:
    """The truth as an estimate, with some of K, R, t changed."""
    K, R, t = (changed.get(name, getattr(truth, name)) for name in ("K", "R", "t"))
    camera = by_hand.camera(SIZE, 1.0)
    return replace(
        by_hand.view(camera, camera, (0, 0, 0), (1, 0, 0)), K=K, K_prime=K, R=R, t=t,
        F=fundamental_from_pose(K, K, R, t), H_inf=infinite_homography(K, K, R), e_prime=K @ t,
    )  # fmt: skip


def test_the_true_pixels_are_where_the_target_camera_sees_the_points(pair: Pair, truth: TrueGeometry) -> None:
    world = np.random.default_rng(1).uniform((-2, -2, 3), (2, 1.3, 8), (200, 3))
    x, depth = seen_by(pair.reference_camera, world)
    y, _ = seen_by(pair.target_camera, world)
    assert np.abs(truth.target_pixels(x, depth) - y).max() < 1e-9
    lines = np.column_stack([x, np.ones(200)]) @ truth.F.T
    off = np.abs((lines[:, :2] * y).sum(axis=1) + lines[:, 2]) / np.hypot(lines[:, 0], lines[:, 1])
    assert off.max() < 1e-9
    far, infinite = (truth.target_pixels(x, np.full(200, depth)) for depth in (1e12, np.inf))
    assert np.abs(far - infinite).max() < 1e-6


def test_the_true_pose_is_the_relative_one(pair: Pair, truth: TrueGeometry) -> None:
    assert np.linalg.norm(truth.t) == pytest.approx(1) and np.linalg.norm(truth.F) == pytest.approx(1)
    assert np.allclose(truth.R @ truth.R.T, np.eye(3)) and np.linalg.det(truth.R) == pytest.approx(1)
    apart = np.linalg.norm(pair.target_camera.place - pair.reference_camera.place)
    assert truth.baseline == pytest.approx(apart)
    # the epipole is where the target camera sees the reference camera
    there = pair.target_camera.K @ (pair.target_camera.R @ pair.reference_camera.place + pair.target_camera.t)
    assert np.allclose(np.cross(there, truth.e_prime), 0, atol=1e-9) and there @ truth.e_prime > 0
    assert np.allclose(truth.F.T @ truth.e_prime, 0)
    assert np.allclose(truth.H_inf, truth.K_prime @ truth.R @ np.linalg.inv(truth.K))


def test_behind_the_target_camera_there_are_no_pixels(truth: TrueGeometry) -> None:
    turned_away = replace(truth, R=np.diag([-1.0, 1, -1]))
    assert np.isnan(turned_away.target_pixels(np.array([[200.0, 150], [10, 20]]), np.array([5.0, 5]))).all()


def test_the_truth_has_no_error(truth: TrueGeometry, by_hand: SimpleNamespace) -> None:
    errors = pose_errors(view_of(truth, by_hand), truth, SIZE)
    assert set(errors) == {"rotation_deg", "baseline_deg", "focal_percent", "h_inf_px", "h_inf_p95_px", "f_px"}
    assert all(abs(value) < 1e-5 for value in errors.values()), errors


def test_errors_are_in_the_units_they_are_named_by(truth: TrueGeometry, by_hand: SimpleNamespace) -> None:
    turn = rotation_from_vector(np.radians([0, 0.5, 0]))
    errors = pose_errors(view_of(truth, by_hand, R=turn @ truth.R), truth, SIZE)
    assert errors["rotation_deg"] == pytest.approx(0.5) and errors["baseline_deg"] == pytest.approx(0, abs=1e-5)
    # f · δ in the middle, f · δ · (1 + tan²) at the sides: the median lies between
    middle = 380 * np.radians(0.5)
    assert middle < errors["h_inf_px"] < 1.2 * middle

    across = np.linalg.svd(truth.t[None])[2][1]
    leaning = np.cos(np.radians(3)) * truth.t + np.sin(np.radians(3)) * across
    errors = pose_errors(view_of(truth, by_hand, t=leaning), truth, SIZE)
    assert errors["baseline_deg"] == pytest.approx(3) and errors["rotation_deg"] < 1e-6
    assert errors["h_inf_px"] < 1e-6, "infinity does not depend on the baseline"

    errors = pose_errors(view_of(truth, by_hand, t=-truth.t), truth, SIZE)
    assert errors["baseline_deg"] == pytest.approx(180) and errors["f_px"] < 1e-6, "lines do not know the sign"

    K = truth.K.copy()
    K[0, 0] *= 1.1
    K[1, 1] *= 1.1
    errors = pose_errors(view_of(truth, by_hand, K=K), truth, SIZE)
    assert errors["focal_percent"] == pytest.approx(10) and errors["h_inf_px"] > 1


def test_the_line_distance_sees_a_wrong_baseline(truth: TrueGeometry, by_hand: SimpleNamespace) -> None:
    """Lines turn about H_inf x when the baseline does: points at infinity alone would never tell."""
    across = np.linalg.svd(truth.t[None])[2][1]
    leaning = np.cos(np.radians(3)) * truth.t + np.sin(np.radians(3)) * across
    assert pose_errors(view_of(truth, by_hand, t=leaning), truth, SIZE)["f_px"] > 0.1


# --- what is seen from elsewhere -----------------------------------------------------------------------------------


def test_another_camera_sees_pixels_where_the_geometry_says(pair: Pair, truth: TrueGeometry) -> None:
    x, y = np.meshgrid(np.arange(400.0), np.arange(300.0))
    points = np.stack([x, y], axis=-1)
    depth = depth_at(pair.reference_camera, points)
    pixels, there = seen_from(pair.reference_camera, depth, pair.target_camera)
    assert np.nanmax(np.abs(pixels - truth.target_pixels(points, depth))) < 1e-9
    inside = (pixels >= 0).all(axis=-1) & (pixels <= (399, 299)).all(axis=-1)
    assert np.abs(there[inside] / depth_at(pair.target_camera, pixels[inside]) - 1).max() < 0.3, "both see two planes"


def test_what_is_infinitely_far_is_seen_through_h_inf(pair: Pair, truth: TrueGeometry) -> None:
    far = np.full((300, 400), np.inf, np.float32)
    pixels, there = seen_from(pair.reference_camera, far, pair.target_camera)
    ray = truth.H_inf @ [120, 80, 1]
    assert np.allclose(pixels[80, 120], ray[:2] / ray[2]) and np.isinf(there).all()
    assert visible(pixels, there, far)[80, 120]


def test_a_square_hides_a_strip_of_the_wall_behind_it() -> None:
    """Square at 2 m before a wall at 4 m, step 0.2 m aside, f = 100: the square moves by 10 px, the wall by 5."""
    K = np.array([[100, 0, 49.5], [0, 100, 49.5], [0, 0, 1.0]])
    first = SceneCamera(K, np.eye(3), np.zeros(3), (100, 100))
    second = SceneCamera(K, np.eye(3), np.array([-0.2, 0, 0]), (100, 100))
    depth, other = np.full((100, 100), 4.0, np.float32), np.full((100, 100), 4.0, np.float32)
    depth[40:60, 40:60], other[40:60, 30:50] = 2.0, 2.0
    pixels, there = seen_from(first, depth, second)
    seen = visible(pixels, there, other)
    assert np.allclose(pixels[50, 50], [40, 50]) and np.allclose(pixels[50, 70], [65, 50])
    assert seen[40:60, 40:60].all(), "what is in front is never hidden"
    row = seen[50]
    assert not row[36:40].any() and row[8:34].all() and row[61:].all(), "wall at 35 to 39 shows at 30 to 34: behind it"
    assert not row[:5].any(), "beyond the other picture's edge"
    assert seen[20, 36:40].all()


def test_edges_are_not_flat_and_slopes_are() -> None:
    x = np.arange(100.0)
    slope = np.broadcast_to(1 / (0.2 + 0.002 * x), (60, 100)).astype(np.float32)
    assert flat(slope).all() and np.allclose(steepness(slope)[30, 50], 0.002 / 0.3, rtol=1e-3)
    step = slope.copy()
    step[:, 50:] *= 1.3
    assert not flat(step, 2)[:, 47:53].any() and flat(step, 2)[:, 54:].all() and flat(step, 2)[:, :46].all()


def test_on_the_spot_there_are_no_lines_but_a_rotation(truth: TrueGeometry, by_hand: SimpleNamespace) -> None:
    still = TrueGeometry(truth.K, truth.K_prime, truth.R, np.zeros(3), 0.0)
    assert np.isnan(still.F).all() and not still.e_prime.any()
    errors = pose_errors(view_of(truth, by_hand), still, SIZE)
    assert errors["rotation_deg"] < 1e-5 and errors["h_inf_px"] < 1e-5 and np.isnan(errors["f_px"])
