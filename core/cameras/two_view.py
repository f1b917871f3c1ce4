"""The geometry of a pair of cameras, as data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array


@dataclass(frozen=True)
class TwoView:
    """The geometry of a pair: a canvas point p at inverse depth d is seen at H_inf p + d e' (docs/method.md, 2).

    Attributes
    ----------
    K, K_prime : (3, 3)
        Intrinsics of reference and target, px.
    R, t : (3, 3), (3,)
        Reference to target camera, R X + t, with |t| = 1.
    F : (3, 3)
        Fundamental matrix, x'ᵀ F x = 0.
    H_inf, e_prime : (3, 3), (3,)
        K' R K⁻¹ and K' t.
    inliers : (N,) bool
        The matches that are explained.
    sigma : float
        Noise of the inliers' Sampson distances, px.
    model : str
        `general`; `rotation`: both from the same place, t = e_prime = 0 and F is NaN; `plane`: no parallax off a plane.
        If the cameras cannot be found from it, H_inf is the plane's homography, e_prime = 0 and F, R, t are NaN.
    why : str
        How the model was chosen, in words.
    focal_source : str
        Where the focal length comes from, in words.
    focal_deviation : float
        Standard deviation of log f by matches and prior; NaN if unknown.
    h_inf_spread : float
        px that H_inf moves when log f changes by two deviations, the median over the target; NaN if unknown.
    warnings : tuple of str
        For the user.
    contradicting : int
        How many matches that the user gave contradict the rest.
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
    h_inf_spread: float
    warnings: tuple[str, ...] = ()
    contradicting: int = 0
