"""SIFT features spread evenly over a picture, and matches between two sets of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import sgemm

from ..cameras.matches import Matches
from ..raster.resizing import resized_points, size_change
from ..system.threads import in_order
from .options import FEATURES


@dataclass(frozen=True)
class Features:
    """`points` (N, 2) float64 in px of the full picture, `descriptors` (N, 128) float32 of unit length, `scale`: full
    pixels per pixel of the picture they were found in (their position noise grows with it)."""

    points: NDArray[np.float64]
    descriptors: NDArray[np.float32]
    scale: float


def detect(
    view: NDArray[np.uint8], alpha: NDArray[np.float32] | None = None, budget: int = FEATURES.budget,
    pixels: int = FEATURES.pixels,
) -> Features:  # fmt: skip
    """Detect SIFT features, spread evenly over the picture, with root-normalised descriptors.

    Parameters
    ----------
    view : (H, W, C) uint8
        A display-encoded picture, C = 1 or 3 (R, G, B).
    alpha : (H, W) float32, optional
        No features where it is 0, nor so close that the edge of the shown part would be the feature.
    budget : int
        The most features that are returned.
    pixels : int
        A picture of more pixels is shrunk to about as many first.

    Returns
    -------
    Features
        In px of the full picture.

    References
    ----------
    D. Lowe, Distinctive Image Features from Scale-Invariant Keypoints, IJCV 2004. R. Arandjelović and A. Zisserman,
    Three Things Everyone Should Know to Improve Object Retrieval, CVPR 2012 (root normalisation).
    """
    gray = cv2.cvtColor(view, cv2.COLOR_RGB2GRAY) if view.shape[2] == 3 else np.ascontiguousarray(view[..., 0])
    height, width = gray.shape
    shrink = max(1.0, np.sqrt(height * width / pixels), max(height, width) / FEATURES.side)
    small = (max(1, round(width / shrink)), max(1, round(height / shrink)))
    if shrink > 1:
        gray = cv2.resize(gray, small, interpolation=cv2.INTER_AREA)
    if min(gray.shape) < FEATURES.least_side:  # OpenCV's pyramid has nothing to stand on
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32), 1.0)
    # precise upscale: without it keypoints sit a quarter of a pixel off
    sift = cv2.SIFT_create(
        nfeatures=2 * budget, nOctaveLayers=FEATURES.octave_layers, contrastThreshold=FEATURES.contrast_threshold,
        edgeThreshold=FEATURES.edge_threshold, sigma=FEATURES.base_sigma, enable_precise_upscale=True,
    )  # fmt: skip
    keypoints = sift.detect(gray, _shown(alpha, small))
    if not keypoints:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32), 1.0)
    points = np.asarray(cv2.KeyPoint_convert(keypoints), np.float64)
    strength = np.array([k.response for k in keypoints])
    # OpenCV compares response × layers with its threshold
    floor, enough = 0.0, FEATURES.enough_points
    if len(strength) > enough:
        floor = min(FEATURES.strong_contrast / FEATURES.octave_layers, np.partition(strength, -enough)[-enough])
    strong = np.flatnonzero(strength >= floor)
    chosen = strong[spread_evenly(points[strong], strength[strong], gray.shape, budget)]
    # descriptors cost more than points, so only chosen points get one, though the pyramid is built a second time
    _, descriptors = sift.compute(gray, [keypoints[i] for i in chosen])
    descriptors = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12))
    scale = float(np.mean(size_change(small, (width, height))[0]))
    return Features(resized_points(points[chosen], small, (width, height)), descriptors, scale)


def at_once(most: int, pixels: Sequence[int]) -> int:
    """In how many pictures features may be sought at once for their memory; pixels: of each, shrunk to `most` px."""
    largest = max((min(most, one) for one in pixels), default=1)
    return max(1, FEATURES.bytes_at_once // (FEATURES.pixel_bytes * largest))


def _shown(alpha: NDArray[np.float32] | None, size: tuple[int, int]) -> NDArray[np.uint8] | None:
    if alpha is None:
        return None
    shown = cv2.resize((alpha > 0).astype(np.uint8) * 255, size, interpolation=cv2.INTER_NEAREST)
    clear: NDArray[np.uint8] = cv2.erode(shown, np.ones((2 * FEATURES.alpha_margin + 1,) * 2, np.uint8))
    return clear


def spread_evenly(
    points: NDArray[Any], strength: NDArray[Any], shape: tuple[int, ...], budget: int
) -> NDArray[np.intp]:
    """Indices of at most `budget` points (N, 2), the strongest of each cell of an even grid first, in rising order.

    In every round each cell gives its next strongest point until the budget is spent, so that a textured part does not
    take the whole of it. Ties are decided by index: the choice is the same on every machine.
    """
    if len(points) <= budget:
        return np.arange(len(points))
    side = np.sqrt(shape[0] * shape[1] / (budget / FEATURES.points_per_cell))
    cell = (points[:, 1] // side).astype(np.int64) * (int(shape[1] // side) + 1) + (points[:, 0] // side).astype(
        np.int64
    )
    order = np.lexsort((np.arange(len(points)), -strength, cell))
    starts = np.flatnonzero(np.r_[True, np.diff(cell[order]) != 0])
    rank = np.arange(len(points)) - np.repeat(starts, np.diff(np.r_[starts, len(points)]))
    by_round = order[np.lexsort((order, -strength[order], rank))]
    return np.sort(by_round[:budget])


def match(a: Features, b: Features, ratio: float = FEATURES.ratio) -> Matches:
    """Match two sets of features: mutual nearest neighbours that pass Lowe's ratio test, the same from a and from b.

    The distance to the second nearest is the geometric mean of that from a and that from b.

    Parameters
    ----------
    a, b : Features
        Of the reference and of the target.
    ratio : float
        The most that the distance of the two may be of that to the second nearest.

    Returns
    -------
    Matches
        In px of the full pictures, each pair of places (to 0.1 px) once; `scale` is the larger one of a and b.
    """
    which = match_index(a, b, ratio)
    return Matches(a.points[which[:, 0]], b.points[which[:, 1]], max(a.scale, b.scale))


def match_index(a: Features, b: Features, ratio: float = FEATURES.ratio) -> NDArray[np.intp]:
    """Which features match (M, 2): numbers into a and b; see `match`."""
    if len(a.points) < 2 or len(b.points) < 2:
        return np.empty((0, 2), np.intp)
    nearest, nearest_score, second = (np.empty(len(a.points), t) for t in (np.intp, np.float32, np.float32))
    back = np.full(len(b.points), -1, np.intp)
    back_score, back_second = np.full((2, len(b.points)), -2, np.float32)

    def best_of(start: int) -> tuple[slice, NDArray[np.float32], NDArray[np.float32]]:
        """Fills in what is nearest to some of a; which they are, and how near to each of b the nearest of them is, and
        the nearest of those whose own nearest it is not."""
        rows = slice(start, start + FEATURES.rows_at_once)
        score = _products(a.descriptors[rows], b.descriptors)
        best = score.max(axis=0)
        nearest[rows] = score.argmax(axis=1)
        index = np.arange(len(score))
        nearest_score[rows] = score[index, nearest[rows]]
        score[index, nearest[rows]] = -2
        second[rows] = score.max(axis=1)
        return rows, best, score.max(axis=0)

    # in slabs, so that memory stays bounded
    for rows, best, others in in_order(best_of, range(0, len(a.points), FEATURES.rows_at_once)):
        better = best > back_score
        back[better], back_score[better] = -1, best[better]
        np.maximum(back_second, others, out=back_second)
        # NumPy's argmax along columns takes many times as long as max: only who is nearest to its own nearest counts
        to = nearest[rows]
        mutual = np.flatnonzero(better[to] & (nearest_score[rows] == best[to]))[::-1]
        back[to[mutual]] = mutual + rows.start
    mutual = back[nearest] == np.arange(len(a.points))
    np.maximum.at(back_second, nearest[~mutual], nearest_score[~mutual])
    # unit vectors: |a − b|² = 2 − 2 a·b
    apart, apart_second, apart_back = (2 - 2 * score for score in (nearest_score, second, back_second[nearest]))
    keep = np.flatnonzero(mutual & (apart**2 < ratio**4 * apart_second * apart_back))
    keep = keep[np.argsort(apart[keep], kind="stable")]
    x, y = a.points[keep], b.points[nearest[keep]]
    # one place may carry several orientations, hence several identical matches: the nearest of them
    _, first = np.unique(np.round(np.hstack([x, y]), 1), axis=0, return_index=True)
    keep = np.sort(keep[first])
    return np.column_stack([keep, nearest[keep]])


def _products(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """a bᵀ (N, M) by SciPy's BLAS: a Blender may bring a NumPy whose own is thirty times slower (Debian's does).

    Transposed views of row-major arrays are column-major, as BLAS wants them: nothing is copied.
    """
    products: NDArray[np.float32] = sgemm(1.0, b.T, a.T, trans_a=True).T
    return products
