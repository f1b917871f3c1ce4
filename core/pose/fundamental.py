"""Robust fundamental matrix and homography from matches alone, and tests whether their support is more than chance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import poselib
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, project, sampson_residuals
from ..raster.arrays import Array
from ..raster.robust import sigma_of, sigma_of_lengths
from ..system.errors import DegenerateGeometry, NoOverlap
from .options import FUNDAMENTAL


def fundamental_candidates(matches: Matches, seed: int) -> list[Array]:
    """Fundamental matrices (3, 3) worth refining, best first.

    PoseLib's LO-RANSAC and OpenCV's MAGSAC++, each with a sharp and a wide threshold: where a lens bends lines, a sharp
    one locks on to a part of the picture. Raises NoOverlap when no more agree than chance would bring.
    """
    found: list[Array] = []
    for factor in FUNDAMENTAL.threshold_factors:
        threshold = factor * FUNDAMENTAL.inlier_px * matches.scale
        found.append(robust_fundamental(matches, threshold, seed))
        cv2.setRNGSeed(seed)
        try:
            F, _ = cv2.findFundamentalMat(
                matches.x, matches.y, cv2.USAC_MAGSAC, threshold, FUNDAMENTAL.confidence, FUNDAMENTAL.iterations
            )
        except cv2.error:  # an assertion of its own about points that determine nothing
            continue
        if F is not None and F.shape == (3, 3):
            found.append(F)
    threshold = FUNDAMENTAL.inlier_px * matches.scale
    ranked = []
    for F in found:
        if np.isfinite(F).all() and F.any():
            residual = np.abs(sampson_residuals(F, matches.x, matches.y))
            # linear within the threshold, so that one sharp and one wide F compare fairly
            ranked.append((np.minimum(residual / threshold, 1.0).sum(), F, int((residual < threshold).sum())))
    ranked.sort(key=lambda item: item[0])
    agree = ranked[0][2] if ranked else 0
    needed = max(FUNDAMENTAL.min_inliers, int(np.ceil(FUNDAMENTAL.min_inlier_share * len(matches))))
    if agree < needed:
        raise NoOverlap(
            f"{len(matches)} points look alike but only {agree} agree on a camera motion, at least {needed} needed: "
            "the pictures seem to have no content in common"
        )
    return [F for _, F, _ in ranked]


def explained_by(F: Array, matches: Matches) -> tuple[NDArray[np.bool_], float]:
    """Which matches (N,) lie on the lines of F, and the noise of a Sampson distance among them in px."""
    residual = np.abs(sampson_residuals(F, matches.x, matches.y))
    on = residual < FUNDAMENTAL.inlier_px * matches.scale
    sigma = sigma_of(residual[on]) if on.any() else 0.0
    return on, max(sigma, FUNDAMENTAL.least_noise_px * matches.scale)


def robust_fundamental(matches: Matches, threshold: float, seed: int) -> Array:
    """The fundamental matrix (3, 3) with most matches within `threshold` px, by PoseLib's LO-RANSAC."""
    options = {"max_epipolar_error": threshold, "seed": seed, "max_iterations": FUNDAMENTAL.iterations}
    return np.asarray(poselib.estimate_fundamental(matches.x, matches.y, options, {})[0])


def refuse_chance(matches: Matches, F: Array, size: tuple[int, int]) -> None:
    """Raises NoOverlap where so many points on their lines would be found among matches drawn at random.

    The expected number of such findings, a contrario (Moisan and Stival, IJCV 2004, eq. 10): (n − 7) C(n, k) C(k, 7)
    α^(k − 7) with α the chance of a point lying within the threshold of a line.
    """
    threshold = FUNDAMENTAL.inlier_px * matches.scale
    n, k = len(matches), int(explained_by(F, matches)[0].sum())
    alpha = min(1.0, 2 * threshold * math.hypot(*size) / (size[0] * size[1]))
    findings = math.log(n - 7) + _log_choose(n, k) + _log_choose(k, 7) + (k - 7) * math.log(alpha)
    if findings > 0:
        raise NoOverlap(
            f"{n} points look alike, but the {k} that agree on a camera motion could agree by chance: the pictures "
            "seem to have no content in common"
        )


def _log_choose(n: int, k: int) -> float:
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


@dataclass(frozen=True)
class Homography:
    """H (3, 3), target ~ H reference; error (N,) px of each match, infinite behind the camera; `inliers` (N,); sigma:
    noise of a coordinate in px."""

    H: Array
    error: Array
    inliers: NDArray[np.bool_]
    sigma: float


def fit_homography(matches: Matches, seed: int) -> Homography:
    """Fit the homography that explains most matches, by PoseLib's LO-RANSAC.

    Parameters
    ----------
    matches : Matches
        At least four.
    seed : int
        Of RANSAC.

    Returns
    -------
    Homography
        The identity without inliers if none is found.
    """
    options = {
        "max_reproj_error": 2 * FUNDAMENTAL.inlier_px * matches.scale,
        "seed": seed,
        "max_iterations": FUNDAMENTAL.homography_iterations,
    }
    H, info = poselib.estimate_homography(matches.x, matches.y, options, {})
    inliers = np.asarray(info["inliers"], bool)
    H = np.asarray(H, np.float64)
    if not np.isfinite(H).all() or inliers.sum() < 4:
        return Homography(np.eye(3), np.full(len(matches), np.inf), np.zeros(len(matches), bool), matches.scale)
    # the sign that has the inliers in front
    H = H * np.sign(np.median(homogeneous(matches.x[inliers]) @ H[2])) / np.linalg.norm(H)
    error = transfer_error(H, matches)
    # the noise of both pictures
    sigma = max(sigma_of_lengths(error[inliers]) / math.sqrt(2), FUNDAMENTAL.least_noise_px * matches.scale)
    return Homography(H, error, inliers, sigma)


def transfer_error(H: Array, matches: Matches) -> Array:
    """|π(H x) − y| (N,) px; infinite where H x lies behind the camera."""
    ray = homogeneous(matches.x) @ H.T
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(project(ray) - matches.y, axis=1)
    return np.where(ray[:, 2] > 0, error, np.inf)


def refuse_without_spread(matches: Matches, F: Array, size: tuple[int, int], target_size: tuple[int, int]) -> None:
    """Raises DegenerateGeometry where the matches that F explains lie in one spot or on one line of a picture."""
    agree, _ = explained_by(F, matches)
    for points, picture_size in ((matches.x[agree], size), (matches.y[agree], target_size)):
        centred = points - np.median(points, axis=0)
        # nine in ten, and a direction that few strays cannot turn: they span no area
        weight = np.ones(len(centred))
        for _ in range(10):
            direction = np.linalg.svd(centred * weight[:, None], full_matrices=False)[2][1]
            distance = np.abs(centred @ direction)
            weight = 1 / np.maximum(distance, matches.scale)
        across = float(np.percentile(distance, 90))
        if across < max(FUNDAMENTAL.min_spread * min(picture_size), 2 * matches.scale):
            raise DegenerateGeometry(
                f"the {int(agree.sum())} matching points all lie in one spot or on one line: that tells nothing about "
                "how the cameras stood; pictures are needed that share an area, with detail all over it"
            )


def shows_parallax(matches: Matches, F: Array, homography: Homography, target_size: tuple[int, int]) -> bool:
    """Whether matches leave the homography along the lines of F, more than noise and coincidence would make them.

    Noise, outliers and a homography that fits badly scatter matches along their lines and across them alike; parallax
    only along. And given a homography an F keeps two free parameters, its epipole: among random outliers some would
    always be found on the lines of some F, so their number must be beyond that, a contrario (cf. `refuse_chance`).
    """
    line = homogeneous(matches.x) @ F.T
    normal = line[:, :2] / np.maximum(np.hypot(line[:, 0], line[:, 1]), 1e-300)[:, None]
    ray = homogeneous(matches.x) @ homography.H.T
    front = ray[:, 2] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = np.where(front[:, None], matches.y - project(ray), np.inf)
    explained, sigma = explained_by(F, matches)
    on = FUNDAMENTAL.on_line_sigmas * sigma
    off = max(FUNDAMENTAL.off_plane_sigmas * sigma, FUNDAMENTAL.off_plane_px * matches.scale)
    with np.errstate(invalid="ignore"):
        along = np.abs(moved[:, 1] * normal[:, 0] - moved[:, 0] * normal[:, 1])
        across = np.abs(np.sum(moved * normal, axis=1))
        distance = np.abs(np.sum(matches.y * normal, axis=1) + line[:, 2] / np.hypot(line[:, 0], line[:, 1]))
    parallax = int(((distance < on) & ((along > off) | ~front)).sum())
    scatter = int((front & (across > off) & (along < on)).sum())
    astray = int((~front | (np.maximum(along, across) > off)).sum())
    # a band of the picture's diagonal times twice the tolerance
    alpha = min(1.0, 2 * on * math.hypot(*target_size) / (target_size[0] * target_size[1]))
    coincidences = 2 * math.log(max(astray, 2)) + _log_choose(astray, parallax) + parallax * math.log(alpha)
    needed = max(FUNDAMENTAL.min_off_plane, FUNDAMENTAL.min_off_plane_share * explained.sum())
    enough = parallax >= needed and parallax > FUNDAMENTAL.along_to_across * scatter
    return bool(enough and coincidences < FUNDAMENTAL.max_log_coincidences)
