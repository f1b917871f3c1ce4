"""The geometry of a pair of cameras, as data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array


@dataclass(frozen=True)
class TwoView:
    """The geometry of a pair: a canvas point p at inverse depth d is seen at H_inf p + d e' (docs/method.md, 2).

    K, K_prime (3, 3) px; R (3, 3), t (3,), |t| = 1: target sees X at R X + t; F with x'ᵀ F x = 0; H_inf = K' R K⁻¹;
    e_prime = K' t. `inliers` (N,) marks the matches it explains, `sigma` is their Sampson noise in px.
    model: `general`; `rotation` (same place: t = e_prime = 0, F NaN); `plane` (no parallax off a plane; where nothing
    tells the cameras, H_inf is the plane's homography, e_prime = 0 and F, R, t are NaN). `why` says in words how it was
    decided. `focal_deviation` is the standard deviation of log f left by matches and prior, `h_inf_spread` how far (px,
    median over the target) H_inf moves within two of them; NaN where the matches tell nothing of it.
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
