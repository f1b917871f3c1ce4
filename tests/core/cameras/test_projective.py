"""The two-view formulas: held against projecting 3-D points, and against definitions written out a second time."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import (
    ahead_of_camera,
    distance_to_line,
    fundamental_from_pose,
    homogeneous,
    in_front,
    infinite_homography,
    poses_from_fundamental,
    project,
    rotation_angle,
    rotation_from_vector,
    sampson_residuals,
    skew,
)
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

properties = settings(max_examples=40)
seeds = st.integers(0, 2**32 - 1)
K = np.array([[900.0, 25, 500], [0, 880, 380], [0, 0, 1]])
K_PRIME = np.array([[1100.0, -18, 480], [0, 1110, 400], [0, 0, 1]])


class Pair:
    """Two random cameras (the target turned by up to 34 degrees, any baseline direction) and points before both."""

    def __init__(self, seed: int, count: int = 50) -> None:
        random = np.random.default_rng(seed)
        self.random = random
        self.R = Rotation.from_rotvec(random.uniform(-0.35, 0.35, 3)).as_matrix()
        self.t = random.normal(size=3)
        self.t /= np.linalg.norm(self.t)
        points = random.uniform((-3, -3, 4), (3, 3, 12), (40 * count, 3))
        ok = (points @ self.R.T + self.t)[:, 2] > 0.5
        self.points = points[ok][:count]
        assert len(self.points) == count
        self.x = project(self.points @ K.T)
        self.y = project((self.points @ self.R.T + self.t) @ K_PRIME.T)
        self.F = fundamental_from_pose(K, K_PRIME, self.R, self.t)


def test_homogeneous_and_project_undo_each_other() -> None:
    points = np.random.default_rng(0).normal(size=(4, 5, 2))
    assert homogeneous(points).shape == (4, 5, 3)
    assert np.array_equal(homogeneous(points)[..., 2], np.ones((4, 5)))
    assert np.allclose(project(-3.5 * homogeneous(points)), points, rtol=1e-14)
    assert homogeneous(np.array([[1, 2]], np.int32)).dtype == np.float64


def test_skew_is_the_cross_product() -> None:
    v, w = np.random.default_rng(0).normal(size=(2, 3))
    assert np.allclose(skew(v) @ w, np.cross(v, w), rtol=1e-14)


@properties
@given(seeds, st.floats(-9, 0.49))
def test_rotation_vectors_of_any_size_become_their_rotations(seed: int, exponent: float) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    omega = axis / np.linalg.norm(axis) * 10**exponent
    R = rotation_from_vector(omega)
    assert np.allclose(R, Rotation.from_rotvec(omega).as_matrix(), atol=1e-14, rtol=0)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1)


def test_no_rotation_is_the_identity() -> None:
    assert np.array_equal(rotation_from_vector(np.zeros(3)), np.eye(3))
    assert np.allclose(rotation_from_vector(np.array([0, 1e-13, 0]))[0, 2], 1e-13, rtol=1e-9)


@properties
@given(seeds, st.floats(-7, 0.49))
def test_the_angle_between_rotations_is_right_down_to_the_tiniest(seed: int, exponent: float) -> None:
    random = np.random.default_rng(seed)
    start = Rotation.random(random_state=seed)
    axis = random.normal(size=3)
    angle = 10**exponent
    other = start * Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    # the matrices' entries are rounded at 1e-16; the arc cosine of the trace would be off by 1e-8
    found = np.radians(rotation_angle(start.as_matrix(), other.as_matrix()))
    assert found == pytest.approx(angle, abs=1e-14, rel=1e-9)


def test_the_angle_of_a_half_turn_is_180_degrees() -> None:
    assert rotation_angle(np.eye(3), np.diag([1.0, -1, -1])) == 180.0
    assert rotation_angle(np.eye(3), np.eye(3)) == 0.0


@properties
@given(seeds)
def test_f_has_rank_two_norm_one_and_true_matches_satisfy_it(seed: int) -> None:
    pair = Pair(seed)
    singular = np.linalg.svd(pair.F)[1]
    assert singular[2] < 1e-12 * singular[1]
    assert np.linalg.norm(pair.F) == pytest.approx(1)
    assert np.abs(sampson_residuals(pair.F, pair.x, pair.y)).max() < 1e-8
    assert distance_to_line(pair.F, pair.x, pair.y).max() < 1e-8


@properties
@given(seeds)
def test_the_epipoles_are_the_pictures_of_the_other_camera(seed: int) -> None:
    pair = Pair(seed)
    assert np.allclose(pair.F.T @ (K_PRIME @ pair.t), 0, atol=1e-11)
    place = -pair.R.T @ pair.t
    assert np.allclose(pair.F @ (K @ place), 0, atol=1e-11)


@properties
@given(seeds)
def test_the_one_equation_is_projecting_the_point(seed: int) -> None:
    """H_inf p + d e' with d = |baseline| / Z, third part positive just where the target camera has the point before
    it."""
    random = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed).as_matrix()
    baseline = random.normal(size=3) * 10 ** random.uniform(-2, 2)
    length = np.linalg.norm(baseline)
    points = random.uniform((-5, -5, 0.5), (5, 5, 20), (60, 3))
    there = points @ R.T + baseline
    x = project(points @ K.T)
    ray = homogeneous(x) @ infinite_homography(K, K_PRIME, R).T
    ray += (length / points[:, 2])[:, None] * (K_PRIME @ (baseline / length))
    assert np.array_equal(ray[:, 2] > 0, there[:, 2] > 0)
    # not only where it lies: the ray is the point itself, in units of its depth
    assert np.allclose(ray, there @ K_PRIME.T / points[:, 2:], rtol=1e-10, atol=1e-9)


def test_far_away_the_infinite_homography_is_all() -> None:
    pair = Pair(3)
    far = 1e9 * pair.points
    y = project((far @ pair.R.T + pair.t) @ K_PRIME.T)
    assert np.allclose(project(homogeneous(pair.x) @ infinite_homography(K, K_PRIME, pair.R).T), y, atol=1e-5)


@properties
@given(seeds)
def test_the_four_poses_hold_the_true_one_and_only_it_has_all_points_in_front(seed: int) -> None:
    pair = Pair(seed)
    # where the target moves along its axis a point may be seen under no angle at all: leave those to `slack`
    turned = homogeneous(pair.x) @ np.linalg.inv(K).T @ pair.R.T
    seen = homogeneous(pair.y) @ np.linalg.inv(K_PRIME).T
    parallax = np.linalg.norm(np.cross(turned, seen), axis=1) / np.linalg.norm(turned, axis=1)
    assume(parallax.min() > 1e-4)
    poses = poses_from_fundamental(pair.F, K, K_PRIME)
    assert len(poses) == 4
    right = 0
    for R, t in poses:
        assert np.allclose(R @ R.T, np.eye(3), atol=1e-12) and np.linalg.det(R) == pytest.approx(1)
        assert np.linalg.norm(t) == pytest.approx(1)
        true = rotation_angle(R, pair.R) < 1e-5 and t @ pair.t > 1 - 1e-12
        right += true
        assert in_front(K, K_PRIME, R, t, pair.x, pair.y).all() == true
    assert right == 1


def test_the_sign_of_f_does_not_matter_for_the_poses() -> None:
    pair = Pair(5)
    for F in (pair.F, -pair.F, 1e-7 * pair.F):
        assert min(rotation_angle(R, pair.R) for R, _ in poses_from_fundamental(F, K, K_PRIME)) < 1e-5


@properties
@given(seeds)
def test_in_front_is_told_from_behind_for_each_camera(seed: int) -> None:
    """Points anywhere around two cameras: in front exactly where both depths are positive."""
    random = np.random.default_rng(seed)
    R = Rotation.random(random_state=seed).as_matrix()
    t = random.normal(size=3)
    t /= np.linalg.norm(t)
    points = random.normal(size=(200, 3)) * 3
    there = points @ R.T + t
    depth, depth_prime = points[:, 2], there[:, 2]
    clear = (np.abs(depth) > 0.05) & (np.abs(depth_prime) > 0.05)
    parallax = np.linalg.norm(np.cross(points @ R.T, there), axis=1)
    clear &= parallax / np.linalg.norm(points, axis=1) / np.linalg.norm(there, axis=1) > 1e-4
    # a picture cannot tell a point from its mirror image behind the camera: it is seen at the same pixel
    x, y = project(points[clear] @ K.T), project(there[clear] @ K_PRIME.T)
    expected = (depth > 0)[clear] & (depth_prime > 0)[clear]
    assume(expected.any() and not expected.all())  # cameras back to back see nothing together
    assert np.array_equal(in_front(K, K_PRIME, R, t, x, y), expected)


def test_far_points_count_as_in_front_within_the_slack() -> None:
    R = Rotation.from_rotvec([0.02, -0.1, 0.01]).as_matrix()
    t = np.array([1.0, 0, 0])
    x = np.random.default_rng(0).uniform((100, 100), (900, 600), (100, 2))
    at_infinity = homogeneous(x) @ infinite_homography(K, K_PRIME, R).T

    def beyond(d: float) -> np.ndarray:
        return project(at_infinity + d * K_PRIME @ t)

    # d is the parallax angle, give or take the point's obliqueness (below 40 degrees here)
    assert not in_front(K, K_PRIME, R, t, x, beyond(-1e-3)).any()
    assert in_front(K, K_PRIME, R, t, x, beyond(-1e-3), slack=2e-3).all()
    assert not in_front(K, K_PRIME, R, t, x, beyond(-5e-3), slack=2e-3).any()
    assert in_front(K, K_PRIME, R, t, x, beyond(1e-3)).all()
    # rays that look away from each other are parallel too, and not in front
    away = R @ np.diag([-1.0, 1, -1])
    centre = np.array([[K[0, 2], K[1, 2]]])
    opposite = project(homogeneous(centre) @ infinite_homography(K, K_PRIME, R).T)
    assert not in_front(K, K_PRIME, away, t, centre, opposite, slack=2e-3).any()


def nearest_correction(F: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
    """The least movement of the pair (x, y) in R⁴ that satisfies y'ᵀ F x' = 0, by brute force."""

    def constraint(v: np.ndarray) -> float:
        return 1e3 * float(np.r_[y + v[2:], 1] @ F @ np.r_[x + v[:2], 1])

    found = [
        minimize(
            lambda v: v @ v, start, jac=lambda v: 2 * v, constraints={"type": "eq", "fun": constraint},
            method="SLSQP", options={"ftol": 1e-14, "maxiter": 200},
        )
        for start in np.vstack([np.zeros(4), np.eye(4)])
    ]  # fmt: skip
    fits = [np.sqrt(f.fun) for f in found if abs(constraint(f.x)) < 1e-8]
    return min(fits)


@pytest.mark.parametrize("seed", range(3))
def test_sampson_is_the_distance_to_the_nearest_true_match_to_first_order(seed: int) -> None:
    pair = Pair(seed, 1)
    F = 1e3 * pair.F
    epipoles = project(K_PRIME @ pair.t), project(K @ (pair.R.T @ pair.t))
    reach = min(np.linalg.norm(pair.y - epipoles[0]), np.linalg.norm(pair.x - epipoles[1]))
    assert reach > 60, "the curvature near the epipole is another matter"
    direction = pair.random.normal(size=4)
    error = []
    for size in (4.0, 1.0):
        x, y = pair.x + size * direction[:2], pair.y + size * direction[2:]
        sampson, true = abs(sampson_residuals(F, x, y)[0]), nearest_correction(F, x[0], y[0])
        error.append(abs(sampson - true))
        # the relative error of the first order is about the correction over the distance of the epipole
        assert error[-1] < true * size * np.linalg.norm(direction) / reach + 1e-5
    # what is left out is of second order: a quarter the noise, a sixteenth the error (or rounding)
    assert error[1] < error[0] / 8 + 2e-5


def test_sampson_residuals_carry_the_side_of_the_line_and_no_scale_of_f() -> None:
    pair = Pair(2)
    normal = (homogeneous(pair.x) @ pair.F.T)[:, :2]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    one, other = (sampson_residuals(pair.F, pair.x, pair.y + side * normal) for side in (0.5, -0.5))
    assert (one > 0).all() and (other < 0).all()
    assert np.allclose(sampson_residuals(1e-6 * pair.F, pair.x, pair.y + 0.5 * normal), one, rtol=1e-9)
    # the error may be put right in either picture, so the distance is less than that to the line alone
    assert (one < 0.5).all()


def test_the_distance_to_a_line_is_measured_in_the_target_picture() -> None:
    pair = Pair(2)
    line = homogeneous(pair.x) @ pair.F.T
    normal = line[:, :2] / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    for side in (3.0, -3.0):
        assert np.allclose(distance_to_line(pair.F, pair.x, pair.y + side * normal + 40 * along), 3, atol=1e-7)


@pytest.mark.parametrize(
    "t, at_infinity", [((1, 0, 0), True), ((0.6, -0.8, 0), True), ((0.02, 0.03, -1), False), ((0, 0, 1), False)]
)
def test_the_epipole_may_lie_at_infinity_or_in_the_picture(t: tuple[float, ...], at_infinity: bool) -> None:
    direction = np.array(t) / np.linalg.norm(t)
    R = np.eye(3)
    F = fundamental_from_pose(K, K, R, direction)
    e = K @ direction
    assert (abs(e[2]) < 1e-12) == at_infinity
    points = np.random.default_rng(0).uniform((-2, -2, 4), (2, 2, 9), (100, 3))
    x, y = project(points @ K.T), project((points + direction) @ K.T)
    assert np.abs(sampson_residuals(F, x, y)).max() < 1e-8
    # 2 px across the line, on both sides
    line = homogeneous(x) @ F.T
    off = y + 2 * line[:, :2] / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    assert np.allclose(distance_to_line(F, x, off), 2, atol=1e-7)
    assert in_front(K, K, R, direction, x, y).all()
    poses = poses_from_fundamental(F, K, K)
    assert any(rotation_angle(S, R) < 1e-5 and u @ direction > 1 - 1e-12 for S, u in poses)
    if not at_infinity:  # at the epipole itself there is no line: nothing may blow up
        here = project(e)[None]
        with np.errstate(all="raise"):
            assert np.isfinite(sampson_residuals(F, here, here)).all()
            assert np.isfinite(distance_to_line(F, here, here)).all()
            assert np.isfinite(in_front(K, K, R, direction, here, here)).all()


def test_what_lies_ahead_of_a_camera_is_told_by_its_third_coordinate_relative_to_the_others() -> None:
    points = np.array([[100.0, 50, 1], [100, 50, -1], [100, 50, 0], [2e6, 50, 1], [50, -2e6, 1], [0.5e6, 0, 1]])
    assert ahead_of_camera(*points.T).tolist() == [True, False, False, False, False, True]
    assert not ahead_of_camera(np.array([np.nan, 1.0]), np.array([1.0, 1.0]), np.array([1.0, np.nan])).any()
