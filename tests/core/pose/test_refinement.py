"""Refinement of pose and focal length: its derivatives, that it descends, its priors, and how sure it says it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import (
    homogeneous,
    in_front,
    infinite_homography,
    poses_from_fundamental,
    project,
    rotation_angle,
    rotation_from_vector,
    sampson_residuals,
)
from edf_stitch.core.pose.options import REFINEMENT
from edf_stitch.core.pose.refinement import (
    Pose,
    _Problem,
    cheirality_residual,
    focal_deviations,
    refine_pose,
    shared_focal_sigma,
)
from hypothesis import given, settings
from hypothesis import strategies as st

ASSUMED_SIGMA, EXIF_SIGMA, PRINCIPAL_SIGMA = INTRINSICS.assumed_sigma, INTRINSICS.exif_sigma, INTRINSICS.principal_sigma
FREEDOM, EFFECTIVE_MATCHES = REFINEMENT.prior_freedom, REFINEMENT.effective_matches
SIZE = (1200, 900)
FOCAL = 1000.0
CONVERGING = rotation_from_vector(np.radians([4.0, -14.0, 5.0]))
BASELINE = np.array([0.9, -0.35, 0.25]) / np.linalg.norm([0.9, -0.35, 0.25])
SIDEWAYS = np.array([1.0, 0, 0])


def intrinsics(focal: float) -> np.ndarray:
    return np.array([[focal, 0, 599.5], [0, focal, 449.5], [0, 0, 1]])


def camera(focal: float = FOCAL, log_sigma: float = 0.0, principal_sigma: float | None = None) -> Camera:
    """Its principal point is as unknown as its focal length, if not said otherwise."""
    if principal_sigma is None:
        principal_sigma = PRINCIPAL_SIGMA if log_sigma == ASSUMED_SIGMA else 0.0
    knowledge = Knowledge.ASSUMED if log_sigma == ASSUMED_SIGMA else Knowledge.EXIF
    return Camera(intrinsics(focal), SIZE, "test", log_sigma, principal_sigma=principal_sigma, knowledge=knowledge)


def scene(
    seed: int = 0, count: int = 200, noise: float = 0.5, R: np.ndarray = CONVERGING, t: np.ndarray = BASELINE,
    focals: tuple[float, float] = (FOCAL, FOCAL), depth: tuple[float, float] = (2.5, 9.0),
) -> tuple[Matches, Pose]:  # fmt: skip
    """Points at random depths (in baselines), seen by both cameras; noise is that of each coordinate, px."""
    random = np.random.default_rng(seed)
    K, K_prime = (intrinsics(f) for f in focals)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (12 * count, 2))
    there = (homogeneous(x) @ np.linalg.inv(K).T * random.uniform(*depth, (12 * count, 1))) @ R.T + t
    y = project(there @ K_prime.T)
    ok = (there[:, 2] > 0) & (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y = x[ok][:count], y[ok][:count]
    assert len(x) == count
    return (
        Matches(x + random.normal(0, noise, x.shape), y + random.normal(0, noise, y.shape)),
        Pose(K, K_prime, R, t),
    )


def nudged(pose: Pose, degrees: float, factor: float = 1.0, seed: int = 0) -> Pose:
    random = np.random.default_rng(seed)
    turn = random.normal(size=3)
    R = rotation_from_vector(np.radians(degrees) * turn / np.linalg.norm(turn)) @ pose.R
    t = pose.t + np.radians(degrees) * random.normal(size=3)
    scale = np.diag([factor, factor, 1.0])
    K, K_prime = pose.K.copy(), pose.K_prime.copy()
    K[:2, :2], K_prime[:2, :2] = scale[:2, :2] @ K[:2, :2], scale[:2, :2] @ K_prime[:2, :2]
    return Pose(K, K_prime, R, t / np.linalg.norm(t))


# --- derivatives ---------------------------------------------------------------------------------------------------

KINDS = {
    "fixed": (0.0, False, 0.0, 5),
    "one focal length": (0.2, False, 0.0, 6),
    "two focal lengths": (0.2, True, 0.0, 7),
    "assumed, so with a principal point": (ASSUMED_SIGMA, False, PRINCIPAL_SIGMA, 8),
    "assumed, two focal lengths": (ASSUMED_SIGMA, True, PRINCIPAL_SIGMA, 9),
    "focal length from EXIF, and a principal point": (0.05, False, PRINCIPAL_SIGMA, 8),
    "a principal point alone": (0.0, False, PRINCIPAL_SIGMA, 7),
}


def numeric_gradient(problem: _Problem, pose: Pose) -> np.ndarray:
    """Of half the cost, by central differences."""
    h = 1e-6
    return np.array([
        (problem.cost(problem.updated(pose, step)) - problem.cost(problem.updated(pose, -step))) / (4 * h)
        for step in h * np.eye(problem.size)
    ])  # fmt: skip


@pytest.mark.parametrize("log_sigma, zoom, principal, size", KINDS.values(), ids=KINDS.keys())
@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_is_that_of_half_the_cost(
    log_sigma: float, zoom: bool, principal: float, size: int, seed: int
) -> None:
    matches, true = scene(seed, 400, noise=2.0)
    cam = camera(1.1 * FOCAL, log_sigma, principal)
    pose = nudged(true, 3.0, 0.9, seed)
    problem = _Problem(matches, cam, cam, 1.0, zoom)
    _, gradient = problem.normal_equations(pose)
    assert gradient.shape == (size,)
    numeric = numeric_gradient(problem, pose)
    assert np.allclose(gradient, numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())


@pytest.mark.parametrize("outliers", [0, 60])
def test_the_gradient_also_counts_points_beyond_infinity(outliers: int) -> None:
    """And of those that are off their lines as well, as much as the one loss for both leaves."""
    matches, true = scene(1, 200, depth=(20.0, 60.0), R=np.eye(3), t=SIDEWAYS)
    matches.y[:outliers, 1] += np.random.default_rng(1).uniform(-30, 30, outliers)
    cam = camera(FOCAL, ASSUMED_SIGMA)
    turned = Pose(true.K, true.K_prime, rotation_from_vector(np.radians([0, 3.0, 0])), true.t)
    problem = _Problem(matches, cam, cam, 1.0, False)
    assert (cheirality_residual(turned, matches.x, matches.y) < -5).mean() > 0.3
    _, gradient = problem.normal_equations(turned)
    numeric = numeric_gradient(problem, turned)
    assert np.allclose(gradient, numeric, rtol=1e-3, atol=1e-4 * np.abs(numeric).max())


@pytest.mark.parametrize("log_sigma, zoom, principal, size", KINDS.values(), ids=KINDS.keys())
def test_the_normal_matrix_is_made_of_the_residuals_derivatives(
    log_sigma: float, zoom: bool, principal: float, size: int
) -> None:
    """JᵀWJ with J by finite differences of the Sampson distances themselves."""
    matches, true = scene(2, 100, noise=0.7)
    cam = camera(1.05 * FOCAL, log_sigma, principal)
    pose = nudged(true, 0.5, 1.0)
    sigma = 0.8
    problem = _Problem(matches, cam, cam, sigma, zoom)
    assert not cheirality_residual(pose, matches.x, matches.y).any()

    def residuals(step: np.ndarray) -> np.ndarray:
        return sampson_residuals(problem.updated(pose, step).F, matches.x, matches.y) / sigma

    def prior(step: np.ndarray) -> np.ndarray:
        moved = problem.updated(pose, step)
        first, second = (np.log(K[0, 0] / cam.focal) for K in (moved.K, moved.K_prime))
        out = [] if log_sigma == 0 else [first / log_sigma]
        if log_sigma == ASSUMED_SIGMA:
            out = [np.sign(first) * np.sqrt(FREEDOM * np.log1p((first / log_sigma) ** 2 / FREEDOM))]
        if principal:
            out += list((moved.K - cam.K)[:2, 2] / (principal * SIZE[0]))
        return np.array(out + ([(second - first) / 0.3] if zoom else []))

    h = 1e-6
    J = np.column_stack([(residuals(step) - residuals(-step)) / (2 * h) for step in h * np.eye(size)])
    weight = 1 / (1 + residuals(np.zeros(size)) ** 2)
    expected = (J * weight[:, None]).T @ J
    of_prior = np.column_stack([(prior(step) - prior(-step)) / (2 * h) for step in h * np.eye(size)])
    expected += of_prior.T @ of_prior
    normal, _ = problem.normal_equations(pose)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((normal - expected) / scale).max() < 1e-6


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_step_stays_among_the_poses(seed: int) -> None:
    random = np.random.default_rng(seed)
    matches, true = scene(0, 20)
    t = random.normal(size=3)
    pose = Pose(true.K, true.K_prime, true.R, t / np.linalg.norm(t))
    cam = camera(FOCAL, ASSUMED_SIGMA)
    problem = _Problem(matches, cam, cam, 1.0, True)
    step = random.normal(size=9)
    moved = problem.updated(pose, step)
    assert np.allclose(moved.R @ moved.R.T, np.eye(3), atol=1e-12) and np.linalg.det(moved.R) == pytest.approx(1)
    assert np.linalg.norm(moved.t) == pytest.approx(1)
    assert moved.K[0, 0] == pytest.approx(moved.K[1, 1]) and moved.K[2].tolist() == [0, 0, 1]
    # one sensor behind both pictures: the principal point is the same, in units of how far off it is expected to be
    for K in (moved.K, moved.K_prime):
        assert np.allclose(K[:2, 2] - pose.K[:2, 2], PRINCIPAL_SIGMA * SIZE[0] * step[2:4])
    still = problem.updated(pose, np.zeros(9))
    for a, b in ((still.K, pose.K), (still.R, pose.R), (still.t, pose.t)):
        assert np.allclose(a, b, atol=1e-14)
    # the unknowns are independent: every direction of t that is not its length can be reached
    small = np.linalg.norm([problem.updated(pose, 1e-4 * step).t - pose.t for step in np.eye(9)], axis=1)
    assert np.allclose(small, [0] * 7 + [1e-4] * 2, atol=1e-7)


def test_the_principal_point_is_free_only_where_it_is_unknown_and_one_sensor_took_both_pictures() -> None:
    matches, true = scene(0, 100, noise=1.0)
    for first, second, free in (
        (camera(FOCAL, ASSUMED_SIGMA), camera(FOCAL, ASSUMED_SIGMA), True),
        (camera(FOCAL, 0.05), camera(FOCAL, 0.05), False),
        (camera(FOCAL, 0.05, PRINCIPAL_SIGMA), camera(FOCAL, 0.05, PRINCIPAL_SIGMA), True),
        (camera(FOCAL, 0.0, PRINCIPAL_SIGMA), camera(FOCAL, 0.0, PRINCIPAL_SIGMA), True),
        (camera(FOCAL, 0.0, PRINCIPAL_SIGMA), camera(), False),
        (camera(), camera(), False),
        (camera(FOCAL, ASSUMED_SIGMA), replace(camera(FOCAL, ASSUMED_SIGMA), size=(900, 1200)), False),
    ):
        found, _ = refine_pose(matches, true, first, second, 1.0)
        aside = (found.K - true.K)[:2, 2]
        assert aside.any() == free and np.allclose(aside, (found.K_prime - true.K_prime)[:2, 2], atol=1e-9)
        assert np.abs(aside).max() < 2 * PRINCIPAL_SIGMA * SIZE[0]


# --- descent -------------------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.floats(0, 90), st.sampled_from([0.0, 0.05, ASSUMED_SIGMA]), st.booleans())
def test_the_cost_never_rises(seed: int, degrees: float, log_sigma: float, zoom: bool) -> None:
    matches, true = scene(seed, 60, noise=1.0)
    random = np.random.default_rng(seed)
    matches.y[:20] = random.uniform((0, 0), SIZE, (20, 2))  # outliers too
    cam = camera(1.15 * FOCAL, log_sigma)
    pose = nudged(true, degrees, 1.0, seed)
    problem = _Problem(matches, cam, cam, 1.0, zoom)
    costs = [problem.cost(pose)]
    for iterations in (1, 2, 4, 20):
        refined, cost = refine_pose(matches, pose, cam, cam, 1.0, zoom, iterations)
        assert cost == pytest.approx(problem.cost(refined), rel=1e-9)
        costs.append(cost)
    assert (np.diff(costs) <= 0).all()


def test_clean_matches_give_the_true_pose_back() -> None:
    matches, true = scene(3, 100, noise=0.0)
    found, cost = refine_pose(matches, nudged(true, 4.0), camera(), camera(), 0.5)
    assert cost < 1e-9
    assert rotation_angle(found.R, true.R) < 1e-4 and found.t @ true.t > 1 - 1e-11


def test_a_common_focal_length_is_found_from_clean_matches() -> None:
    matches, true = scene(3, 200, noise=0.0)
    cam = camera(1.2 * FOCAL, 0.3)
    found, _ = refine_pose(matches, nudged(true, 2.0, 1.2), cam, cam, 0.5)
    # what holds it back is the prior's pull alone
    pull = np.log(1.2) * (focal_deviations(matches, found, cam, cam, 0.5, False)[0] / 0.3) ** 2
    assert np.log(found.K[0, 0] / FOCAL) == pytest.approx(pull, rel=0.1)
    assert pull < 0.01
    assert found.K_prime[0, 0] == pytest.approx(found.K[0, 0])


def test_a_second_focal_length_is_found_where_it_is_asked_for() -> None:
    matches, true = scene(4, 300, noise=0.0, focals=(1000.0, 1300.0))
    cam = camera(1000.0, 0.05)
    start = Pose(cam.K, cam.K, true.R, true.t)
    common, common_cost = refine_pose(matches, start, cam, cam, 0.5)
    assert common.K_prime[0, 0] == pytest.approx(common.K[0, 0])
    zoomed, zoomed_cost = refine_pose(matches, common, cam, cam, 0.5, zoom=True, iterations=50)
    assert zoomed_cost < 0.2 * common_cost
    assert zoomed.K_prime[0, 0] / zoomed.K[0, 0] == pytest.approx(1.3, rel=0.01)


@pytest.mark.parametrize("fixed", [(True, True), (True, False), (False, True)])
@pytest.mark.parametrize("zoom", [False, True])
def test_a_given_focal_length_stays(fixed: tuple[bool, bool], zoom: bool) -> None:
    matches, true = scene(5, 100, noise=1.0)
    first, second = (camera(1.1 * FOCAL, 0.0 if one else ASSUMED_SIGMA) for one in fixed)
    start = Pose(first.K, second.K, true.R, true.t)
    found, _ = refine_pose(matches, start, first, second, 1.0, zoom)
    assert np.array_equal(found.K, first.K) and np.array_equal(found.K_prime, second.K)
    assert not np.array_equal(found.R, true.R)


@pytest.mark.parametrize("seed", range(6, 10))
def test_outliers_hardly_matter(seed: int) -> None:
    matches, true = scene(seed, 200, noise=0.5)
    normal, _ = _Problem(matches, camera(), camera(), 0.5, False).normal_equations(true)
    deviation = np.degrees(np.sqrt(np.trace(np.linalg.inv(normal)[:3, :3])))  # of the rotation, 0.06 degrees
    without, _ = refine_pose(matches.subset(np.arange(200) % 5 > 0), true, camera(), camera(), 0.5)
    random = np.random.default_rng(seed)
    matches.y[::5] += random.uniform(20, 200, (40, 2)) * random.choice([-1, 1], (40, 2))
    found, _ = refine_pose(matches, true, camera(), camera(), 0.5)
    # an outlier at r pulls like σ/r, but those beyond infinity all one way; squared errors would move it by degrees
    assert rotation_angle(found.R, without.R) < 2 * deviation
    assert rotation_angle(found.R, true.R) < 4 * deviation


def test_a_tight_prior_holds_where_a_loose_one_yields() -> None:
    matches, true = scene(7, 60, noise=1.5)
    off = []
    for log_sigma in (0.4, 0.05, 0.005):
        cam = camera(1.3 * FOCAL, log_sigma)
        found, _ = refine_pose(matches, Pose(cam.K, cam.K, true.R, true.t), cam, cam, 1.5, iterations=50)
        off.append(np.log(found.K[0, 0] / cam.focal))
    assert abs(off[0] + np.log(1.3)) < 0.05  # the data decide
    assert abs(off[2]) < 0.01  # the prior decides
    assert off[0] < off[1] < off[2] < 0


def test_many_matches_do_not_overrule_a_prior_by_their_number() -> None:
    """Neighbours err together: ten times as many of the same matches are no more evidence."""
    matches, true = scene(8, EFFECTIVE_MATCHES, noise=1.5)
    many = Matches(np.tile(matches.x, (10, 1)), np.tile(matches.y, (10, 1)))
    cam = camera(1.2 * FOCAL, 0.02)
    start = Pose(cam.K, cam.K, true.R, true.t)
    once, cost = refine_pose(matches, start, cam, cam, 1.5)
    tenfold, cost_tenfold = refine_pose(many, start, cam, cam, 1.5)
    assert cost_tenfold == pytest.approx(cost, rel=1e-6)
    assert tenfold.K[0, 0] == pytest.approx(once.K[0, 0], rel=1e-4)


# --- points beyond infinity ----------------------------------------------------------------------------------------


def test_how_far_a_match_lies_beyond_infinity_is_measured_along_its_line() -> None:
    for R, t in ((np.eye(3), SIDEWAYS), (CONVERGING, BASELINE), (np.eye(3), np.array([0.1, 0, -1.0]))):
        matches, true = scene(9, 50, noise=0.0, R=R, t=t / np.linalg.norm(t), depth=(6.0, 12.0))
        assert not cheirality_residual(true, matches.x, matches.y).any()
        ray = homogeneous(matches.x) @ infinite_homography(true.K, true.K_prime, true.R).T
        infinity = project(ray)
        towards = matches.y - infinity
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        across = np.column_stack([-towards[:, 1], towards[:, 0]])
        for px in (0.5, 7.0):
            found = cheirality_residual(true, matches.x, infinity - px * towards + 3 * across)
            assert np.allclose(found, -px, atol=1e-6)


def test_cameras_on_two_sides_of_a_thing_have_it_in_front() -> None:
    """Turned by 120 degrees, what is infinitely far for the reference lies behind the target; its things do not."""
    random = np.random.default_rng(0)
    R = rotation_from_vector(np.radians([0.0, 120, 0]))
    centre = np.array([0.0, 0, 5])
    points = centre + random.uniform(-1.2, 1.2, (100, 3))
    t = centre - R @ centre
    length = np.linalg.norm(t)
    there = points @ R.T + t
    assert (there[:, 2] > 0).all()
    pose = Pose(intrinsics(FOCAL), intrinsics(FOCAL), R, t / length)
    x, y = project(points @ pose.K.T), project(there @ pose.K_prime.T)
    assert ((homogeneous(x) @ infinite_homography(pose.K, pose.K_prime, R).T)[:, 2] < 0).all()
    assert in_front(pose.K, pose.K_prime, R, pose.t, x, y).all()
    assert not cheirality_residual(pose, x, y).any()
    found, cost = refine_pose(Matches(x, y), nudged(pose, 1.0), camera(), camera(), 0.5)
    assert cost < 1e-9 and rotation_angle(found.R, R) < 1e-4


def test_points_pushed_behind_infinity_are_pulled_back() -> None:
    """Half the true focal length, taken for certain, which leaves residuals of many pixels: on the Sampson distance
    alone half of the points end up behind the cameras."""
    for seed in range(3):
        matches, true = scene(seed, 300, depth=(4.0, 15.0), R=rotation_from_vector(np.radians([2.0, -12, 3])),
                              t=np.array([1, 0.1, 0.15]) / np.linalg.norm([1, 0.1, 0.15]))  # fmt: skip
        cam = camera(0.5 * FOCAL)
        found, _ = refine_pose(matches, Pose(cam.K, cam.K, true.R, true.t), cam, cam, 5.0, iterations=60)
        beyond = cheirality_residual(found, matches.x, matches.y)
        assert (beyond < -REFINEMENT.cheirality_sigma_px).mean() < 0.15
        assert in_front(found.K, found.K_prime, found.R, found.t, matches.x, matches.y).mean() > 0.85


def test_where_all_points_are_in_front_infinity_has_no_say() -> None:
    matches, true = scene(0, 100, noise=0.0)
    problem = _Problem(matches, camera(), camera(), 1.0, False)
    assert problem.cost(true) < 1e-15


@pytest.mark.parametrize("across", [60.0, -90.0])
def test_what_is_off_its_line_has_no_say_about_infinity(across: float) -> None:
    """An outlier is wrong already: to put it in front of the cameras gains less than moving an inlier by half a σ."""
    matches, true = scene(9, 50, noise=0.0, R=np.eye(3), t=SIDEWAYS)
    costs = []
    for along in (10.0, -40.0):  # before and beyond its point at infinity, which is x itself
        matches.y[0] = matches.x[0] + (along, across)
        costs.append(_Problem(matches, camera(), camera(), 0.5, False).cost(true))
    assert 0 < costs[1] - costs[0] < np.log1p(0.5**2) / 2
    matches.y[0] = matches.x[0] + (-40.0, 0)  # an inlier of its line by chance is held in front
    assert _Problem(matches, camera(), camera(), 0.5, False).cost(true) > 5


# --- what is believed of the focal length --------------------------------------------------------------------------


@pytest.mark.parametrize("z", [-6.0, -1.5, -0.1, 0.0, 1e-6, 0.5, 2.0, 8.0])
def test_an_assumption_pulls_less_the_further_it_is_off(z: float) -> None:
    """Student's tails for a guess, a normal distribution for what the file says."""
    matches, true = scene(0, 20)
    for log_sigma in (0.05, ASSUMED_SIGMA):
        cam = camera(FOCAL, log_sigma)
        problem = _Problem(matches, cam, cam, 1.0, False)

        def prior(log_factor: float, problem: _Problem = problem) -> tuple[float, float]:
            K = intrinsics(FOCAL * np.exp(log_factor))
            residual, derivative = problem.priors(Pose(K, K, true.R, true.t))[0]
            return residual, derivative[0]

        at, slope = prior(z * log_sigma)
        cost = FREEDOM * np.log1p(z**2 / FREEDOM) if log_sigma == ASSUMED_SIGMA else z**2
        assert at**2 == pytest.approx(cost, rel=1e-6, abs=1e-18) and at * z >= 0
        h = 1e-5 * log_sigma
        # the slope is that of Gauss and Newton's gradient: at · slope is half the cost's derivative
        numeric = (prior(z * log_sigma + h)[0] ** 2 - prior(z * log_sigma - h)[0] ** 2) / (4 * h)
        assert at * slope == pytest.approx(numeric, rel=1e-4, abs=1e-9)
        assert 0 < slope <= 1.0001 / log_sigma


# in longer sides; the assumption is 0.9, and 0.5 to 5.0 are what two_view starts from
@pytest.mark.parametrize(
    "true_sides, start_sides", [(0.5, 0.9), (2.5, 0.9), (4.0, 0.9), (0.5, 1.6), (5.0, 3.2), (6.0, 5.0)]
)
def test_a_focal_length_far_from_the_assumed_one_is_reached_and_kept(true_sides: float, start_sides: float) -> None:
    """From what F says about the cameras at another focal length."""
    focal = true_sides * SIZE[0]
    R = rotation_from_vector(np.radians([6.0, -10, 4]) / true_sides)
    matches, true = scene(3, 300, noise=0.2, R=R, t=BASELINE, focals=(focal, focal), depth=(4.0, 12.0))
    cam, K = camera(0.9 * SIZE[0], ASSUMED_SIGMA), intrinsics(start_sides * SIZE[0])
    poses = poses_from_fundamental(true.F, K, K)
    front = [in_front(K, K, *pose, matches.x, matches.y).sum() for pose in poses]
    found, cost = refine_pose(matches, Pose(K, K, *poses[int(np.argmax(front))]), cam, cam, 0.2)
    _, least = refine_pose(matches, true, cam, cam, 0.2)
    assert cost < 1.001 * least
    with_prior, _ = focal_deviations(matches, found, cam, cam, 0.2, False)
    assert abs(np.log(found.K[0, 0] / focal)) < 3 * with_prior


# --- weights -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("log_sigma, count", [(0.0, 120), (0.2, EFFECTIVE_MATCHES), (ASSUMED_SIGMA, EFFECTIVE_MATCHES)])
def test_a_match_of_weight_w_counts_like_w_copies(log_sigma: float, count: int) -> None:
    matches, true = scene(13, count, noise=1.0)
    weights = np.random.default_rng(13).integers(1, 5, count)
    copies = Matches(np.repeat(matches.x, weights, axis=0), np.repeat(matches.y, weights, axis=0))
    cam = camera(1.1 * FOCAL, log_sigma)
    start = nudged(true, 0.5)
    weighted, unweighted, copied = (
        refine_pose(m, start, cam, cam, 1.0)[0]
        for m in (replace(matches, weight=weights.astype(float)), matches, copies)
    )
    assert rotation_angle(weighted.R, copied.R) < 1e-3 < rotation_angle(unweighted.R, copied.R)
    assert weighted.K[0, 0] == pytest.approx(copied.K[0, 0], rel=1e-4)
    # only the ratios of the weights count
    scaled, _ = refine_pose(replace(matches, weight=7.0 * weights), start, cam, cam, 1.0)
    assert np.allclose(scaled.R, weighted.R, atol=1e-9) and np.allclose(scaled.K, weighted.K, rtol=1e-9)


# --- how sure it is ------------------------------------------------------------------------------------------------


def test_the_focal_deviation_shrinks_as_information_adds_up() -> None:
    """1/σ² = 1/prior² + n × the same per match, until more matches are no more evidence."""
    matches, true = scene(10, 4 * EFFECTIVE_MATCHES, noise=0.0)
    cam = camera(FOCAL, 0.3)
    information = []
    for count in (75, 150, 300, 4 * EFFECTIVE_MATCHES):
        with_prior, alone = focal_deviations(matches.subset(np.arange(count)), true, cam, cam, 1.0, False)
        assert with_prior**-2 == pytest.approx(alone**-2 + 0.3**-2, rel=1e-6)
        information.append(alone**-2)
    assert information[1] / information[0] == pytest.approx(2, rel=0.25)
    assert information[2] / information[0] == pytest.approx(4, rel=0.25)
    assert information[3] == pytest.approx(information[2], rel=0.25)


def test_the_focal_deviation_is_in_proportion_to_the_noise_but_not_below_the_systematic() -> None:
    matches, true = scene(10, 200, noise=0.0)
    cam = camera(FOCAL, 0.3)

    def alone(sigma: float, scale: float = 1.0) -> float:
        return focal_deviations(replace(matches, scale=scale), true, cam, cam, sigma, False)[1]

    assert alone(2.0) == pytest.approx(2 * alone(1.0), rel=1e-6)
    assert alone(0.01) == pytest.approx(REFINEMENT.systematic_px * alone(1.0), rel=1e-6)
    assert alone(0.01, scale=3.0) == pytest.approx(3 * REFINEMENT.systematic_px * alone(1.0), rel=1e-6)


@pytest.mark.parametrize("log_sigma", [0.05, ASSUMED_SIGMA])
def test_where_the_matches_say_nothing_the_prior_is_left(log_sigma: float) -> None:
    """Axes that are parallel: every focal length explains the matches (docs/method.md, 3)."""
    matches, true = scene(11, 300, noise=0.0, R=np.eye(3), t=SIDEWAYS)
    cam = camera(FOCAL, log_sigma)
    with_prior, alone = focal_deviations(matches, true, cam, cam, 1.0, False)
    assert with_prior == pytest.approx(log_sigma, rel=1e-3) and alone > 10
    found, _ = refine_pose(scene(11, 300, noise=0.5, R=np.eye(3), t=SIDEWAYS)[0], true, cam, cam, 0.5)
    assert abs(np.log(found.K[0, 0] / FOCAL)) < log_sigma


def test_a_second_free_focal_length_leaves_the_first_less_sure() -> None:
    """Axes in one plane tell a common focal length but not two (docs/method.md, 3)."""
    level = rotation_from_vector(np.radians([0.0, -15, 0]))
    matches, true = scene(11, 300, noise=0.0, R=level, t=np.array([0.9, 0, 0.436]))
    cam = camera(FOCAL, 0.3)
    common, two = (focal_deviations(matches, true, cam, cam, 1.0, zoom)[1] for zoom in (False, True))
    assert common < 0.1 and two > 2 * common


@pytest.mark.parametrize("log_sigma, aside", [(0.3, 0.0), (ASSUMED_SIGMA, 0.01)], ids=["EXIF", "assumed"])
def test_the_focal_deviation_is_what_repeating_the_measurement_scatters(log_sigma: float, aside: float) -> None:
    """Sixty draws of the noise, and of where the axis meets an unknown sensor (aside: in longer sides); their scatter
    is known to ± 9 %, and the Cauchy loss costs and claims some 10 %."""
    cam = camera(FOCAL, log_sigma)
    logs, claims = [], []
    clean, true = scene(12, 150, noise=0.0)
    noise = 0.3 if aside else 1.0  # so that the sensor matters
    random = np.random.default_rng(12)
    for _ in range(60):
        moved = random.normal(0, aside * SIZE[0], 2)
        noisy = Matches(
            clean.x + moved + random.normal(0, noise, clean.x.shape),
            clean.y + moved + random.normal(0, noise, clean.y.shape),
        )
        found, _ = refine_pose(noisy, true, cam, cam, noise)
        logs.append(np.log(found.K[0, 0] / FOCAL))
        claims.append(focal_deviations(noisy, found, cam, cam, noise, False)[0])
    assert 0.75 < np.median(claims) / np.std(logs) < 1.5
    assert abs(np.mean(logs)) < 3 * np.std(logs) / np.sqrt(60) + 0.1 * np.std(logs)


@pytest.mark.parametrize("which", [0, 1])
def test_each_cameras_own_prior_counts_by_its_precision(which: int) -> None:
    """Axes that are parallel leave the focal length to what is known; it is known well of one camera only."""
    matches, true = scene(noise=0.3, R=np.eye(3), t=SIDEWAYS)
    start = 1.1 * FOCAL
    cameras = [camera(FOCAL, ASSUMED_SIGMA, 0.0), camera(FOCAL, ASSUMED_SIGMA, 0.0)]
    cameras[which] = camera(FOCAL, 0.002)
    assert shared_focal_sigma(*cameras) < 0.002
    K = intrinsics(start)
    found, _ = refine_pose(matches, Pose(K, K, true.R, true.t), *cameras, sigma=0.3)
    assert abs(found.K[0, 0] / FOCAL - 1) < 0.004


def test_what_is_known_in_one_way_of_both_cameras_counts_once() -> None:
    assert shared_focal_sigma(camera(log_sigma=EXIF_SIGMA), camera(log_sigma=EXIF_SIGMA)) == EXIF_SIGMA
    assert shared_focal_sigma(camera(log_sigma=0.2), camera(log_sigma=EXIF_SIGMA)) == EXIF_SIGMA
