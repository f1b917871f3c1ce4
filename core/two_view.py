"""How the two cameras stood: robust F, then focal length, rotation and baseline direction on the Sampson distance.

H_inf cannot come from F alone (every H_inf + e' mᵀ fits it): it needs calibration. So F is only the way in; what is
kept is the pose, refined with a prior on the focal length that weakens as the matches' evidence grows, and F, H_inf and
e' are made from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import poselib
from numpy.typing import NDArray

from .camera import Camera
from .epipolar import (
    Array,
    fundamental_from_pose,
    in_front,
    infinite_homography,
    poses_from_fundamental,
    sampson_residuals,
)
from .errors import DegenerateGeometry, NoOverlap, TooFewMatches
from .features import Matches
from .pose_refinement import Pose, focal_deviation, refine_pose

MIN_MATCHES = 16
# A chance F gathers its 7 points and whatever lies within the threshold of its lines; this many is beyond chance.
MIN_INLIERS = 15
RANSAC_PX = 1.5
START_PX = 1.0
INLIER_PX = 2.0
ZOOM_GAIN = 0.75
PLANE_SHARE = 0.5
REFINEMENTS = 8
LEAST_PX = 0.05  # no keypoint is placed better
# Matches that choose among starts, and matches that refine: more cost time and change nothing.
FIRST_LOOK, IN_EARNEST = 400, 1500
# Focal lengths in units of the longer side, tried when nothing is known: 19 mm to 200 mm on a 36 mm frame.
FOCAL_LADDER = (0.5, 0.7, 0.9, 1.2, 1.6, 2.2, 3.2, 5.0)
# Parallax below this angle (radians) is rounding and keypoint noise: such a point may lie behind by accident.
FAR_ANGLE = 2e-3


@dataclass(frozen=True)
class TwoView:
    """The geometry of a pair: target pixel of a canvas point p at inverse depth d is H_inf p + d e' (DESIGN 1).

    K, K_prime (3, 3) px; R (3, 3), t (3,), |t| = 1: target sees X at R X + t; F with x'ᵀ F x = 0; H_inf = K' R K⁻¹;
    e_prime = K' t. `inliers` (N,) marks the matches it explains, `sigma` is their Sampson noise in px.
    `focal_deviation` is the standard deviation of log f left by matches and prior; `why` says in words how the model
    was decided.
    """

    K: Array
    K_prime: Array
    R: Array
    t: Array
    F: Array
    H_inf: Array
    e_prime: Array
    inliers: NDArray[np.bool_]
    sigma: float
    model: str
    why: str
    focal_source: str
    focal_deviation: float
    warnings: tuple[str, ...] = ()


def estimate(matches: Matches, camera: Camera, camera_prime: Camera, seed: int = 0) -> TwoView:
    """Pose, calibration and inliers of a pair from its matches.

    Raises TooFewMatches, NoOverlap (the matches agree on nothing) or DegenerateGeometry (no pose has them in front).
    """
    if len(matches) < MIN_MATCHES:
        raise TooFewMatches(
            f"only {len(matches)} matching points found, at least {MIN_MATCHES} needed: the pictures must show the "
            "same things over about a quarter of their area; try pictures taken closer together, or sharper ones"
        )
    if camera.pose is not None and camera_prime.pose is not None:
        return _from_known_cameras(matches, camera, camera_prime, camera.pose, camera_prime.pose)
    candidates = fundamental_candidates(matches, seed)
    _refuse_chance(matches, candidates[0], camera_prime.size)
    on_homography = homography_inliers(matches, seed)
    starts = _best_starts(matches, candidates, on_homography, camera, camera_prime, seed)
    zoom = _zoom_is_evident(matches, starts[0], camera, camera_prime)
    known = camera.fixed and camera_prime.fixed
    refined = [_refine_with_inliers(matches, p, camera, camera_prime, zoom) for p in (starts if known else starts[:1])]
    pose, inliers, sigma = _least_truncated(matches, refined)
    if inliers.sum() < MIN_INLIERS:
        raise DegenerateGeometry(
            f"no pair of cameras explains more than {int(inliers.sum())} of {len(matches)} matches: the pictures "
            "seem to have no content in common, or the focal length that was given is not theirs"
        )
    warnings: list[str] = []
    why = (
        f"{int(inliers.sum())} of {len(matches)} matches on their epipolar lines, {on_homography} on one homography"
    )
    if zoom:
        why += "; the second focal length was freed: the matches contradict a common one"
    deviation = focal_deviation(matches.subset(inliers), pose, camera, camera_prime, sigma)
    warnings += _focal_warnings(pose, camera, camera_prime)
    front = in_front(pose.K, pose.K_prime, pose.R, pose.t, matches.x[inliers], matches.y[inliers], FAR_ANGLE)
    if front.mean() < 0.5:
        raise DegenerateGeometry(
            f"only {front.mean():.0%} of {len(front)} consistent points lie in front of both cameras: "
            "the pictures' geometry makes no sense; give the focal length (--focal-px, --focal35) "
            "or check that neither picture is mirrored"
        )
    return _two_view(pose, inliers, sigma, why, camera.source, deviation, tuple(warnings))


def fundamental_candidates(matches: Matches, seed: int) -> list[Array]:
    """Fundamental matrices (3, 3) worth refining, best first.

    PoseLib's LO-RANSAC and OpenCV's MAGSAC++, each with a sharp and a wide threshold: where a lens bends lines, a sharp
    one locks on to a part of the picture. Raises NoOverlap when no more agree than chance would bring.
    """
    found: list[Array] = []
    for factor in (1.0, 2.0):
        threshold = factor * RANSAC_PX * matches.scale
        options = {"max_epipolar_error": threshold, "seed": seed, "max_iterations": 20000}
        found.append(np.asarray(poselib.estimate_fundamental(matches.x, matches.y, options, {})[0]))
        cv2.setRNGSeed(seed)
        F, _ = cv2.findFundamentalMat(matches.x, matches.y, cv2.USAC_MAGSAC, threshold, 0.9999, 20000)
        if F is not None and F.shape == (3, 3):
            found.append(F)
    threshold = RANSAC_PX * matches.scale
    ranked = []
    for F in found:
        if np.isfinite(F).all() and F.any():
            residual = np.abs(sampson_residuals(F, matches.x, matches.y))
            # linear within the threshold, so that one sharp and one wide F compare fairly
            ranked.append((np.minimum(residual / threshold, 1.0).sum(), F, int((residual < threshold).sum())))
    ranked.sort(key=lambda item: item[0])
    agree = ranked[0][2] if ranked else 0
    needed = max(MIN_INLIERS, int(np.ceil(0.08 * len(matches))))
    if agree < needed:
        raise NoOverlap(
            f"{len(matches)} points look alike but only {agree} agree on a camera motion, at least {needed} needed: "
            "the pictures seem to have no content in common"
        )
    return [F for _, F, _ in ranked]


def _refuse_chance(matches: Matches, F: Array, size: tuple[int, int]) -> None:
    """Raises NoOverlap where so many points on their lines would be found among matches drawn at random.

    The expected number of such findings, a contrario (Moisan and Stival, IJCV 2004, eq. 10): (n − 7) C(n, k) C(k, 7)
    α^(k − 7) with α the chance of a point lying within the threshold of a line.
    """
    threshold = RANSAC_PX * matches.scale
    n = len(matches)
    k = int((np.abs(sampson_residuals(F, matches.x, matches.y)) < threshold).sum())
    alpha = min(1.0, 2 * threshold * math.hypot(*size) / (size[0] * size[1]))
    findings = math.log(n - 7) + _log_choose(n, k) + _log_choose(k, 7) + (k - 7) * math.log(alpha)
    if findings > 0:
        raise NoOverlap(
            f"{n} points look alike, but the {k} that agree on a camera motion could agree by chance: the pictures "
            "seem to have no content in common"
        )


def _log_choose(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


def homography_inliers(matches: Matches, seed: int) -> int:
    """How many matches one homography explains: the evidence for a plane or a pure rotation."""
    _, info = poselib.estimate_homography(
        matches.x,
        matches.y,
        {"max_reproj_error": 2 * RANSAC_PX * matches.scale, "seed": seed, "max_iterations": 10000},
        {},
    )
    return int(np.sum(info["inliers"]))


def _best_starts(
    matches: Matches, candidates: list[Array], on_homography: int, camera: Camera, camera_prime: Camera, seed: int
) -> list[Pose]:
    """The poses to refine from, best first: every F at a ladder of focal lengths, and, where most points lie on a
    plane, which makes F meaningless, calibrated RANSAC, which a plane cannot fool.

    All are compared by one robust cost with a wide scale over all matches: the landscape has several valleys.
    """
    factors = [1.0]
    if not (camera.fixed or camera_prime.fixed) and camera.log_sigma > 0.1:
        factors += [rung * max(camera.size) / camera.focal for rung in FOCAL_LADDER]
    few = matches.thinned(FIRST_LOOK)
    starts: list[Pose] = []
    for factor in factors:
        K, K_prime = camera.scaled(factor), camera_prime.scaled(factor)
        for F in candidates if factor == 1.0 else candidates[:1]:
            near = few.subset(np.abs(sampson_residuals(F, few.x, few.y)) < 2 * RANSAC_PX * matches.scale)
            poses = poses_from_fundamental(F, K, K_prime)
            front = [in_front(K, K_prime, R, t, near.x, near.y, FAR_ANGLE).sum() for R, t in poses]
            starts.append(Pose(K, K_prime, *poses[int(np.argmax(front))]))
    if on_homography > PLANE_SHARE * len(matches):
        options = {"max_epipolar_error": RANSAC_PX * matches.scale, "seed": seed, "max_iterations": 2000}
        pose, _ = poselib.estimate_relative_pose(
            matches.x, matches.y, camera.as_poselib(), camera_prime.as_poselib(), options, {}
        )
        if np.isfinite(pose.R).all() and np.linalg.norm(pose.t) > 0:
            starts.append(Pose(camera.K, camera_prime.K, np.asarray(pose.R), pose.t / np.linalg.norm(pose.t)))
    # a first look at all, then the best few in earnest
    sigma = START_PX * matches.scale
    glance = few.thinned(FIRST_LOOK // 2)
    rough = sorted(
        (refine_pose(glance, p, camera, camera_prime, sigma, iterations=3) for p in starts), key=lambda item: item[1]
    )
    fine = (refine_pose(few, p, camera, camera_prime, sigma, iterations=10) for p, _ in rough[:3])
    return [pose for pose, _ in sorted(fine, key=lambda item: item[1])]


def _refine_with_inliers(
    matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, zoom: bool
) -> tuple[Pose, NDArray[np.bool_], float]:
    """Refine on the matches near their lines, let the noise scale follow, until the inliers stand still."""
    sigma = RANSAC_PX * matches.scale / 2
    inliers = np.zeros(len(matches), bool)
    for _ in range(REFINEMENTS):
        residual = np.abs(sampson_residuals(pose.F, matches.x, matches.y))
        new = residual < np.clip(3 * sigma, INLIER_PX * matches.scale, 1.5 * INLIER_PX * matches.scale)
        if new.sum() < MIN_INLIERS:
            break
        settled = np.array_equal(new, inliers)
        inliers, previous = new, sigma
        pose, _ = refine_pose(matches.subset(inliers).thinned(IN_EARNEST), pose, camera, camera_prime, sigma, zoom=zoom)
        residual = np.abs(sampson_residuals(pose.F, matches.x[inliers], matches.y[inliers]))
        # σ from the median absolute residual of a normal distribution
        sigma = float(np.clip(np.median(residual) / 0.6745, LEAST_PX * matches.scale, RANSAC_PX * matches.scale))
        if settled and abs(sigma / previous - 1) < 0.05:
            break
    return pose, inliers, sigma


def _least_truncated(
    matches: Matches, refined: list[tuple[Pose, NDArray[np.bool_], float]]
) -> tuple[Pose, NDArray[np.bool_], float]:
    """The refinement with the least truncated squared residual over all matches, in the sharpest one's σ.

    A point behind a camera is as wrong as one off its line: that alone tells the poses of a plane apart.
    """
    if len(refined) == 1:
        return refined[0]
    sharpest = min(sigma for _, _, sigma in refined)

    def cost(pose: Pose) -> float:
        squared = (sampson_residuals(pose.F, matches.x, matches.y) / sharpest) ** 2
        front = in_front(pose.K, pose.K_prime, pose.R, pose.t, matches.x, matches.y, FAR_ANGLE)
        return float(np.where(front, np.minimum(squared, 9.0), 9.0).sum())

    return min(refined, key=lambda item: cost(item[0]))


def _zoom_is_evident(matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera) -> bool:
    """Whether the pictures were clearly taken at two focal lengths.

    A second focal length also soaks up lens distortion, and then leads astray outside the overlap; so it must lower the
    mean squared residual (in units of START_PX², each at most 9) by ZOOM_GAIN, which a real zoom does at once.
    """
    if camera.fixed or camera_prime.fixed:
        return False
    few, sigma = matches.thinned(FIRST_LOOK), START_PX * matches.scale
    zoomed, _ = refine_pose(few, pose, camera, camera_prime, sigma, zoom=True)
    before, after = (np.minimum((sampson_residuals(p.F, few.x, few.y) / sigma) ** 2, 9.0) for p in (pose, zoomed))
    explained = (before < 9.0) | (after < 9.0)
    return bool(explained.any() and (before - after)[explained].mean() > ZOOM_GAIN)


def _focal_warnings(pose: Pose, camera: Camera, camera_prime: Camera) -> list[str]:
    """Say when the matches moved a focal length far from what the file claims."""
    out = []
    for name, K, cam in (("reference", pose.K, camera), ("target", pose.K_prime, camera_prime)):
        moved = K[0, 0] / cam.focal - 1
        if not cam.assumed and not cam.fixed and abs(moved) > 2 * cam.log_sigma:
            out.append(
                f"the matches contradict the {name}'s focal length: {cam.focal:.0f} px from {cam.source}, "
                f"{K[0, 0]:.0f} px ({moved:+.0%}) from the matches; was the picture cropped? "
                "give it with --focal-px if you know it"
            )
    return out


def _from_known_cameras(
    matches: Matches, camera: Camera, camera_prime: Camera, pose: tuple[Array, Array], pose_prime: tuple[Array, Array]
) -> TwoView:
    """Both cameras given with their poses: nothing to estimate but which matches they explain."""
    (R1, t1), (R2, t2) = pose, pose_prime
    R = R2 @ R1.T
    t = t2 - R @ t1
    if np.linalg.norm(t) <= 1e-9 * (np.linalg.norm(t1) + np.linalg.norm(t2)):  # rounding far from the origin
        raise DegenerateGeometry(
            "the two given cameras stand in the same place: without a baseline there is no depth to fit"
        )
    relative = Pose(camera.K, camera_prime.K, R, t / np.linalg.norm(t))
    residual = np.abs(sampson_residuals(relative.F, matches.x, matches.y))
    inliers = residual < 3.0 * matches.scale
    free = fundamental_candidates(matches, 0)[0]
    agree = np.abs(sampson_residuals(free, matches.x, matches.y)) < 3.0 * matches.scale
    if inliers.sum() < max(MIN_INLIERS, 0.5 * agree.sum()):
        raise DegenerateGeometry(
            f"the given cameras explain only {int(inliers.sum())} of {len(matches)} matches: check that K, R and "
            "t belong to these pictures, in this order, with R and t taking world points into the camera "
            "(x ~ K (R X + t))"
        )
    sigma = float(max(np.median(residual[inliers]) / 0.6745, 0.1 * matches.scale))
    why = f"cameras given; they explain {int(inliers.sum())} of {len(matches)} matches"
    return _two_view(relative, inliers, sigma, why, camera.source, 0.0, ())


def _two_view(
    pose: Pose,
    inliers: NDArray[np.bool_],
    sigma: float,
    why: str,
    source: str,
    deviation: float,
    warnings: tuple[str, ...],
) -> TwoView:
    return TwoView(
        K=pose.K, K_prime=pose.K_prime, R=pose.R, t=pose.t,
        F=fundamental_from_pose(pose.K, pose.K_prime, pose.R, pose.t),
        H_inf=infinite_homography(pose.K, pose.K_prime, pose.R), e_prime=pose.K_prime @ pose.t,
        inliers=inliers, sigma=sigma, model="general", why=why, focal_source=source,
        focal_deviation=deviation, warnings=warnings,
    )  # fmt: skip
