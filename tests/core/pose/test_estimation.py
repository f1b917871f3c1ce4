"""Two views of random point scenes: pose, H_inf, focal length, against bounds that follow from the noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import (
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    project,
    rotation_angle,
    rotation_from_vector,
    sampson_residuals,
)
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.pose.estimation import _least_truncated, _poses_of_plane, estimate
from edf_stitch.core.pose.options import ESTIMATION
from edf_stitch.core.pose.refinement import Pose
from edf_stitch.core.system.errors import DegenerateGeometry, NoOverlap, TooFewMatches

from ..point_scenes import FOCAL, SIZE, spoiled, turned_by, unit

ASSUMED_SIGMA, EXIF_SIGMA = INTRINSICS.assumed_sigma, INTRINSICS.exif_sigma


@dataclass(frozen=True)
class Layout:
    """How the cameras stand: target sees X at R X + baseline · t; depths of the points, or a plane n·X = 1."""

    R: np.ndarray
    t: np.ndarray
    baseline: float = 0.6
    depth: tuple[float, float] = (3.0, 12.0)
    plane: tuple[float, float, float] | None = None


LAYOUTS = {
    "to the side, turned": Layout(turned_by(2, -12, 3), unit(1, 0.1, 0.15)),
    "parallel, epipole at infinity": Layout(np.eye(3), unit(1, 0, 0)),
    "forward, epipole in the picture": Layout(turned_by(0.5, -1, 0.5), unit(0.05, 0.02, -1), 1.0),
    "a plane": Layout(turned_by(2, -12, 3), unit(1, 0.1, 0.15), plane=(0.02, 0.03, 0.2)),
}
OTHERS = {
    # axes that are not in one plane, and points at very different depths: this tells the focal length
    "converging": Layout(turned_by(8, -15, 5), unit(1, -0.4, 0.3), 0.8, (2.0, 8.0)),
    "axes that meet midway": Layout(turned_by(0, 24, 0), -turned_by(0, 24, 0) @ unit(1, 0, np.tan(np.radians(12))), 1.0,
                                    (1.5, 12.0)),
    "a frontal plane": Layout(turned_by(1, -6, 2), unit(1, 0.2, 0.1), plane=(0.0, 0.0, 0.25)),
    "one place": Layout(turned_by(2, -14, 4), np.zeros(3), 0.0),
    "one place, one view": Layout(np.eye(3), np.zeros(3), 0.0),
}  # fmt: skip


@dataclass(frozen=True)
class Scene:
    matches: Matches
    K: np.ndarray
    K_prime: np.ndarray
    R: np.ndarray
    t: np.ndarray
    wrong: np.ndarray
    noise: float


def intrinsics(focal: float) -> np.ndarray:
    return np.array([[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1]])


def known(focal: float = FOCAL) -> Camera:
    return Camera(intrinsics(focal), SIZE, "given in px", 0.0)


def from_exif(focal: float = FOCAL) -> Camera:
    return Camera(intrinsics(focal), SIZE, "EXIF", EXIF_SIGMA, knowledge=Knowledge.EXIF)


def unknown() -> Camera:
    return Camera(intrinsics(0.9 * SIZE[0]), SIZE, "assumed", ASSUMED_SIGMA, knowledge=Knowledge.ASSUMED)


@cache
def scene(
    name: str = "to the side, turned", seed: int = 0, count: int = 300, noise: float = 0.5, outliers: float = 0.0,
    focals: tuple[float, float] = (FOCAL, FOCAL),
) -> Scene:  # fmt: skip
    """noise: of each coordinate in px; outliers: share of matches whose target point lies anywhere."""
    layout = (LAYOUTS | OTHERS)[name]
    random = np.random.default_rng(seed)
    K, K_prime = (intrinsics(f) for f in focals)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (15 * count, 2))
    ray = homogeneous(x) @ np.linalg.inv(K).T
    z = 1 / (ray @ layout.plane) if layout.plane else random.uniform(*layout.depth, len(x))
    there = ray * z[:, None] @ layout.R.T + layout.baseline * layout.t
    y = project(there @ K_prime.T)
    ok = (there[:, 2] > 0) & (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y = x[ok][:count], y[ok][:count]
    assert len(x) == count
    x, y, wrong = spoiled(x, y, noise, outliers, random)
    return Scene(Matches(x, y), K, K_prime, layout.R, layout.t, wrong, noise)


def transfer_error(view: TwoView, truth: Scene) -> float:
    """RMS over the reference picture of how far H_inf is off, px."""
    grid = np.stack(np.meshgrid(np.linspace(0, SIZE[0], 9), np.linspace(0, SIZE[1], 7)), axis=-1).reshape(-1, 2)
    true = project(homogeneous(grid) @ infinite_homography(truth.K, truth.K_prime, truth.R).T)
    return float(np.sqrt(((project(homogeneous(grid) @ view.H_inf.T) - true) ** 2).sum(axis=1).mean()))


def infinity_off(view: TwoView, H: np.ndarray) -> float:
    """Median over the target of how far apart H_inf and H see the same, px."""
    there = np.stack(np.meshgrid(np.linspace(0, SIZE[0], 9), np.linspace(0, SIZE[1], 7)), axis=-1).reshape(-1, 2)
    off = project(homogeneous(there) @ (view.H_inf @ np.linalg.inv(H)).T) - there
    return float(np.median(np.linalg.norm(off, axis=1)))


def baseline_error(view: TwoView, truth: Scene) -> float:
    """Degrees between the baseline directions, sign and all: the other one has the world behind the cameras."""
    return float(np.degrees(2 * np.arcsin(np.linalg.norm(view.t - truth.t) / 2)))


def expected_errors(truth: Scene, noise: float) -> np.ndarray:
    """Standard deviations of rotation (degrees), baseline direction (degrees), H_inf transfer (px): the Cramér-Rao
    bound of the five unknowns at the truth, derivatives by differences."""
    matches = truth.matches.subset(~truth.wrong)
    tangents = np.linalg.svd(truth.t[None])[2][1:]

    def pose(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = truth.t + step[3:] @ tangents
        return rotation_from_vector(step[:3]) @ truth.R, t / np.linalg.norm(t)

    def residuals(step: np.ndarray) -> np.ndarray:
        return sampson_residuals(fundamental_from_pose(truth.K, truth.K_prime, *pose(step)), matches.x, matches.y)

    grid = np.stack(np.meshgrid(np.linspace(0, SIZE[0], 9), np.linspace(0, SIZE[1], 7)), axis=-1).reshape(-1, 2)

    def transfer(step: np.ndarray) -> np.ndarray:
        return project(homogeneous(grid) @ infinite_homography(truth.K, truth.K_prime, pose(step)[0]).T).ravel()

    steps = 1e-6 * np.eye(5)
    J = np.column_stack([(residuals(s) - residuals(-s)) / 2e-6 for s in steps])
    J_transfer = np.column_stack([(transfer(s) - transfer(-s)) / 2e-6 for s in steps])
    covariance = noise**2 * np.linalg.inv(J.T @ J)
    there = J_transfer @ covariance @ J_transfer.T
    return np.array([
        np.degrees(np.sqrt(np.trace(covariance[:3, :3]))), np.degrees(np.sqrt(np.trace(covariance[3:, 3:]))),
        np.sqrt(2 * np.trace(there) / len(there)),
    ])  # fmt: skip


def errors(view: TwoView, truth: Scene) -> np.ndarray:
    return np.array([rotation_angle(view.R, truth.R), baseline_error(view, truth), transfer_error(view, truth)])


def check_consistent(view: TwoView) -> None:
    """All parts of a TwoView belong to one pose."""
    assert np.allclose(view.R @ view.R.T, np.eye(3), atol=1e-12) and np.linalg.det(view.R) > 0
    assert np.linalg.norm(view.t) == pytest.approx(1)
    assert np.allclose(view.H_inf, view.K_prime @ view.R @ np.linalg.inv(view.K), atol=1e-9)
    assert np.allclose(view.e_prime, view.K_prime @ view.t, atol=1e-9)
    assert np.allclose(view.F, fundamental_from_pose(view.K, view.K_prime, view.R, view.t), atol=1e-12)


# --- calibrated ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("noise, outliers", [(0.0, 0.0), (0.5, 0.0), (1.0, 0.5)])
def test_with_known_focal_length_the_pose_is_as_good_as_the_noise_allows(
    name: str, noise: float, outliers: float
) -> None:
    truth = scene(name, 1, 400, noise, 0.4 * outliers if name == "a plane" else outliers)
    view = estimate(truth.matches, known(), known())
    check_consistent(view)
    assert np.array_equal(view.K, truth.K) and np.array_equal(view.K_prime, truth.K)
    # Four standard deviations of the best there is. Outliers that lie beside their lines by chance are noise too, even
    # where there is no other: no more than half a pixel of it.
    bound = 4 * expected_errors(truth, max(noise, 0.5 if outliers else 1e-4))
    if name == "a plane" and outliers:  # a plane leaves room to swallow one; the other solution is 80 σ away
        bound *= 2.5
    assert (errors(view, truth) < bound).all(), (errors(view, truth), bound)
    assert view.inliers[~truth.wrong].mean() > 0.95
    # chance: a band of ± 3 px Sampson (4.2 px from the line) over 1200 of 1200 × 900 px², 0.9 %; Poisson with mean 2
    assert view.inliers[truth.wrong].sum() <= 8
    assert view.sigma == pytest.approx(noise, rel=0.2) if noise else view.sigma <= 0.15
    assert view.focal_deviation == 0 and view.focal_source == "given in px" and view.warnings == ()
    assert str(int(view.inliers.sum())) in view.why
    assert view.model == ("plane" if name == "a plane" else "general")


@pytest.mark.parametrize("outliers", [0.0, 0.4])
def test_few_matches_are_enough(outliers: float) -> None:
    truth = scene("to the side, turned", 4, 40, 0.3, outliers)
    view = estimate(truth.matches, known(), known())
    assert (errors(view, truth) < 4 * expected_errors(truth, 0.3)).all()


def test_two_known_focal_lengths_may_differ() -> None:
    truth = scene("to the side, turned", 3, focals=(900.0, 1400.0))
    view = estimate(truth.matches, known(900.0), known(1400.0))
    check_consistent(view)
    assert view.K[0, 0] == 900 and view.K_prime[0, 0] == 1400
    assert (errors(view, truth) < 4 * expected_errors(truth, 0.5)).all()


# --- the focal length ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("focal, seed", [(600.0, 0), (1000.0, 1), (1700.0, 0)])
def test_a_scene_that_tells_the_focal_length_is_listened_to(focal: float, seed: int) -> None:
    truth = scene("converging", seed, 400, 0.5, 0.2, (focal, focal))
    view = estimate(truth.matches, unknown(), unknown())
    check_consistent(view)
    assert view.K[0, 0] == view.K_prime[0, 0]
    assert view.K[0, 0] == pytest.approx(focal, rel=0.03)
    # and its own account of the error is honest
    assert view.focal_deviation < 0.02
    assert abs(np.log(view.K[0, 0] / focal)) < 4 * view.focal_deviation
    assert rotation_angle(view.R, truth.R) < 0.5 and baseline_error(view, truth) < 1


@pytest.mark.parametrize("name", ["parallel, epipole at infinity", "axes that meet midway"])
def test_where_nothing_tells_the_focal_length_that_is_said(name: str) -> None:
    truth = scene(name, 1, 400)
    view = estimate(truth.matches, unknown(), unknown())
    assert view.model == "general" and view.focal_deviation > 0.2
    assert abs(np.log(view.K[0, 0] / (0.9 * SIZE[0]))) < 0.2
    assert "not determined by the matches" in view.focal_source
    assert any("not determined" in w and f"{view.h_inf_spread:.0f} px off" in w for w in view.warnings)
    true = infinite_homography(truth.K, truth.K_prime, truth.R)
    assert 0 < infinity_off(view, true) < view.h_inf_spread
    tight = estimate(truth.matches, from_exif(), from_exif())
    assert tight.focal_deviation == pytest.approx(EXIF_SIGMA, rel=0.05) and tight.warnings == ()
    assert tight.K[0, 0] == pytest.approx(FOCAL, rel=0.03) and tight.focal_source == "EXIF"
    if name.startswith("parallel"):  # H_inf is the identity at any focal length
        assert transfer_error(view, truth) < 4 * expected_errors(truth, 0.5)[2]


def test_how_far_infinity_may_be_off_covers_how_far_it_is() -> None:
    """Within two standard deviations in most cases."""
    covered = []
    for seed in range(4):
        truth = scene("converging", seed, 300, 0.5, 0.2)
        view = estimate(truth.matches, unknown(), unknown())
        assert "from assumed" in view.focal_source and view.warnings == () and 0 < view.h_inf_spread < 40
        covered.append(infinity_off(view, infinite_homography(truth.K, truth.K_prime, truth.R)) <= view.h_inf_spread)
    assert sum(covered) >= 3


@pytest.mark.parametrize("factor", [0.75, 1.25])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_given_focal_length_that_is_wrong_stays_and_that_is_said(factor: float, seed: int) -> None:
    """The matches know it to one in a hundred."""
    truth = scene("converging", seed, 300, 0.5, 0.2)
    view = estimate(truth.matches, known(factor * FOCAL), known(factor * FOCAL))
    assert view.K[0, 0] == factor * FOCAL and view.focal_deviation == 0
    assert [w for w in view.warnings if "contradict the given cameras" in w], (view.warnings, view.sigma)


def test_matches_that_contradict_exif_are_warned_of() -> None:
    truth = scene("converging", 0, 400, 0.5)
    view = estimate(truth.matches, from_exif(1400.0), from_exif(1400.0))
    assert view.K[0, 0] < 1250
    assert len(view.warnings) == 2
    for warning, name in zip(view.warnings, ("reference", "target"), strict=True):
        assert name in warning and "1400 px" in warning and f"{view.K[0, 0]:.0f} px" in warning
    assert estimate(truth.matches, from_exif(1020.0), from_exif(1020.0)).warnings == ()


@pytest.mark.parametrize(
    "name, camera",
    [("to the side, turned", from_exif()), ("converging", from_exif()), ("converging", unknown())],
    ids=["to the side, EXIF", "converging, EXIF", "converging, unknown"],
)
@pytest.mark.parametrize("ratio, seed", [(1.3, 0), (1 / 1.3, 1), (1.7, 2)])
def test_a_zoom_between_the_pictures_is_recognised(name: str, camera: Camera, ratio: float, seed: int) -> None:
    truth = scene(name, seed, 400, 0.5, 0.2, (1000.0, 1000.0 * ratio))
    view = estimate(truth.matches, camera, camera)
    assert "freed" in view.why
    assert view.K_prime[0, 0] / view.K[0, 0] == pytest.approx(ratio, rel=0.03)
    assert view.sigma < 0.6 and view.inliers[~truth.wrong].mean() > 0.95
    assert camera.assumed or any("target" in warning for warning in view.warnings)


@pytest.mark.parametrize("camera", [from_exif(), unknown()], ids=["EXIF", "unknown"])
@pytest.mark.parametrize("name", ["to the side, turned", "forward, epipole in the picture", "converging"])
def test_without_a_zoom_none_is_seen(name: str, camera: Camera) -> None:
    view = estimate(scene(name, 1, 400, 0.5, 0.2).matches, camera, camera)
    assert "freed" not in view.why and view.K[0, 0] == view.K_prime[0, 0]


@pytest.mark.parametrize("k1", [-0.06, 0.04])
def test_a_mildly_bent_lens_is_no_zoom(k1: float) -> None:
    """Uncorrected barrel or pincushion distortion of a few pixels."""
    bent = replace(known(), distortion=np.array([k1, 0, 0, 0, 0]))
    truth = scene("to the side, turned", 1, 400, 0.5, 0.2)
    matches = Matches(distort(truth.matches.x, bent), distort(truth.matches.y, bent))
    assert np.abs(matches.x - truth.matches.x).max() > 3
    for camera in (from_exif(), unknown()):
        view = estimate(matches, camera, camera)
        assert "freed" not in view.why and view.K[0, 0] == view.K_prime[0, 0]


# --- one place, or one plane -----------------------------------------------------------------------------------------


CAMERAS = {"known": known(), "EXIF": from_exif(), "unknown": unknown()}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("noise, outliers", [(0.0, 0.0), (0.5, 0.4)])
def test_pictures_from_one_place_are_a_rotation(camera: Camera, noise: float, outliers: float) -> None:
    """docs/method.md, 3: H_inf alone; t = e' = 0, F = NaN."""
    truth = scene("one place", 1, 300, noise, outliers)
    view = estimate(truth.matches, camera, camera)
    assert view.model == "rotation" and "one rotation explains" in view.why
    assert not view.t.any() and not view.e_prime.any() and np.isnan(view.F).all()
    assert np.array_equal(view.H_inf, infinite_homography(view.K, view.K_prime, view.R))
    assert np.allclose(view.R @ view.R.T, np.eye(3), atol=1e-12)
    assert transfer_error(view, truth) < max(1e-3, noise)
    assert rotation_angle(view.R, truth.R) < (0.02 if camera.fixed else 0.3) * max(noise, 0.01) / 0.5
    assert np.array_equal(view.K, truth.K) if camera.fixed else view.K[0, 0] == pytest.approx(FOCAL, rel=0.02)
    assert view.inliers[~truth.wrong].mean() > 0.95 and view.inliers[truth.wrong].sum() <= 3
    assert any("same place" in w and "no depth" in w for w in view.warnings)
    assert np.isnan(view.h_inf_spread) and (
        view.focal_deviation == 0 if camera.fixed else np.isnan(view.focal_deviation)
    )
    assert view.sigma == pytest.approx(max(noise, 0.05), rel=0.15)


@pytest.mark.parametrize("camera", [known(), unknown()], ids=["known", "unknown"])
@pytest.mark.parametrize("noise", [0.0, 0.5, 1.0])
def test_the_same_picture_twice_is_refused(camera: Camera, noise: float) -> None:
    with pytest.raises(NoOverlap, match="same from the same place.*different places"):
        estimate(scene("one place, one view", 2, 300, noise, 0.3).matches, camera, camera)


def plane_homography(truth: Scene, layout: Layout) -> np.ndarray:
    assert layout.plane is not None
    return truth.K_prime @ (truth.R + layout.baseline * np.outer(truth.t, layout.plane)) @ np.linalg.inv(truth.K)


@pytest.mark.parametrize("camera", [known(), from_exif()], ids=["known", "EXIF"])
@pytest.mark.parametrize("name", ["a plane", "a frontal plane"])
@pytest.mark.parametrize("seed", range(3))
def test_a_plane_seen_by_cameras_that_are_known_has_a_pose(name: str, camera: Camera, seed: int) -> None:
    """One of the two that see the plane alike; which, noise may decide."""
    truth, layout = scene(name, seed, 300, 0.5, 0.2), (LAYOUTS | OTHERS)[name]
    view = estimate(truth.matches, camera, camera)
    assert view.model == "plane" and "nothing leaves that plane" in view.why
    check_consistent(view)
    # what a plane cannot tell stays as it was believed
    assert abs(np.log(view.K[0, 0] / FOCAL)) <= 2 * camera.log_sigma and view.warnings == ()
    calibrated = np.linalg.inv(truth.K_prime) @ plane_homography(truth, layout) @ truth.K
    solutions = [
        truth.K_prime @ R @ np.linalg.inv(truth.K) for R in cv2.decomposeHomographyMat(calibrated, np.eye(3))[1]
    ]
    allowed = 8.0 if camera.fixed else view.h_inf_spread + 8.0
    assert min(infinity_off(view, H) for H in solutions) < allowed
    assert view.inliers[~truth.wrong].mean() > 0.95


@pytest.mark.parametrize("cameras", [(unknown(), unknown()), (from_exif(), unknown())], ids=["both", "one of them"])
def test_a_plane_seen_by_cameras_that_are_not_known_is_a_homography(cameras: tuple[Camera, Camera]) -> None:
    """docs/method.md, 3: H_inf holds it, e' = 0, F, R, t = NaN, and that depth is meaningless is said."""
    truth = scene("a plane", 1, 300, 0.5, 0.3)
    view = estimate(truth.matches, *cameras)
    assert view.model == "plane" and "one homography explains" in view.why
    assert not view.e_prime.any()
    assert np.isnan(view.F).all() and np.isnan(view.R).all() and np.isnan(view.t).all()
    assert infinity_off(view, plane_homography(truth, LAYOUTS["a plane"])) < 0.5
    assert ((homogeneous(truth.matches.x) @ view.H_inf.T)[:, 2] > 0).all()
    assert np.array_equal(view.K, cameras[0].K) and np.array_equal(view.K_prime, cameras[1].K)
    assert view.inliers[~truth.wrong].mean() > 0.95 and view.inliers[truth.wrong].sum() <= 3
    assert np.isnan(view.focal_deviation) and np.isnan(view.h_inf_spread)
    assert any("one plane" in w and "depth is meaningless" in w for w in view.warnings)


# --- matches that the user gives -------------------------------------------------------------------------------------


GIVEN = {
    "a general scene": ("to the side, turned", known()),
    "a plane": ("a plane", known()),
    "a plane and cameras unknown": ("a plane", unknown()),
    "one place": ("one place", known()),
}


@pytest.mark.parametrize("name, camera", GIVEN.values(), ids=GIVEN.keys())
def test_given_matches_are_all_kept_and_a_wrong_one_is_named(name: str, camera: Camera) -> None:
    clean = replace(scene(name, 3, 100, 0.3).matches, given=True)
    usual = estimate(clean, camera, camera)
    assert usual.inliers.all() and not any("given matches" in w for w in usual.warnings)
    y = clean.y.copy()
    y[7] += (35.0, 60)
    view = estimate(replace(clean, y=y), camera, camera)
    assert view.inliers.all() and view.model == usual.model
    (warning,) = set(view.warnings) - set(usual.warnings)
    assert warning.startswith("1 of the given matches")
    assert (usual.contradicting, view.contradicting) == (0, 1)
    assert estimate(replace(clean, y=y, given=False), camera, camera).contradicting == 0
    assert f"{clean.x[7, 0]:.1f},{clean.x[7, 1]:.1f} and {y[7, 0]:.1f},{y[7, 1]:.1f}" in warning
    # it moves nothing
    assert infinity_off(view, usual.H_inf) < 1


def test_given_matches_of_given_poses_are_all_kept_and_a_wrong_one_is_named() -> None:
    truth = scene("to the side, turned", 3, 100, 0.3)
    y = truth.matches.y.copy()
    y[7] += (35.0, 60)
    view = estimate(replace(truth.matches, y=y, given=True), *placed(truth, np.array([3.0, 1, -2]), 0.6))
    assert view.inliers.all()
    (warning,) = view.warnings
    assert f"{truth.matches.x[7, 0]:.1f},{truth.matches.x[7, 1]:.1f}" in warning


# --- turned round ----------------------------------------------------------------------------------------------------


def test_reference_and_target_change_places() -> None:
    truth = scene("to the side, turned", 5, 300, 0.5, 0.3)
    view = estimate(truth.matches, known(), known())
    back = estimate(Matches(truth.matches.y, truth.matches.x), known(), known())
    bound = expected_errors(truth, 0.5)
    assert rotation_angle(back.R, view.R.T) < 0.2 * bound[0]
    assert np.degrees(np.linalg.norm(back.t + view.R.T @ view.t)) < bound[1]


# --- nothing to go by ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [0, 1, ESTIMATION.min_matches - 1])
def test_too_few_matches_are_said_to_be_too_few(count: int) -> None:
    with pytest.raises(TooFewMatches, match=f"only {count} .* at least {ESTIMATION.min_matches}") as caught:
        estimate(scene().matches.subset(np.arange(count)), known(), known())
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("count", [ESTIMATION.min_matches, 60, 400])
@pytest.mark.parametrize("seed", [0, 1])
def test_matches_by_chance_are_no_overlap(count: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    matches = Matches(random.uniform((0, 0), SIZE, (count, 2)), random.uniform((0, 0), SIZE, (count, 2)))
    with pytest.raises(NoOverlap, match="look alike") as caught:
        estimate(matches, known(), known())
    assert caught.value.exit_code == 3


# --- cameras with known poses --------------------------------------------------------------------------------------


def placed(truth: Scene, place: np.ndarray, length: float, off: float = 0.0) -> tuple[Camera, Camera]:
    """The scene's cameras somewhere in the world, the baseline `length` long; the target turned by `off` degrees."""
    R = turned_by(20, -35, 10)
    R_prime = turned_by(0, off, 0) @ truth.R @ R
    first = replace(known(), source="camera file", pose=(R, -R @ place))
    second = replace(known(), source="camera file", pose=(R_prime, -R_prime @ place + length * truth.t))
    return first, second


def test_given_poses_are_used_as_they_are() -> None:
    truth = scene("to the side, turned", 6, 300, 0.5, 0.3)
    for off in (0.0, 0.02):  # what is given a little wrong stays so: that is for the user to know
        first, second = placed(truth, np.array([3.0, 1, -2]), 0.6, off)
        view = estimate(truth.matches, first, second)
        check_consistent(view)
        assert np.allclose(view.R, turned_by(0, off, 0) @ truth.R, atol=1e-12)
        assert np.allclose(view.t, truth.t if off == 0 else view.t, atol=1e-12)
        assert np.array_equal(view.K, truth.K) and np.array_equal(view.K_prime, truth.K_prime)
        assert view.focal_deviation == 0 and view.focal_source == "camera file" and "given" in view.why
        assert view.inliers[~truth.wrong].mean() > 0.95 and view.inliers[truth.wrong].mean() < 0.06
        assert view.sigma == pytest.approx(0.5, rel=0.2 if off == 0 else 0.8)


def test_where_the_world_is_does_not_matter() -> None:
    truth = scene("to the side, turned", 6, 300, 0.5, 0.3)
    near, far = (estimate(truth.matches, *placed(truth, np.array(place), 60.0)) for place in
                 ((0.0, 0, 0), (3e5, -5e6, 100)))  # fmt: skip
    assert np.allclose(near.t, far.t, atol=1e-8) and np.array_equal(near.inliers, far.inliers)


@pytest.mark.parametrize("place", [(0, 0, 0), (1, 2, 3), (1700, -300, 80), (3e5, -5e6, 100), (-1e-3, 2e-4, 0)])
def test_given_poses_in_the_same_place_are_refused(place: tuple[float, ...]) -> None:
    truth = scene("to the side, turned", 6)
    with pytest.raises(DegenerateGeometry, match="same place"):
        estimate(truth.matches, *placed(truth, np.array(place, float), 0.0))


def test_given_poses_that_do_not_fit_are_refused() -> None:
    truth = scene("to the side, turned", 6, 100)
    first, second = placed(truth, np.array([3.0, 1, -2]), 0.6)
    assert first.pose is not None and second.pose is not None
    (R, t), (R_prime, t_prime) = first.pose, second.pose
    wrong = {
        "in the wrong order": (second, first),
        "of the camera in the world": (replace(first, pose=(R.T, -R.T @ t)),
                                       replace(second, pose=(R_prime.T, -R_prime.T @ t_prime))),
        "transposed": (replace(first, pose=(R.T, t)), replace(second, pose=(R_prime.T, t_prime))),
        "of another pair": placed(scene("forward, epipole in the picture", 6), np.zeros(3), 1.0),
    }  # fmt: skip
    for name, cameras in wrong.items():
        with pytest.raises(DegenerateGeometry, match=r"explain only \d+ of 100") as caught:
            pytest.fail(f"{name}: {estimate(truth.matches, *cameras).why}")
        assert "R X + t" in str(caught.value)


def test_given_poses_that_have_the_scene_behind_them_are_refused() -> None:
    """The epipolar lines are the same, so the matches fit; but nothing lies in front of both cameras."""
    truth = scene("to the side, turned", 6, 100)
    first, second = placed(truth, np.array([3.0, 1, -2]), 0.6)
    assert first.pose is not None and second.pose is not None
    (R, t), (R_prime, t_prime) = first.pose, second.pose
    backwards = replace(second, pose=(R_prime, 2 * R_prime @ R.T @ t - t_prime))
    with pytest.raises(DegenerateGeometry, match=r"only 0% of \d+ matching points lie in front of both.*sign of t"):
        estimate(truth.matches, first, backwards)


# --- repeatable ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("camera", [known(), unknown()], ids=["known", "unknown"])
def test_the_same_seed_gives_the_same_bytes(camera: Camera) -> None:
    truth = scene("to the side, turned", 7, 300, 0.8, 0.5)
    one = estimate(truth.matches, camera, camera, seed=3)
    # whatever else was drawn in between
    estimate(scene("a plane", 1).matches, camera, camera, seed=9)
    other = estimate(truth.matches, camera, camera, seed=3)
    for name in ("K", "K_prime", "R", "t", "F", "H_inf", "e_prime", "inliers"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert (one.sigma, one.why, one.focal_deviation) == (other.sigma, other.why, other.focal_deviation)


def test_another_seed_gives_nearly_the_same() -> None:
    truth = scene("to the side, turned", 7, 300, 0.8, 0.5)
    one, other = (estimate(truth.matches, known(), known(), seed=seed) for seed in range(2))
    assert rotation_angle(one.R, other.R) < expected_errors(truth, 0.8)[0]
    assert np.mean(one.inliers != other.inliers) < 0.03


# --- which pose is taken -------------------------------------------------------------------------------------------


def sideways(t: tuple[float, ...] = (1.0, 0, 0), lower: float = 0.0) -> Pose:
    """Two parallel cameras side by side: epipolar lines are rows, `lower` px lower in the target."""
    K, K_prime = intrinsics(FOCAL), intrinsics(FOCAL)
    K_prime[1, 2] += lower
    return Pose(K, K_prime, np.eye(3), np.array(t))


def in_rows(off: np.ndarray) -> Matches:
    """Points in front of `sideways` cameras, each `off` px (N,) below its line."""
    random = np.random.default_rng(0)
    x = random.uniform((100, 100), (1000, 800), (len(off), 2))
    return Matches(x, x + np.column_stack([random.uniform(20, 80, len(off)), off]))


def test_a_pose_that_most_matches_fit_sharply_beats_one_that_all_fit_vaguely() -> None:
    """Three in five lie on the lines of one pose, the others √8 px off them; halfway, all are √2 px off. A Sampson
    distance is 1/√2 of that, for both pictures may err."""
    off = np.where(np.arange(100) < 60, 0.0, np.sqrt(8))
    everything = np.ones(100, bool)
    sharp, vague = (sideways(), everything, 0.1), (sideways(lower=np.sqrt(2)), everything, 1.0)
    for refined in ([sharp, vague], [vague, sharp]):
        assert _least_truncated(in_rows(off), refined) is sharp


def test_of_two_poses_with_the_same_lines_the_one_that_has_the_points_in_front_is_taken() -> None:
    everything = np.ones(50, bool)
    front, behind = (sideways(), everything, 0.5), (sideways((-1.0, 0, 0)), everything, 0.1)
    for refined in ([front, behind], [behind, front]):
        assert _least_truncated(in_rows(np.full(50, 0.1)), refined) is front


def test_of_the_poses_of_a_plane_those_that_have_it_in_front_are_left() -> None:
    truth = scene("a frontal plane", 2, 100, 0.0)
    layout = OTHERS["a frontal plane"]
    H = truth.K_prime @ (truth.R + layout.baseline * np.outer(truth.t, layout.plane)) @ np.linalg.inv(truth.K)
    poses = _poses_of_plane(truth.matches, H, known(), known())
    assert len(poses) == 2
    for pose in poses:
        assert np.abs(sampson_residuals(pose.F, truth.matches.x, truth.matches.y)).max() < 1e-6
    assert min(rotation_angle(pose.R, truth.R) + np.linalg.norm(pose.t - truth.t) for pose in poses) < 1e-6


def test_where_no_pose_has_most_of_a_plane_its_homography_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = scene("a plane", 0, 100)
    with_pose = estimate(truth.matches, known(), known())
    assert with_pose.model == "plane" and np.isfinite(with_pose.t).all()
    found = Pose(with_pose.K, with_pose.K_prime, with_pose.R, with_pose.t)
    few = np.arange(100) < 60
    monkeypatch.setattr("edf_stitch.core.pose.estimation._fit_pose", lambda *_: (found, few, 0.5, False))
    view = estimate(truth.matches, known(), known())
    assert view.model == "plane" and np.isnan(view.t).all() and not view.e_prime.any() and view.inliers.sum() > 90


@pytest.mark.parametrize("focal", [600.0, 3500.0, 5000.0])
def test_a_focal_length_far_from_the_usual_one_is_found(focal: float) -> None:
    """From the assumed one alone the search would end in another valley, with a focal length less than half of it."""
    truth = scene("to the side, turned", 0, 300, 0.2, focals=(focal, focal))
    view = estimate(truth.matches, unknown(), unknown())
    assert view.K[0, 0] == pytest.approx(focal, rel=0.05) and view.inliers.all()
