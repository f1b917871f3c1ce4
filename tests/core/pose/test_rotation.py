"""The same viewpoint: the rotation between two pictures and what it tells of their focal lengths."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import (
    homogeneous,
    infinite_homography,
    project,
    rotation_angle,
    rotation_from_vector,
)
from edf_stitch.core.pose.fundamental import fit_homography
from edf_stitch.core.pose.rotation import Rotation, fit_rotation

ASSUMED_SIGMA, EXIF_SIGMA = INTRINSICS.assumed_sigma, INTRINSICS.exif_sigma

SIZE = (1200, 900)
FOCAL = 1000.0
TURNS = {"to the side": (2.0, -18, 3), "rolled": (0.5, 0.5, 60), "upside down": (3.0, 8, 178), "hardly": (0.5, -2, 0.3)}


def intrinsics(focal: float) -> np.ndarray:
    return np.array([[focal, 0, (SIZE[0] - 1) / 2], [0, focal, (SIZE[1] - 1) / 2], [0, 0, 1]])


def camera(focal: float = FOCAL, log_sigma: float = 0.0) -> Camera:
    knowledge = Knowledge.ASSUMED if log_sigma == ASSUMED_SIGMA else Knowledge.EXIF
    return Camera(intrinsics(focal), SIZE, "test", log_sigma, knowledge=knowledge)


def scene(
    turn: tuple[float, ...], seed: int = 0, count: int = 300, noise: float = 0.3, outliers: float = 0.0,
    focals: tuple[float, float] = (FOCAL, FOCAL),
) -> tuple[Matches, np.ndarray]:  # fmt: skip
    """What two cameras in one place see, turned by a rotation vector in degrees; and R. noise: of each coordinate, px;
    outliers: share of the matches that lie anywhere in the target."""
    random = np.random.default_rng(seed)
    R = rotation_from_vector(np.radians(turn))
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (20 * count, 2))
    ray = homogeneous(x) @ infinite_homography(intrinsics(focals[0]), intrinsics(focals[1]), R).T
    y = project(ray)
    ok = (ray[:, 2] > 0) & (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y = x[ok][:count], y[ok][:count]
    assert len(x) == count
    x, y = x + random.normal(0, noise, x.shape), y + random.normal(0, noise, y.shape)
    wrong = random.permutation(count)[: round(outliers * count)]
    y[wrong] = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (len(wrong), 2))
    return Matches(x, y), R


def fit(matches: Matches, first: Camera, second: Camera) -> Rotation:
    homography = fit_homography(matches, 0)
    return fit_rotation(matches, homography.H, first, second, homography.sigma)


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
def test_with_given_cameras_the_rotation_is_exact(turn: tuple[float, ...]) -> None:
    matches, R = scene(turn, noise=0.0)
    found = fit(matches, camera(), camera())
    assert rotation_angle(found.R, R) < 1e-5
    assert np.allclose(found.R @ found.R.T, np.eye(3), atol=1e-12) and np.linalg.det(found.R) > 0
    assert np.array_equal(found.K, intrinsics(FOCAL)) and np.array_equal(found.K_prime, intrinsics(FOCAL))
    assert np.allclose(found.H_inf, found.K_prime @ found.R @ np.linalg.inv(found.K), atol=1e-9)


@pytest.mark.parametrize("outliers", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_noise_and_outliers_hardly_matter(seed: int, outliers: float) -> None:
    """Fitted to all of 300 matches, right or wrong, the rotation is as good as noise allows: 0.5 √2 px over f √300."""
    matches, R = scene(TURNS["to the side"], seed, noise=0.5, outliers=outliers)
    found = fit(matches, camera(), camera())
    # three angles, one of them (the roll) known less well; and outliers are that much less to go by
    assert rotation_angle(found.R, R) < 4 * np.degrees(0.5 * np.sqrt(2) / FOCAL / np.sqrt(300)) * 2


@pytest.mark.parametrize("turn", [TURNS["to the side"], TURNS["rolled"]], ids=["to the side", "rolled"])
@pytest.mark.parametrize("error", [0.95, 1.05])
def test_a_focal_length_of_exif_is_pulled_to_the_truth(turn: tuple[float, ...], error: float) -> None:
    matches, R = scene(turn)
    found = fit(matches, camera(error * FOCAL, EXIF_SIGMA), camera(error * FOCAL, EXIF_SIGMA))
    told = 0.005 if turn == TURNS["to the side"] else 0.06  # a roll tells no focal length: it stays in belief
    for K in (found.K, found.K_prime):
        assert K[0, 0] == K[1, 1] == pytest.approx(FOCAL, rel=told)
        assert np.array_equal(K[:2, 2], intrinsics(FOCAL)[:2, 2])
    assert rotation_angle(found.R, R) < 0.3


@pytest.mark.parametrize("longer_sides", [0.5, 0.9, 1.8, 4.0])
@pytest.mark.parametrize("outliers", [0.0, 0.3])
def test_an_unknown_focal_length_is_found(longer_sides: float, outliers: float) -> None:
    focal = longer_sides * SIZE[0]
    turn = tuple(np.array([4.0, -18, 3]) * min(1.0, 1 / longer_sides))
    matches, R = scene(turn, 1, outliers=outliers, focals=(focal, focal))
    found = fit(matches, camera(0.9 * SIZE[0], ASSUMED_SIGMA), camera(0.9 * SIZE[0], ASSUMED_SIGMA))
    assert found.K[0, 0] == pytest.approx(focal, rel=0.03) and found.K_prime[0, 0] == pytest.approx(focal, rel=0.03)
    assert rotation_angle(found.R, R) < 0.03 * np.linalg.norm(turn)


def test_starts_from_other_focal_lengths_than_the_assumed_one_are_tried() -> None:
    """From the assumed one alone the descent ends at half of this focal length."""
    focal = 1.8 * SIZE[0]
    matches, _ = scene((0.0, -30 / 1.8, 0), 2, outliers=0.3, focals=(focal, focal))
    found = fit(matches, camera(0.9 * SIZE[0], ASSUMED_SIGMA), camera(0.9 * SIZE[0], ASSUMED_SIGMA))
    assert found.K[0, 0] == pytest.approx(focal, rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_what_matches_cannot_tell_stays_as_believed(seed: int) -> None:
    """A turn of a fifth of a degree, half a dozen σ: without a prior the focal length would be off by half and more."""
    matches, _ = scene((0.05, -0.2, 0), seed, 40, noise=1.0)
    found = fit(matches, camera(FOCAL, EXIF_SIGMA), camera(FOCAL, EXIF_SIGMA))
    assert found.K[0, 0] == pytest.approx(FOCAL, rel=EXIF_SIGMA)


@pytest.mark.parametrize("known", [True, False], ids=["that EXIF tells", "that EXIF does not tell"])
@pytest.mark.parametrize("ratio", [1.4, 1 / 1.4])
def test_a_zoom_is_found(ratio: float, known: bool) -> None:
    matches, R = scene(TURNS["to the side"], 2, focals=(FOCAL, ratio * FOCAL))
    first, second = camera(0.97 * FOCAL, EXIF_SIGMA), camera((ratio if known else 1.0) * FOCAL, EXIF_SIGMA)
    found = fit(matches, first, second)
    assert found.K_prime[0, 0] / found.K[0, 0] == pytest.approx(ratio, rel=0.01)
    assert found.K[0, 0] == pytest.approx(FOCAL, rel=0.02)
    assert rotation_angle(found.R, R) < 0.5


@pytest.mark.parametrize("fixed", [(True, False), (False, True)])
def test_a_given_focal_length_stays_and_the_other_is_found(fixed: tuple[bool, bool]) -> None:
    matches, R = scene(TURNS["to the side"], 3, focals=(FOCAL, 1.2 * FOCAL))
    off = (1.0 if fixed[0] else 1.08, 1.2 if fixed[1] else 1.1)
    first, second = (
        camera(factor * FOCAL, 0.0 if given else EXIF_SIGMA) for factor, given in zip(off, fixed, strict=True)
    )
    found = fit(matches, first, second)
    kept, free = (found.K, found.K_prime) if fixed[0] else (found.K_prime, found.K)
    assert kept[0, 0] == (FOCAL if fixed[0] else 1.2 * FOCAL)
    assert free[0, 0] == pytest.approx(1.2 * FOCAL if fixed[0] else FOCAL, rel=0.005)
    assert rotation_angle(found.R, R) < 0.1


def test_the_target_back_to_the_reference_is_the_inverse() -> None:
    matches, _ = scene(TURNS["to the side"], 4)
    there, back = (
        fit(m, camera(1.03 * FOCAL, EXIF_SIGMA), camera(1.03 * FOCAL, EXIF_SIGMA))
        for m in (matches, Matches(matches.y, matches.x))
    )
    assert rotation_angle(there.R, back.R.T) < 0.02
    assert there.K[0, 0] == pytest.approx(back.K_prime[0, 0], rel=2e-3)


def test_the_same_matches_give_the_same_bytes() -> None:
    matches, _ = scene(TURNS["to the side"], 5, 400, outliers=0.3)
    unknown = camera(0.9 * SIZE[0], ASSUMED_SIGMA)
    one, other = (fit(matches, unknown, unknown) for _ in range(2))
    assert one.R.tobytes() == other.R.tobytes() and one.K.tobytes() == other.K.tobytes()
