"""Relative pose and calibration of two cameras from matches.

A robust F comes first, then focal length, rotation and baseline direction are refined on the Sampson distance. H_inf
cannot come from F alone, for every H_inf + e' mᵀ fits it: it needs calibration. So the result is the pose, refined with
a prior on the focal length that counts less the more the matches say, and F, H_inf and e' are computed from it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera, Knowledge
from ..cameras.matches import Matches
from ..cameras.projective import infinite_homography, inverse_intrinsics, sampson_residuals
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.robust import sigma_of
from ..system.errors import DegenerateGeometry, NoOverlap, TooFewMatches
from .focal import focal_warnings, held_focal, known_focal
from .fundamental import (
    Homography,
    explained_by,
    fit_homography,
    fundamental_candidates,
    refuse_chance,
    refuse_without_spread,
    robust_fundamental,
    shows_parallax,
    transfer_error,
)
from .options import ESTIMATION, FUNDAMENTAL
from .refinement import Pose, pose_of_fundamental, refine_pose, shared_focal_sigma
from .rotation import fit_rotation
from .zoom import with_two_focals


def estimate(matches: Matches, camera: Camera, camera_prime: Camera, seed: int = 0) -> TwoView:
    """Estimate pose, calibration and inliers of a pair from its matches.

    Parameters
    ----------
    matches : Matches
        In px of the pictures that the cameras describe, free of lens distortion.
    camera, camera_prime : Camera
        What is known of the reference's and the target's camera. Where both have a pose, only inliers are found.
    seed : int
        Of RANSAC; the same seed gives the same result.

    Returns
    -------
    TwoView
        Of the model that the matches support: `general`, `rotation` or `plane`.

    Raises
    ------
    TooFewMatches
        Fewer than `EstimationOptions.min_matches`.
    NoOverlap
        The matches agree on no more than chance would bring, or both pictures show the same.
    DegenerateGeometry
        No pose has the matches in front of both cameras, or given cameras contradict them.
    """
    if len(matches) < ESTIMATION.min_matches:
        raise TooFewMatches(
            f"only {len(matches)} matching points found, at least {ESTIMATION.min_matches} needed: the pictures must "
            "show the same things over about a quarter of their area; try pictures taken closer together, or sharper "
            "ones, or give matches by hand (--matches)"
        )
    if camera.pose is not None and camera_prime.pose is not None:
        return _from_known_cameras(matches, camera, camera_prime, camera.pose, camera_prime.pose)
    candidates = fundamental_candidates(matches, seed)
    F = candidates[0]
    refuse_chance(matches, F, camera_prime.size)
    refuse_without_spread(matches, F, camera.size, camera_prime.size)
    homography = fit_homography(matches, seed)
    parallax = shows_parallax(matches, F, homography, camera_prime.size)
    if not parallax:
        rotated = _same_viewpoint(matches, homography, camera, camera_prime)
        if rotated is not None:
            return rotated
        if camera.assumed or camera_prime.assumed:
            return _plane_without_pose(matches, homography, camera, camera_prime)
    # matches on a plane cannot tell its direction from the calibration, and those that edges contradict mislead
    refined = parallax and camera.knowledge != Knowledge.EDGES
    first, second = (
        c if refined else replace(c.with_focal_held(), principal_sigma=0.0) for c in (camera, camera_prime)
    )
    pose, inliers, sigma, zoom = _fit_pose(matches, candidates, homography, first, second, seed)
    if not parallax and inliers.sum() < ESTIMATION.plane_inlier_share * homography.inliers.sum():
        return _plane_without_pose(matches, homography, camera, camera_prime)
    if inliers.sum() < FUNDAMENTAL.min_inliers:
        raise DegenerateGeometry(
            f"no pair of cameras explains more than {int(inliers.sum())} of {len(matches)} matches: the pictures "
            "seem to have no content in common, or the focal length that was given is not theirs"
        )
    front = pose.in_front(matches.subset(inliers))
    if front.mean() < ESTIMATION.min_front_share:
        if not parallax:
            return _plane_without_pose(matches, homography, camera, camera_prime)
        raise DegenerateGeometry(
            f"only {front.mean():.0%} of {len(front)} consistent points lie in front of both cameras: "
            "the pictures' geometry makes no sense; give the focal length (--focal-px, --focal35) "
            "or check that neither picture is mirrored"
        )
    fit = matches.subset(inliers), pose, camera, camera_prime, sigma
    known = known_focal(*fit, zoom) if refined else held_focal(*fit)
    warnings = [*focal_warnings(pose, camera, camera_prime), *known.warnings]
    if camera.fixed and camera_prime.fixed:
        warnings += _contradiction(matches, F, inliers, sigma)
    off = np.abs(sampson_residuals(pose.F, matches.x, matches.y))
    warnings += _about_given(matches, off)
    return TwoView(
        K=pose.K, K_prime=pose.K_prime, R=pose.R, t=pose.t, F=pose.F,
        H_inf=infinite_homography(pose.K, pose.K_prime, pose.R), e_prime=pose.K_prime @ pose.t,
        inliers=inliers | matches.given, sigma=sigma, model="general" if parallax else "plane",
        why=_why(inliers, homography, parallax, zoom), focal_source=known.source, focal_deviation=known.deviation,
        h_inf_spread=known.h_inf_spread, warnings=tuple(warnings),
        contradicting=int(_contradicting(matches, off).sum()),
    )  # fmt: skip


def _why(inliers: NDArray[np.bool_], homography: Homography, parallax: bool, zoom: bool) -> str:
    """In words, what the choice between the general and the plane model rests on."""
    why = (
        f"{int(inliers.sum())} of {len(inliers)} matches on their epipolar lines, "
        f"{int(homography.inliers.sum())} on one homography"
    )
    if not parallax:
        why += "; nothing leaves that plane along its epipolar lines beyond noise and coincidence"
    if zoom:
        why += "; the second focal length was freed: the matches contradict a common one"
    return why


def _same_viewpoint(
    matches: Matches, homography: Homography, camera: Camera, camera_prime: Camera
) -> TwoView | None:
    """The rotation model if it explains the homography's matches about as well, else None.

    Raises NoOverlap where the two pictures show the same to within half a pixel.
    """
    on = matches.subset(homography.inliers)
    rotation = fit_rotation(on, homography.H, camera, camera_prime, homography.sigma)
    error = transfer_error(rotation.H_inf, matches)
    with np.errstate(invalid="ignore"):  # infinitely far off where a point comes to lie behind the camera
        typical, found = (float(np.percentile(e[homography.inliers], 80)) for e in (homography.error, error))
    allowed = max(ESTIMATION.rotation_factor * typical, ESTIMATION.rotation_px * matches.scale)
    if found > allowed:
        return None
    if camera.size == camera_prime.size:
        moved = np.linalg.norm(on.x - on.y, axis=1)
        if np.percentile(moved, 95) < ESTIMATION.same_view_px * matches.scale + 3 * homography.sigma:
            raise NoOverlap(
                "the two pictures show the same from the same place: there is nothing to stitch; choose two "
                "photographs taken from different places"
            )
    inliers = error < max(2 * allowed, ESTIMATION.inlier_px * matches.scale)
    why = (
        f"one rotation explains {int(inliers.sum())} of {len(matches)} matches, and nothing leaves it along epipolar "
        "lines beyond noise and coincidence: both pictures were taken from the same place"
    )
    none = np.zeros(3)
    return TwoView(
        K=rotation.K, K_prime=rotation.K_prime, R=rotation.R, t=none, F=np.full((3, 3), np.nan),
        H_inf=rotation.H_inf, e_prime=none, inliers=inliers | matches.given, sigma=homography.sigma, model="rotation",
        why=why, focal_source=f"the matches, from {camera.source}" if camera.assumed else camera.source,
        focal_deviation=0.0 if camera.fixed else math.nan, h_inf_spread=math.nan,
        warnings=(
            "the pictures were taken from the same place: there is no depth in them", *_about_given(matches, error),
        ), contradicting=int(_contradicting(matches, error).sum()),
    )  # fmt: skip


def _plane_without_pose(
    matches: Matches, homography: Homography, camera: Camera, camera_prime: Camera
) -> TwoView:
    """The plane model where nothing usable is known of the cameras: the homography is all there is."""
    unknown = np.full((3, 3), np.nan)
    why = (
        f"one homography explains {int(homography.inliers.sum())} of {len(matches)} matches, and nothing leaves it "
        "along epipolar lines beyond noise and coincidence: one plane, or a scene too far away for the step between "
        "the cameras"
    )
    return TwoView(
        K=camera.K, K_prime=camera_prime.K, R=unknown, t=np.full(3, np.nan), F=unknown, H_inf=homography.H,
        e_prime=np.zeros(3), inliers=homography.inliers | matches.given, sigma=homography.sigma, model="plane", why=why,
        focal_source=camera.source, focal_deviation=math.nan, h_inf_spread=math.nan,
        warnings=(
            "all that matches lies on one plane: the cameras cannot be told from it, and depth is meaningless; give "
            "the focal length if you need them",
            *_about_given(matches, homography.error),
        ), contradicting=int(_contradicting(matches, homography.error).sum()),
    )  # fmt: skip


def _contradiction(matches: Matches, F: Array, inliers: NDArray[np.bool_], sigma: float) -> list[str]:
    """A warning where cameras that were given explain clearly less than free ones would."""
    agree, noise = explained_by(F, matches)
    if inliers.sum() >= ESTIMATION.given_inlier_share * agree.sum() and sigma <= ESTIMATION.given_noise_factor * noise:
        return []
    return [
        f"the matches contradict the given cameras: {int(inliers.sum())} matches lie within {sigma:.2f} px of their "
        f"epipolar lines; with other focal lengths {int(agree.sum())} would, within {noise:.2f} px"
    ]


def _contradicting(matches: Matches, off: Array) -> NDArray[np.bool_]:
    """Which matches (N,) that the user gave lie too far, `off` (N,) px, from where they should; none that were found.
    """
    return (off > ESTIMATION.given_match_px * matches.scale) & matches.given


def _about_given(matches: Matches, off: Array) -> list[str]:
    """A warning about matches that the user gave, hence all used, and that contradict the rest."""
    wrong = _contradicting(matches, off)
    if not wrong.any():
        return []
    worst = int(np.argmax(off))
    (x, y), (x2, y2) = matches.x[worst], matches.y[worst]
    return [
        f"{int(wrong.sum())} of the given matches contradict the rest by more than {ESTIMATION.given_match_px:g} px "
        f"(the worst, {x:.1f},{y:.1f} and {x2:.1f},{y2:.1f}: {off[worst]:.1f} px); they are used all the same"
    ]


def _fit_pose(
    matches: Matches, candidates: list[Array], homography: Homography, camera: Camera, camera_prime: Camera, seed: int
) -> tuple[Pose, NDArray[np.bool_], float, bool]:
    """The pose, its inliers, their noise, and whether the second focal length was freed."""
    starts = _best_starts(matches, candidates, homography, camera, camera_prime)
    refined = [_refine_with_inliers(matches, p, camera, camera_prime, False) for p in starts]
    best = _least_truncated(matches, refined)
    # a wide threshold lets in stray matches that pull the pose; one as sharp as the noise found does not
    sharp = min(ESTIMATION.sharp_sigmas * best[2], ESTIMATION.sharp_share * FUNDAMENTAL.inlier_px * matches.scale)
    F = robust_fundamental(matches, sharp, seed)
    again = pose_of_fundamental(matches, F, best[0].K, best[0].K_prime, sharp)
    best = _least_truncated(matches, [best, _refine_with_inliers(matches, again, camera, camera_prime, False)])
    zoomed = with_two_focals(matches, best[0], F, camera, camera_prime, best[2])
    if zoomed is None:
        return *best, False
    return *_refine_with_inliers(matches, zoomed, camera, camera_prime, True), True


def _best_starts(
    matches: Matches, candidates: list[Array], homography: Homography, camera: Camera, camera_prime: Camera
) -> list[Pose]:
    """The poses to refine from, best first: every F at several focal lengths, and, if most points lie on a plane, where
    F is unstable, those that its homography allows.

    The cost has several minima, so all are refined a little and compared by one robust cost with a wide scale.
    """
    factors = [1.0]
    if not (camera.fixed or camera_prime.fixed) and shared_focal_sigma(camera, camera_prime) > ESTIMATION.ladder_sigma:
        factors += [rung * max(camera.size) / camera.focal for rung in ESTIMATION.focal_ladder]
    few = matches.thinned(ESTIMATION.start_matches)
    starts: list[Pose] = []
    for factor in factors:
        K, K_prime = camera.scaled(factor), camera_prime.scaled(factor)
        for F in candidates if factor == 1.0 else candidates[:1]:
            starts.append(pose_of_fundamental(few, F, K, K_prime, 2 * FUNDAMENTAL.inlier_px * matches.scale))
    if homography.inliers.sum() > ESTIMATION.plane_start_share * len(matches):
        on = few.subset(transfer_error(homography.H, few) < 2 * FUNDAMENTAL.inlier_px * matches.scale)
        starts += _poses_of_plane(on, homography.H, camera, camera_prime)
    # a few iterations for all, many for the best three
    sigma = ESTIMATION.start_sigma_px * matches.scale
    fewer = few.thinned(ESTIMATION.start_matches // 2)
    rough = sorted(
        (refine_pose(fewer, p, camera, camera_prime, sigma, iterations=3) for p in starts), key=lambda item: item[1]
    )
    fine = (refine_pose(few, p, camera, camera_prime, sigma, iterations=30) for p, _ in rough[:3])
    return [pose for pose, _ in sorted(fine, key=lambda item: item[1])]


def _poses_of_plane(on: Matches, H: Array, camera: Camera, camera_prime: Camera) -> list[Pose]:
    """The two poses, of those that a plane's homography allows, that have most of its matches in front."""
    calibrated = inverse_intrinsics(camera_prime.K) @ H @ camera.K
    count, rotations, translations, _ = cv2.decomposeHomographyMat(calibrated, np.eye(3))
    found: list[tuple[int, Pose]] = []
    for R, t in zip(rotations[:count], translations[:count], strict=True):
        length = float(np.linalg.norm(t))
        if length > 1e-9 and np.isfinite(R).all():
            for pose in (Pose(camera.K, camera_prime.K, R, sign * t[:, 0] / length) for sign in (1, -1)):
                found.append((int(pose.in_front(on).sum()), pose))
    found.sort(key=lambda item: -item[0])
    return [pose for _, pose in found[:2]]


def _refine_with_inliers(
    matches: Matches, pose: Pose, camera: Camera, camera_prime: Camera, zoom: bool
) -> tuple[Pose, NDArray[np.bool_], float]:
    """Refine on the matches near their lines with σ re-estimated, until the inliers stay: pose, inliers, σ px."""
    least, most = (px * matches.scale for px in (FUNDAMENTAL.least_noise_px, FUNDAMENTAL.inlier_px))
    sigma, threshold = most / 2, ESTIMATION.inlier_px * matches.scale
    inliers = np.zeros(len(matches), bool)
    for _ in range(ESTIMATION.rounds):
        residual = np.abs(sampson_residuals(pose.F, matches.x, matches.y))
        new = residual < np.clip(3 * sigma, threshold, 1.5 * threshold)
        if new.sum() < FUNDAMENTAL.min_inliers:
            break
        settled = np.array_equal(new, inliers)
        inliers, previous = new, sigma
        some = matches.subset(inliers).thinned(ESTIMATION.refinement_matches)
        pose, _ = refine_pose(some, pose, camera, camera_prime, sigma, zoom=zoom)
        residual = np.abs(sampson_residuals(pose.F, matches.x[inliers], matches.y[inliers]))
        sigma = float(np.clip(sigma_of(residual), least, most))
        if settled and abs(sigma / previous - 1) < 0.05:
            break
    return pose, inliers, sigma


def _least_truncated(
    matches: Matches, refined: list[tuple[Pose, NDArray[np.bool_], float]]
) -> tuple[Pose, NDArray[np.bool_], float]:
    """The refinement with the least truncated squared residual over all matches, in the sharpest one's σ.

    A point behind a camera counts as an outlier: nothing else distinguishes the two poses that a plane allows.
    """
    if len(refined) == 1:
        return refined[0]
    sharpest = min(sigma for _, _, sigma in refined)

    def cost(pose: Pose) -> float:
        squared = (sampson_residuals(pose.F, matches.x, matches.y) / sharpest) ** 2
        return float(np.where(pose.in_front(matches), np.minimum(squared, 9.0), 9.0).sum())

    return min(refined, key=lambda item: cost(item[0]))


def _from_known_cameras(
    matches: Matches, camera: Camera, camera_prime: Camera, pose: tuple[Array, Array], pose_prime: tuple[Array, Array]
) -> TwoView:
    """The geometry of cameras given with their poses; only the inliers and their noise are estimated."""
    (R1, t1), (R2, t2) = pose, pose_prime
    R = R2 @ R1.T
    t = t2 - R @ t1
    if np.linalg.norm(t) <= 1e-9 * (np.linalg.norm(t1) + np.linalg.norm(t2)):  # rounding far from the origin
        raise DegenerateGeometry(
            "the two given cameras stand in the same place: without a baseline there is no depth to fit"
        )
    relative = Pose(camera.K, camera_prime.K, R, t / np.linalg.norm(t))
    residual = np.abs(sampson_residuals(relative.F, matches.x, matches.y))
    explained = ESTIMATION.given_camera_px * matches.scale
    inliers = residual < explained
    free = fundamental_candidates(matches, 0)[0]
    agree = np.abs(sampson_residuals(free, matches.x, matches.y)) < explained
    if inliers.sum() < max(FUNDAMENTAL.min_inliers, ESTIMATION.given_camera_share * agree.sum()):
        raise DegenerateGeometry(
            f"the given cameras explain only {int(inliers.sum())} of {len(matches)} matches: check that K, R and "
            "t belong to these pictures, in this order, with R and t taking world points into the camera "
            "(x ~ K (R X + t))"
        )
    front = relative.in_front(matches.subset(inliers))
    if front.mean() < ESTIMATION.min_front_share:
        raise DegenerateGeometry(
            f"by the given cameras only {front.mean():.0%} of {len(front)} matching points lie in front of both, "
            "at least half needed: R and t must take world points into the camera (x ~ K (R X + t), z ahead); check "
            "the sign of t and whether R is to be transposed"
        )
    sigma = float(max(sigma_of(residual[inliers]), ESTIMATION.given_camera_noise_px * matches.scale))
    why = f"cameras given; they explain {int(inliers.sum())} of {len(matches)} matches"
    return TwoView(
        K=relative.K, K_prime=relative.K_prime, R=R, t=relative.t, F=relative.F,
        H_inf=infinite_homography(relative.K, relative.K_prime, R), e_prime=relative.K_prime @ relative.t,
        inliers=inliers | matches.given, sigma=sigma, model="general", why=why, focal_source=camera.source,
        focal_deviation=0.0, h_inf_spread=0.0, warnings=tuple(_about_given(matches, residual)),
        contradicting=int(_contradicting(matches, residual).sum()),
    )  # fmt: skip
