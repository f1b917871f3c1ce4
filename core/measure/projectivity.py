"""Projectivity: whether straight things stay straight beyond the overlap, judged by epipolar lines.

Yu and Da (arXiv 2311.16637) warp those points of a match's epipolar line in the target that lie outside the overlap,
and measure their distance from the corresponding line in the reference's plane. All pixels x' of one line share that
line, Fᵀx', so neither a match nor the inverse of the warp is needed: every canvas pixel p outside the reference that
shows a target pixel x' is such a point, and its distance is that of p from Fᵀx'. Only the weighting differs: here it is
even over the canvas.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..cameras.matches import Matches
from ..cameras.projective import distance_to_line, homogeneous, normalisation, sampson_residuals
from ..raster.arrays import Array
from ..raster.robust import NORMAL_MEDIAN
from .metrics import CoverageSamples
from .options import INDEPENDENT


def projectivity(F: Array, shown: CoverageSamples) -> float:
    """Mean distance of canvas points outside the reference from the epipolar lines of the target pixels they show.

    Parameters
    ----------
    F : (3, 3) array
        x'ᵀ F x = 0 in ideal px.
    shown : CoverageSamples

    Returns
    -------
    float
        px of the reference's plane; NaN if there are no such points or F is NaN.

    References
    ----------
    Yu and Da, arXiv 2311.16637.
    """
    beyond = ~shown.overlap
    if not (np.isfinite(F).all() and beyond.any()):
        return float("nan")
    return float(distance_to_line(F.T, shown.target[beyond], shown.points[beyond]).mean())


def independent_fundamental(matches: Matches, seed: int = 0) -> Array:
    """F estimated independently of the stitch: no cameras, no pose, other random samples.

    MAGSAC++ finds inliers, several times; the normalised 8-point algorithm on each set, reweighted by distances
    (Cauchy), gives F; the F with the least truncated squared distance over all matches is returned.

    Parameters
    ----------
    matches : Matches
        All that were found, ideal px.
    seed : int
        Of the orders in which MAGSAC++ sees them.

    Returns
    -------
    (3, 3) array
        NaN if the matches do not determine F.

    References
    ----------
    Barath et al., MAGSAC++, CVPR 2020.
    """
    limit = INDEPENDENT.inlier_px * matches.scale
    best, least = np.full((3, 3), np.nan), np.inf
    if len(matches) < INDEPENDENT.min_matches:
        return best
    for draw in range(INDEPENDENT.draws):
        order = np.random.default_rng((seed, draw)).permutation(len(matches))  # OpenCV's samples depend on the order
        drawn = matches.subset(order)
        F, _ = cv2.findFundamentalMat(
            drawn.x, drawn.y, cv2.USAC_MAGSAC, limit, INDEPENDENT.magsac_confidence, INDEPENDENT.magsac_iterations
        )
        refitted = None if F is None or F.shape != (3, 3) else _refitted(F, drawn, limit)
        if refitted is not None:
            cost = float(np.minimum(sampson_residuals(refitted, matches.x, matches.y) ** 2, limit**2).sum())
            if cost < least:
                best, least = refitted, cost
    return best


def _refitted(F: Array, matches: Matches, limit: float) -> Array | None:
    """F (3, 3) refitted several times to the matches within `limit` px of it; None if they become too few."""
    for _ in range(INDEPENDENT.fits):
        distance = np.abs(sampson_residuals(F, matches.x, matches.y))
        agree = distance < limit
        if agree.sum() < INDEPENDENT.min_matches:
            return None
        inlier_distance = distance[agree]
        knee = max(2.385 * float(np.median(inlier_distance)) / NORMAL_MEDIAN, 1e-9)
        F = eight_point(matches.x[agree], matches.y[agree], 1 / np.sqrt(1 + (inlier_distance / knee) ** 2))
    return F


def eight_point(x: Array, y: Array, weight: Array) -> Array:
    """F (3, 3) of norm 1 with yᵀ F x = 0 for matches (N ≥ 9, 2) px and weights (N,), by the normalised 8-point
    algorithm (Hartley and Zisserman, algorithm 11.1)."""
    T, T_prime = normalisation(x), normalisation(y)
    a, b = homogeneous(x) @ T.T, homogeneous(y) @ T_prime.T
    design = (b[:, :, None] * a[:, None, :]).reshape(len(x), 9) * weight[:, None]
    U, S, Vt = np.linalg.svd(np.linalg.svd(design, full_matrices=False)[2][-1].reshape(3, 3))
    F = T_prime.T @ (U * [S[0], S[1], 0.0]) @ Vt @ T
    result: Array = F / np.linalg.norm(F)
    return result
