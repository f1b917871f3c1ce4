"""What matches agree on without a camera: F, a homography, chance, and whether anything leaves the homography."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import poselib
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import (
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    project,
    rotation_from_vector,
    sampson_residuals,
)
from edf_stitch.core.pose.fundamental import (
    explained_by,
    fit_homography,
    fundamental_candidates,
    refuse_chance,
    refuse_without_spread,
    shows_parallax,
    transfer_error,
)
from edf_stitch.core.pose.options import FUNDAMENTAL
from edf_stitch.core.system.errors import DegenerateGeometry, NoOverlap

from ..point_scenes import SIZE, spoiled

K = np.array([[1000.0, 0, 599.5], [0, 1000.0, 449.5], [0, 0, 1]])
R = rotation_from_vector(np.radians([2.0, -12, 3]))
T = np.array([1, 0.1, 0.15]) / np.linalg.norm([1, 0.1, 0.15])
BASELINE = 0.6
NORMAL = np.array([0.02, 0.03, 0.2])  # of the plane n·X = 1
F_TRUE = fundamental_from_pose(K, K, R, T)
OF_ROTATION = infinite_homography(K, K, R)
OF_PLANE = K @ (R + BASELINE * np.outer(T, NORMAL)) @ np.linalg.inv(K)
# Where 3D points lie: no parallax at all, none off a plane, everywhere.
KINDS = ("rotation", "plane", "general")


@dataclass(frozen=True)
class Scene:
    matches: Matches
    wrong: np.ndarray


def scene(
    kind: str, seed: int = 0, count: int = 300, noise: float = 0.5, outliers: float = 0.0, off_plane: float = 0.0
) -> Scene:
    """noise: of each coordinate in px; outliers, off_plane: share of the matches that lie anywhere in the target, and
    of the others those that are nearer or further than a plane."""
    random = np.random.default_rng(seed)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (4 * count, 2))
    ray = homogeneous(x) @ np.linalg.inv(K).T
    inverse = random.uniform(1 / 12, 1 / 3, len(x)) if kind == "general" else ray @ NORMAL
    # half as far as the plane, or twice
    leaves = random.random(len(x)) < off_plane
    inverse = np.where(leaves, inverse * random.choice([0.5, 2.0], len(x)), inverse)
    y = project((ray @ R.T + (kind != "rotation") * BASELINE * inverse[:, None] * T) @ K.T)
    ok = (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y = x[ok][:count], y[ok][:count]
    assert len(x) == count
    x, y, wrong = spoiled(x, y, noise, outliers, random)
    return Scene(Matches(x, y), wrong)


def by_chance(count: int, seed: int) -> Matches:
    random = np.random.default_rng(seed)
    return Matches(random.uniform((0, 0), SIZE, (count, 2)), random.uniform((0, 0), SIZE, (count, 2)))


# --- fundamental matrices ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("outliers", [0.0, 0.6])
def test_the_first_candidate_explains_what_is_true(outliers: float) -> None:
    made = scene("general", 1, 400, 0.5, outliers)
    found = fundamental_candidates(made.matches, 0)
    true = made.matches.subset(~made.wrong)
    assert (np.abs(sampson_residuals(found[0], true.x, true.y)) < FUNDAMENTAL.inlier_px).mean() > 0.95
    threshold = FUNDAMENTAL.inlier_px * made.matches.scale
    cost = [np.minimum(np.abs(sampson_residuals(F, made.matches.x, made.matches.y)), threshold).sum() for F in found]
    assert len(found) >= 2 and cost == sorted(cost)


def test_the_same_seed_gives_the_same_candidates() -> None:
    matches = scene("general", 2, 200, 1.0, 0.5).matches
    one = fundamental_candidates(matches, 3)
    cv2.setRNGSeed(99)
    other = fundamental_candidates(matches, 3)
    assert [F.tobytes() for F in one] == [F.tobytes() for F in other]


@pytest.mark.parametrize("count", [FUNDAMENTAL.min_inliers + 1, 400])
def test_fewer_that_agree_than_needed_are_counted_in_the_refusal(count: int) -> None:
    needed = max(FUNDAMENTAL.min_inliers, math.ceil(0.08 * count))
    with pytest.raises(NoOverlap, match=rf"{count} points look alike .* at least {needed} needed"):
        fundamental_candidates(by_chance(count, 0), 0)


@pytest.mark.parametrize("seed", [29, 90, 102])
def test_points_in_one_spot_do_not_crash_opencv(seed: int) -> None:
    """With these OpenCV 4.11 fails an assertion of its own."""
    random = np.random.default_rng(seed)
    matches = Matches(random.normal(500, 0.1, (110, 2)), random.normal(400, 0.1, (110, 2)))
    assert all(F.shape == (3, 3) and np.isfinite(F).all() for F in fundamental_candidates(matches, 0))


def test_whatever_opencv_fails_at_poselib_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> None:
        raise cv2.error("assertion failed")

    monkeypatch.setattr(cv2, "findFundamentalMat", failing)
    matches = scene("general").matches
    found = fundamental_candidates(matches, 0)
    assert len(found) == 2
    assert (np.abs(sampson_residuals(found[0], matches.x, matches.y)) < FUNDAMENTAL.inlier_px).mean() > 0.95


# --- chance --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [40, 300])
def test_as_many_on_their_lines_as_chance_would_bring_are_refused(n: int) -> None:
    """The expected number of such findings, in whole numbers: at most one is beyond chance."""
    alpha = 2 * FUNDAMENTAL.inlier_px * math.hypot(*SIZE) / (SIZE[0] * SIZE[1])
    beyond = next(
        k for k in range(8, n)
        if math.log((n - 7) * math.comb(n, k) * math.comb(k, 7)) + (k - 7) * math.log(alpha) <= 0
    )  # fmt: skip
    inside = scene("general", 0, n, 0.0).matches
    for on, refused in ((beyond - 1, True), (beyond, False)):
        y = inside.y.copy()
        line = homogeneous(inside.x) @ F_TRUE.T
        y[on:] += 50 * line[on:, :2] / np.linalg.norm(line[on:, :2], axis=1, keepdims=True)  # well off their lines
        matches = Matches(inside.x, y)
        assert (np.abs(sampson_residuals(F_TRUE, matches.x, y)) < FUNDAMENTAL.inlier_px).sum() == on
        if refused:
            with pytest.raises(NoOverlap, match=f"{n} points look alike, but the {on} .* by chance"):
                refuse_chance(matches, F_TRUE, SIZE)
        else:
            refuse_chance(matches, F_TRUE, SIZE)


# --- the homography ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.2, 0.9])
@pytest.mark.parametrize("outliers", [0.0, 0.5])
@pytest.mark.parametrize("kind", ["rotation", "plane"])
def test_a_homography_is_found_and_its_sigma_is_the_noise(kind: str, outliers: float, noise: float) -> None:
    made = scene(kind, 3, 400, noise, outliers)
    found = fit_homography(made.matches, 0)
    true = OF_ROTATION if kind == "rotation" else OF_PLANE
    clean = scene(kind, 3, 400, 0.0).matches.x
    off = project(homogeneous(clean) @ found.H.T) - project(homogeneous(clean) @ true.T)
    assert np.sqrt((off**2).sum(axis=1).mean()) < noise
    # both pictures' noise, normal in two components
    within = 1 - np.exp(-((2 * FUNDAMENTAL.inlier_px / noise) ** 2) / 4)
    assert found.inliers[~made.wrong].mean() > within - 0.04 and found.inliers[made.wrong].sum() <= 4
    # the median of 200 is known to ± 6 %, and what lies beyond the threshold is missing from it
    assert found.sigma == pytest.approx(noise, rel=0.15)
    assert np.array_equal(found.error, transfer_error(found.H, made.matches))


def test_sigma_is_not_believed_to_be_below_what_keypoints_can_do() -> None:
    matches = scene("plane", 0, 100, 0.0).matches
    assert fit_homography(matches, 0).sigma == FUNDAMENTAL.least_noise_px
    assert fit_homography(Matches(matches.x, matches.y, scale=3.0), 0).sigma == 3 * FUNDAMENTAL.least_noise_px


@pytest.mark.parametrize("sign", [1, -1])
def test_a_homography_has_its_inliers_in_front(sign: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever sign it comes with."""
    estimate = poselib.estimate_homography

    def signed(*arguments: object) -> tuple[np.ndarray, dict[str, object]]:
        H, info = estimate(*arguments)
        return sign * np.asarray(H), info

    monkeypatch.setattr(poselib, "estimate_homography", signed)
    matches = scene("plane").matches
    found = fit_homography(matches, 0)
    assert ((homogeneous(matches.x) @ found.H.T)[:, 2] > 0).all()
    assert np.linalg.norm(found.H) == pytest.approx(1)


def test_a_point_behind_the_camera_is_infinitely_wrong() -> None:
    H = np.array([[1.0, 0, 0], [0, 1, 0], [-0.01, 0, 1]])  # x = 100 px is the horizon
    x = np.array([[50.0, 40], [100, 40], [150, 40]])
    y = np.array([[103.0, 84], [0, 0], [-300, -80]])
    assert np.allclose(transfer_error(H, Matches(x, y)), [5, np.inf, np.inf])
    assert transfer_error(-H, Matches(x, y))[0] == np.inf


def test_where_no_homography_is_found_none_is_claimed() -> None:
    one = np.full((30, 2), 7.0)
    found = fit_homography(Matches(one, one), 0)
    assert not found.inliers.any() and np.isinf(found.error).all() and np.isfinite(found.H).all()


# --- spread --------------------------------------------------------------------------------------------------------


def on_a_line(width: float, seed: int = 0, turned: bool = False) -> Matches:
    """General matches whose reference (or target) points lie in a strip `width` px wide across the picture."""
    random = np.random.default_rng(seed)
    along, across = random.uniform(-350, 350, 200), random.uniform(-width / 2, width / 2, 200)
    direction = np.array([np.cos(0.3), np.sin(0.3)])
    here = np.array([600, 450]) + along[:, None] * direction + across[:, None] * (-direction[1], direction[0])
    first, t = (R, T) if not turned else (R.T, -R.T @ T)
    ray = homogeneous(here) @ np.linalg.inv(K).T
    there = project((ray @ first.T + BASELINE * random.uniform(1 / 12, 1 / 3, (200, 1)) * t) @ K.T)
    return Matches(there, here) if turned else Matches(here, there)


@pytest.mark.parametrize("turned", [False, True], ids=["in the reference", "in the target"])
def test_a_line_in_either_picture_tells_nothing(turned: bool) -> None:
    for width in (0.0, 4.0):
        with pytest.raises(DegenerateGeometry, match="the 200 matching points .* one line"):
            refuse_without_spread(on_a_line(width, turned=turned), F_TRUE, SIZE, SIZE)


@pytest.mark.parametrize("turned", [False, True], ids=["in the reference", "in the target"])
def test_a_narrow_strip_is_enough(turned: bool) -> None:
    """Two pictures that hardly overlap share no more than that."""
    refuse_without_spread(on_a_line(24.0, turned=turned), F_TRUE, SIZE, SIZE)


def test_a_spot_tells_nothing() -> None:
    x = np.array([600, 450]) + np.random.default_rng(0).uniform(-3, 3, (200, 2))
    ray = homogeneous(x) @ np.linalg.inv(K).T
    y = project((ray @ R.T + BASELINE * 0.2 * T) @ K.T)
    with pytest.raises(DegenerateGeometry, match="one spot"):
        refuse_without_spread(Matches(x, y), F_TRUE, SIZE, SIZE)


def test_only_what_agrees_counts_and_a_stray_spans_no_plane() -> None:
    line, all_over = on_a_line(0.0), scene("general", 0, 60, 0.0).matches
    x, y = np.concatenate([line.x, all_over.x]), np.concatenate([line.y, all_over.y])
    refuse_without_spread(Matches(x, y), F_TRUE, SIZE, SIZE)  # more than one in ten is no stray
    off = np.where(np.arange(len(x))[:, None] < 200, 0.0, (0.0, 60.0))
    for astray in (Matches(x, y + off), Matches(x[:203], y[:203])):
        with pytest.raises(DegenerateGeometry):
            refuse_without_spread(astray, F_TRUE, SIZE, SIZE)


@pytest.mark.parametrize("seed", range(6))
def test_outliers_do_not_make_an_area_of_a_line(seed: int) -> None:
    """A fifth of outliers, of which the F that is found explains some by chance, and noise."""
    line, strays = on_a_line(0.0, seed), by_chance(50, seed)
    x, y = np.concatenate([line.x, strays.x]), np.concatenate([line.y, strays.y])
    matches = Matches(*(points + np.random.default_rng(seed).normal(0, 0.5, points.shape) for points in (x, y)))
    with pytest.raises(DegenerateGeometry):
        refuse_without_spread(matches, fundamental_candidates(matches, 0)[0], SIZE, SIZE)


def test_what_a_line_is_follows_the_picture_and_the_noise() -> None:
    matches = on_a_line(24.0)
    for size, scale in ((SIZE, 6.0), ((3000, 3000), 1.0)):
        with pytest.raises(DegenerateGeometry):
            refuse_without_spread(Matches(matches.x, matches.y, scale), F_TRUE, size, SIZE)


def test_a_strip_is_measured_by_the_shorter_side_of_its_own_picture() -> None:
    long, square = (4000, 900), (4000, 4000)
    for turned in (False, True):
        matches = on_a_line(24.0, turned=turned)
        own, other = (SIZE, long) if turned else (long, SIZE)
        refuse_without_spread(matches, F_TRUE, own, other)
        with pytest.raises(DegenerateGeometry):
            refuse_without_spread(matches, F_TRUE, *((SIZE, square) if turned else (square, SIZE)))


# --- parallax ------------------------------------------------------------------------------------------------------


def parallax(matches: Matches, size: tuple[int, int] = SIZE) -> bool:
    return shows_parallax(matches, fundamental_candidates(matches, 0)[0], fit_homography(matches, 0), size)


@pytest.mark.parametrize("outliers", [0.0, 0.6])
@pytest.mark.parametrize("noise", [0.0, 0.8])
@pytest.mark.parametrize("kind", KINDS)
def test_only_a_general_scene_shows_parallax(kind: str, noise: float, outliers: float) -> None:
    for seed in range(2):
        matches = scene(kind, seed, 300, noise, outliers).matches
        assert parallax(matches) == (kind == "general"), seed


@pytest.mark.parametrize("outliers", [0.0, 0.4])
def test_a_few_points_off_a_plane_are_coincidence_and_many_are_not(outliers: float) -> None:
    for seed in range(2):
        matches = scene("plane", seed, 400, 0.5, outliers, off_plane=0.15).matches
        assert parallax(matches), seed
        matches = scene("plane", seed, 400, 0.5, outliers).matches
        line = homogeneous(matches.x[:2]) @ F_TRUE.T
        along = np.column_stack([-line[:, 1], line[:, 0]]) / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
        matches.y[:2] += 60 * along
        assert not parallax(matches), seed


def test_what_leaves_across_the_lines_is_no_parallax() -> None:
    """Noise, a bent lens and moving things leave in all directions."""
    matches = scene("plane", 0, 300, 0.2).matches
    homography = fit_homography(matches, 0)
    line = homogeneous(matches.x) @ F_TRUE.T
    normal = line[:, :2] / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    along = np.column_stack([-normal[:, 1], normal[:, 0]])
    aside = 8 * np.where(np.arange(300) % 2, 1, -1)[:60, None]
    y = matches.y.copy()
    y[:60] += aside * along[:60]
    assert shows_parallax(Matches(matches.x, y), F_TRUE, homography, SIZE)
    y[60:120] += aside * normal[60:120]
    assert not shows_parallax(Matches(matches.x, y), F_TRUE, homography, SIZE)


@pytest.mark.parametrize("count", [100, 1000])
def test_fewer_than_so_many_or_such_a_share_are_never_parallax(count: int) -> None:
    matches = scene("plane", 0, count, 0.0).matches
    homography = fit_homography(matches, 0)
    line = homogeneous(matches.x) @ F_TRUE.T
    along = np.column_stack([-line[:, 1], line[:, 0]]) / np.linalg.norm(line[:, :2], axis=1, keepdims=True)
    enough = max(FUNDAMENTAL.min_off_plane, math.ceil(FUNDAMENTAL.min_off_plane_share * count))
    for off, expected in ((enough - 1, False), (2 * enough, True)):
        y = matches.y.copy()
        y[:off] += 30 * along[:off]
        assert shows_parallax(Matches(matches.x, y), F_TRUE, homography, SIZE) == expected


@pytest.mark.parametrize("kind, off_plane", [("rotation", 0.0), ("plane", 0.0), ("plane", 0.15), ("general", 0.0)])
def test_neither_order_nor_direction_decides(kind: str, off_plane: float) -> None:
    matches = scene(kind, 0, 300, 0.5, 0.4, off_plane).matches
    seen = parallax(matches)
    assert seen == (kind == "general" or off_plane > 0)
    assert parallax(matches.subset(np.random.default_rng(0).permutation(300))) == seen
    assert parallax(Matches(matches.y, matches.x)) == seen
    enlarged = Matches(3 * matches.x, 3 * matches.y, scale=3.0)
    assert parallax(enlarged, (3 * SIZE[0], 3 * SIZE[1])) == seen
    F, homography = fundamental_candidates(matches, 0)[0], fit_homography(matches, 0)
    assert shows_parallax(matches, -4 * F, homography, SIZE) == seen


def test_whatever_poselib_fails_at_opencv_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of its F one that sends every point to a line far away."""
    far = np.array([[0, 0, 0], [0, 0, 0], [0, 1e-5, 1.0]])
    monkeypatch.setattr("edf_stitch.core.pose.fundamental.robust_fundamental", lambda *_: far)
    truth = scene("general", 0, 300, 0.5, 0.3)
    on, sigma = explained_by(fundamental_candidates(truth.matches, 0)[0], truth.matches)
    assert on.sum() > 180 and sigma < 1
