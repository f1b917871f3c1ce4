"""One homography for the whole picture: stitching without parallax, and the start of the other rivals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, normalisation
from ..cameras.two_view import TwoView
from ..field.field import FieldValues, Fit
from ..field.options import FADE
from ..field.transfer import target_points
from ..pose.fundamental import fit_homography, transfer_error
from ..raster.arrays import Array
from ..raster.grid import Grid
from ..system.errors import DegenerateGeometry
from .options import HOMOGRAPHY


@dataclass(frozen=True)
class HomographyField:
    """x' = π(H p); two_view: with H in place of H_inf and no poses."""

    two_view: TwoView
    fit: Fit

    name = "homography"

    @property
    def plane(self) -> Array:
        """0 (3,): nothing is added to H."""
        return np.zeros(3)

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Neither depth (NaN) nor shift."""
        return FieldValues(np.full(grid.points.shape[:2], np.nan))

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) px."""
        return target_points(self.two_view, points, np.full(len(points), np.nan))

    def refitted(self, matches: Matches) -> HomographyField:
        """H fitted to other matches, none dropped. Raises DegenerateGeometry."""
        H, _ = _settled(self.two_view.H_inf, matches)
        return _field(self.two_view, H, np.full(len(matches), True), matches)


def fit_one_homography(two_view: TwoView, matches: Matches, seed: int = 0) -> HomographyField:
    """Fits one homography: MAGSAC++ (Barath et al., CVPR 2020), then reweighted fits with Tukey's biweight.

    Parameters
    ----------
    two_view : TwoView
    matches : Matches
        Its inliers, ideal px; of matches given by the user none is dropped or weighted down.
    seed : int
        Of the random samples.

    Returns
    -------
    HomographyField

    Raises
    ------
    DegenerateGeometry
        The matches do not determine a homography.
    """
    start = np.eye(3)
    if not matches.given:
        cv2.setRNGSeed(seed)
        inlier_px = HOMOGRAPHY.inlier_px * matches.scale
        found, _ = cv2.findHomography(
            matches.x, matches.y, cv2.USAC_MAGSAC, inlier_px,
            maxIters=HOMOGRAPHY.magsac_iterations, confidence=HOMOGRAPHY.magsac_confidence,
        )  # fmt: skip
        start = fit_homography(matches, seed).H if found is None or not np.isfinite(found).all() else found
        start = start * np.sign(np.median(homogeneous(matches.x) @ start[2]))
    return _field(two_view, *_settled(start, matches), matches=matches)


def _settled(H: Array, matches: Matches) -> tuple[Array, NDArray[np.bool_]]:
    """The homography (3, 3) that reweighted fits from H on converge to, and the mask (N,) of matches with a weight in
    it: all of them if given by the user. Raises DegenerateGeometry."""
    if matches.given:
        return direct_linear(matches.x, matches.y, matches.weights), np.full(len(matches), True)
    H = H / np.linalg.norm(H)
    inlier_px = HOMOGRAPHY.inlier_px * matches.scale
    if np.sum(transfer_error(H, matches) < inlier_px) < HOMOGRAPHY.min_matches:  # H is of other matches altogether
        H = direct_linear(matches.x, matches.y, matches.weights)
    for _ in range(HOMOGRAPHY.max_reweightings):
        off = transfer_error(H, matches) / inlier_px
        weight = matches.weights * np.square(1 - np.square(np.minimum(off, 1.0)))
        near, previous = weight > 0, H
        H = direct_linear(matches.x[near], matches.y[near], weight[near])
        if np.abs(H - previous).max() < HOMOGRAPHY.settled * np.abs(H).max():
            break
    return H, near


def _field(two_view: TwoView, H: Array, inliers_used: NDArray[np.bool_], matches: Matches) -> HomographyField:
    view = knowing_only(two_view, H)
    off = transfer_error(H, matches.subset(inliers_used))
    fit = Fit(inliers_used, np.nan, FADE.min_px * matches.scale, float(np.sqrt(np.mean(off**2))), np.nan, np.nan)
    return HomographyField(view, fit)


def knowing_only(two_view: TwoView, H: Array) -> TwoView:
    """A geometry with the homography H (3, 3) in place of H_inf, e' = 0, and NaN for R, t and F."""
    unknown = np.full((3, 3), np.nan)
    return replace(two_view, R=unknown, t=np.full(3, np.nan), F=unknown, H_inf=H, e_prime=np.zeros(3))


def direct_linear(x: Array, y: Array, weight: Array) -> Array:
    """H (3, 3) with y ~ H x for matches (N ≥ 6, 2) px and weights (N,), by the normalised direct linear transformation
    (Hartley and Zisserman, algorithm 4.2); its sign has most points in front. Raises DegenerateGeometry."""
    linear = LinearEquations.of(x, y, weight)
    result: Array = linear.solutions(np.ones((1, len(x))))[0]
    return result


@dataclass(frozen=True)
class LinearEquations:
    """The equations y × H x = 0 of matches in normalised coordinates: two rows a for each match.

    products (N, 81): weight · Σ a aᵀ over the rows of a match; x (N, 2) px; T, T_prime (3, 3): the normalisations.
    """

    products: Array
    x: Array
    T: Array
    T_prime: Array

    @staticmethod
    def of(x: Array, y: Array, weight: Array) -> LinearEquations:
        """Of matches x, y (N, 2) px and weights (N,). Raises DegenerateGeometry for too few, one spot or one line."""
        if len(x) < HOMOGRAPHY.min_matches:
            needed = HOMOGRAPHY.min_matches
            raise DegenerateGeometry(f"{len(x)} matches do not determine a homography, at least {needed} needed")
        for points in (x, y):
            spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
            if spread[1] < 1e-3 * spread[0] or spread[0] < 1e-9:
                raise DegenerateGeometry("the matches do not determine a homography: they lie in one spot or on a line")
        T, T_prime = normalisation(x), normalisation(y)
        a, b = homogeneous(x) @ T.T, homogeneous(y) @ T_prime.T
        zero = np.zeros_like(a)
        rows = np.stack([
            np.hstack([a, zero, -b[:, :1] * a]), np.hstack([zero, a, -b[:, 1:2] * a])
        ], axis=1)  # fmt: skip
        products = np.einsum("nki,nkj,n->nij", rows, rows, weight).reshape(len(x), 81)
        return LinearEquations(products, x, T, T_prime)

    def solutions(self, share: Array) -> Array:
        """Homographies (M, 3, 3) for weights `share` (M, N) of the matches: the eigenvectors of the least eigenvalues
        of Σ share · a aᵀ."""
        systems = (share @ self.products).reshape(-1, 9, 9)
        h = np.linalg.eigh(systems)[1][:, :, 0].reshape(-1, 3, 3)
        H = np.linalg.inv(self.T_prime) @ h @ self.T
        H /= np.linalg.norm(H, axis=(1, 2), keepdims=True)
        # the sign that has most of the matches in front
        ahead = np.einsum("mj,nj->mn", H[:, 2], homogeneous(self.x))
        result: Array = H * np.where((share * np.sign(ahead)).sum(axis=1) < 0, -1.0, 1.0)[:, None, None]
        return result
