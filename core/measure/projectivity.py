"""Projectivity: whether straight things stay straight beyond the overlap, judged by epipolar lines.

Yu and Da (arXiv 2311.16637) take the epipolar line of a match in the target, push its points that lie outside the
overlap through the warp, and measure how far they land from the corresponding line in the reference's plane. The pixels
of one line x' share one corresponding line, Fᵀx', so no match is needed and no warp inverted: every canvas pixel p
outside the reference that shows the target is such a point, x' = what it shows, and its distance is that of p from
Fᵀx'. What differs is only the weight, here even over the canvas.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..cameras.matches import Matches
from ..cameras.projective import distance_to_line, homogeneous, normalisation, sampson_residuals
from ..raster.arrays import Array
from .metrics import CoverageSamples
from .options import INDEPENDENT


def projectivity(F: Array, shown: CoverageSamples) -> float:
    """Mean distance (reference px) of canvas points outside the reference from the epipolar lines of the target pixels
    they show; NaN where there are none, or no F."""
    beyond = ~shown.overlap
    if not (np.isfinite(F).all() and beyond.any()):
        return float("nan")
    return float(distance_to_line(F.T, shown.target[beyond], shown.points[beyond]).mean())


def independent_fundamental(matches: Matches, seed: int = 0) -> Array:
    """F (3, 3) by another road than `two_view`: no cameras, no pose, other samples; NaN where the matches give none.

    matches: all that were found, in ideal px. MAGSAC++ (Barath et al., CVPR 2020) says a few times which of them agree;
    the normalised 8-point algorithm on those, reweighted by their distances (Cauchy), gives F; the best F counts, that
    with the least truncated squared distance over all matches.
    """
    limit = INDEPENDENT.inlier_px * matches.scale
    best, least = np.full((3, 3), np.nan), np.inf
    if len(matches) < INDEPENDENT.min_matches:
        return best
    for draw in range(INDEPENDENT.draws):
        order = np.random.default_rng((seed, draw)).permutation(len(matches))  # OpenCV's samples follow the order
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
    """F from the matches within `limit` px of it, and so on; None where they become too few."""
    for _ in range(INDEPENDENT.fits):
        distance = np.abs(sampson_residuals(F, matches.x, matches.y))
        agree = distance < limit
        if agree.sum() < INDEPENDENT.min_matches:
            return None
        near = distance[agree]
        knee = max(2.385 * float(np.median(near)) / 0.6745, 1e-9)
        F = eight_point(matches.x[agree], matches.y[agree], 1 / np.sqrt(1 + (near / knee) ** 2))
    return F


def eight_point(x: Array, y: Array, weight: Array) -> Array:
    """F (3, 3) of norm 1 with yᵀ F x = 0 for matches (N ≥ 9, 2) and weights (N,), by the normalised 8-point algorithm
    (H&Z algorithm 11.1)."""
    T, T_prime = normalisation(x), normalisation(y)
    a, b = homogeneous(x) @ T.T, homogeneous(y) @ T_prime.T
    design = (b[:, :, None] * a[:, None, :]).reshape(len(x), 9) * weight[:, None]
    U, S, Vt = np.linalg.svd(np.linalg.svd(design, full_matrices=False)[2][-1].reshape(3, 3))
    F = T_prime.T @ (U * [S[0], S[1], 0.0]) @ Vt @ T
    return F / np.linalg.norm(F)
