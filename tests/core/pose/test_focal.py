"""How sure the focal length of a pose is, and what is said about it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import homogeneous, infinite_homography, project
from edf_stitch.core.pose import options
from edf_stitch.core.pose.focal import KnownFocal, focal_warnings, held_focal, known_focal
from edf_stitch.core.pose.refinement import Pose, focal_deviations, refine_pose

from ..point_scenes import FOCAL, SIZE, turned_by, unit

ASSUMED_SIGMA, EXIF_SIGMA = INTRINSICS.assumed_sigma, INTRINSICS.exif_sigma

# R and t of target cameras, each half a unit or more away: what they tell of the focal length follows from
# docs/method.md, 3
CONVERGING = (turned_by(8, -15, 5), 0.8 * unit(1, -0.4, 0.3))
PARALLEL = (np.eye(3), 0.6 * unit(1, 0, 0))
# axes that meet at equal distances: the centre (½, 0, z) and its mirror image
SYMMETRIC = (turned_by(0, 24, 0), -turned_by(0, 24, 0) @ np.array([1.0, 0, np.tan(np.radians(12))]))


def intrinsics(focal: float) -> np.ndarray:
    return np.array([[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1]])


def camera(focal: float = FOCAL, log_sigma: float = 0.0, source: str = "test") -> Camera:
    knowledge = Knowledge.ASSUMED if log_sigma == ASSUMED_SIGMA else Knowledge.EXIF
    return Camera(intrinsics(focal), SIZE, source, log_sigma, knowledge=knowledge)


def assumed() -> Camera:
    return camera(0.9 * SIZE[0], ASSUMED_SIGMA, "assumed 0.9 of the longer side")


def scene(
    layout: tuple[np.ndarray, np.ndarray], seed: int = 0, count: int = 300, noise: float = 0.5, focal: float = FOCAL
) -> tuple[Matches, Pose]:
    """noise: of each coordinate, px. Points lie anywhere up to 12 units away."""
    random = np.random.default_rng(seed)
    (R, t), K = layout, intrinsics(focal)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (20 * count, 2))
    there = (homogeneous(x) @ np.linalg.inv(K).T * random.uniform(1.5, 12, (len(x), 1))) @ R.T + t
    y = project(there @ K.T)
    ok = (there[:, 2] > 0) & (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y = x[ok][:count], y[ok][:count]
    assert len(x) == count
    noisy = Matches(x + random.normal(0, noise, x.shape), y + random.normal(0, noise, y.shape))
    return noisy, Pose(K, K, R, t / np.linalg.norm(t))


def known(matches: Matches, true: Pose, cam: Camera, sigma: float = 0.5) -> tuple[KnownFocal, Pose]:
    """What is known once the pose has been refined with this camera, from the truth."""
    found, _ = refine_pose(matches, Pose(cam.K if cam.fixed else true.K, true.K, true.R, true.t), cam, cam, sigma)
    return known_focal(matches, found, cam, cam, sigma, False), found


def moved_infinity(found: Pose, true: Pose) -> float:
    """Median over the target of how far apart the two see infinity, px."""
    there = np.stack(np.meshgrid(np.linspace(0, SIZE[0], 9), np.linspace(0, SIZE[1], 7)), axis=-1).reshape(-1, 2)
    H, H_true = (infinite_homography(p.K, p.K_prime, p.R) for p in (found, true))
    off = project(homogeneous(there) @ (H @ np.linalg.inv(H_true)).T) - there
    return float(np.median(np.linalg.norm(off, axis=1)))


# --- how sure ------------------------------------------------------------------------------------------------------


def test_a_given_focal_length_is_sure() -> None:
    matches, true = scene(CONVERGING)
    for first, second in ((camera(), camera()), (camera(), camera(FOCAL, EXIF_SIGMA)), (camera(FOCAL, 0.05), camera())):
        assert known_focal(matches, true, first, second, 0.5, False) == KnownFocal("test", 0.0, 0.0)


def test_what_the_matches_determine_is_theirs_and_needs_no_warning() -> None:
    matches, true = scene(CONVERGING)
    about, found = known(matches, true, assumed())
    assert about.source == "the matches, from assumed 0.9 of the longer side"
    assert about.deviation == focal_deviations(matches, found, assumed(), assumed(), 0.5, False)[0] < 0.03
    assert 0 < about.h_inf_spread < 30 and about.warnings == ()


@pytest.mark.parametrize("layout", [PARALLEL, SYMMETRIC], ids=["parallel axes", "axes that meet midway"])
def test_what_they_do_not_determine_is_said_with_its_spread(layout: tuple[np.ndarray, np.ndarray]) -> None:
    """docs/method.md, 3: every focal length explains such a pair."""
    matches, true = scene(layout)
    about, found = known(matches, true, assumed())
    assert about.source == "not determined by the matches, assumed 0.9 of the longer side"
    assert about.deviation > 0.2
    (warning,) = about.warnings
    assert "not determined by the matches" in warning and "--focal35" in warning
    assert "the overlap hardly depends on it" in warning, "what lies beside it leans"
    assert f"{found.K[0, 0]:.0f} px ± {about.deviation:.0%}" in warning
    assert f"{about.h_inf_spread:.0f} px off" in warning


def test_what_exif_says_is_not_warned_of_where_the_matches_tell_nothing() -> None:
    cam = camera(FOCAL, EXIF_SIGMA, "EXIF")
    matches, true = scene(SYMMETRIC)
    about, _ = known(matches, true, cam)
    assert about.source == "EXIF" and about.warnings == ()
    assert about.deviation == pytest.approx(EXIF_SIGMA, rel=0.1)


def test_the_spread_is_that_of_the_focal_length_where_only_it_is_open() -> None:
    """Axes that meet midway under an angle: with f, that angle changes, and infinity with it."""
    matches, true = scene(SYMMETRIC, noise=0.1)
    (tight, _), (loose, _) = (known(matches, true, camera(FOCAL, s), 0.1) for s in (0.02, EXIF_SIGMA))
    assert loose.h_inf_spread == pytest.approx(loose.deviation / tight.deviation * tight.h_inf_spread, rel=0.3)
    change = 2 * tight.deviation
    away = []
    for factor in (np.exp(change), np.exp(-change)):
        other = camera(factor * FOCAL)
        found, _ = refine_pose(matches, replace(true, K=other.K, K_prime=other.K), other, other, 0.1)
        away.append(moved_infinity(found, true))
    assert tight.h_inf_spread == pytest.approx(max(away), rel=0.15)
    assert tight.h_inf_spread > 5


def test_where_infinity_does_not_depend_on_the_focal_length_its_spread_is_small() -> None:
    """Parallel axes: H_inf is the identity at any focal length."""
    matches, true = scene(PARALLEL, noise=0.1)
    about, found = known(matches, true, assumed(), 0.1)
    assert about.deviation > 0.3
    assert about.h_inf_spread < 3 and moved_infinity(found, true) < 2


@pytest.mark.parametrize("layout, focals", [(CONVERGING, (800.0, 1500.0)), (SYMMETRIC, (800.0, 1500.0))],
                         ids=["converging", "axes that meet midway"])  # fmt: skip
def test_the_spread_covers_the_truth(layout: tuple[np.ndarray, np.ndarray], focals: tuple[float, float]) -> None:
    """Two standard deviations: nineteen of twenty, if all were normal."""
    covered = []
    for seed in range(8):
        for focal in focals:
            matches, true = scene(layout, seed, 200, 0.5, focal)
            about, found = known(matches, true, assumed())
            covered.append(moved_infinity(found, true) <= about.h_inf_spread)
    assert np.mean(covered) >= 0.8


def test_weak_matches_leave_more_open() -> None:
    matches, true = scene(CONVERGING)
    strong, _ = known(matches, true, assumed())
    for other, sigma in ((matches.subset(np.arange(40)), 0.5), (matches, 1.5)):
        weak, _ = known(other, true, assumed(), sigma)
        assert weak.deviation > 1.5 * strong.deviation and weak.h_inf_spread > 1.2 * strong.h_inf_spread


# --- contradictions ------------------------------------------------------------------------------------------------


def pose_with(focal: float, focal_prime: float) -> Pose:
    return Pose(intrinsics(focal), intrinsics(focal_prime), np.eye(3), unit(1, 0, 0))


def test_a_focal_length_that_moved_far_from_what_the_file_says_is_warned_of() -> None:
    exif = camera(FOCAL, EXIF_SIGMA, "EXIF")
    limit = 2 * EXIF_SIGMA
    assert focal_warnings(pose_with(FOCAL * (1 + 0.9 * limit), FOCAL * (1 - 0.9 * limit)), exif, exif) == []
    (warning,) = focal_warnings(pose_with(FOCAL, 1250.0), exif, exif)
    for part in ("contradict the target's", "1000 px from EXIF", "1250 px (+25%)", "cropped", "--focal-px"):
        assert part in warning
    both = focal_warnings(pose_with(800.0, 800.0), exif, exif)
    assert ["reference" in both[0], "target" in both[1], "-20%" in both[0], len(both)] == [True, True, True, 2]


def test_a_guess_cannot_be_contradicted_nor_can_what_is_given() -> None:
    for cam in (assumed(), camera()):
        assert focal_warnings(pose_with(2000.0, 2000.0), cam, cam) == []


@pytest.mark.parametrize("seed, worse", [(1, "longer"), (8, "shorter")])
def test_the_spread_is_that_of_the_focal_length_that_moves_infinity_more(seed: int, worse: str) -> None:
    """Of one longer by two deviations and one as much shorter, each with the pose that goes with it."""
    matches, true = scene(CONVERGING, seed, options.FOCAL.spread_matches)
    about, found = known(matches, true, camera(FOCAL, 0.1))
    away = {}
    for side, change in (("longer", 2 * about.deviation), ("shorter", -2 * about.deviation)):
        other = camera(found.K[0, 0] * np.exp(change))
        there, _ = refine_pose(matches, replace(found, K=other.K, K_prime=other.K), other, other, 0.5)
        away[side] = moved_infinity(there, found)
    assert max(away, key=away.__getitem__) == worse and max(away.values()) > 1.03 * min(away.values())
    assert about.h_inf_spread == pytest.approx(away[worse], rel=5e-3)


def test_a_focal_length_that_was_held_is_as_sure_as_the_less_sure_of_the_two() -> None:
    matches, true = scene(SYMMETRIC, noise=0.1)
    sure, unsure, given = camera(FOCAL, 0.02, "EXIF"), camera(FOCAL, 0.1, "EXIF"), camera()
    pairs = (sure, unsure), (unsure, sure), (sure, sure)
    one, other, both = (held_focal(matches, true, *pair, 0.1) for pair in pairs)
    assert one.deviation == other.deviation == 0.1 and both.deviation == 0.02 and one.source == "EXIF"
    assert one.h_inf_spread == pytest.approx(other.h_inf_spread) and one.h_inf_spread > 3 * both.h_inf_spread > 15
    assert held_focal(matches, true, given, given, 0.1) == KnownFocal("test", 0.0, 0.0)
    assert held_focal(matches, true, given, unsure, 0.1).deviation == 0.1
