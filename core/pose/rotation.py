"""Two pictures from the same viewpoint: the camera was rotated, and perhaps zoomed, between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..cameras.camera import Camera
from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, infinite_homography, inverse_intrinsics, project, rotation_from_vector
from ..raster.arrays import Array
from .options import ROTATION


@dataclass(frozen=True)
class Rotation:
    """K, K_prime (3, 3) px and R (3, 3): target ~ K' R K⁻¹ reference."""

    K: Array
    K_prime: Array
    R: Array

    @property
    def H_inf(self) -> Array:
        """K' R K⁻¹."""
        return infinite_homography(self.K, self.K_prime, self.R)


def fit_rotation(matches: Matches, H: Array, camera: Camera, camera_prime: Camera, sigma: float) -> Rotation:
    """The rotation, and the focal lengths that are not fixed, which explain the matches of a homography H best.

    Minimises the transfer error in units of `sigma` px with a Cauchy loss, and the priors of the focal lengths;
    two that are not fixed are expected to be off by the same factor.
    """
    from scipy.optimize import least_squares  # takes long to load, and few pairs come here

    few = matches.thinned(ROTATION.matches)
    x, most = homogeneous(few.x), ROTATION.max_residual
    free, free_prime = not camera.fixed, not camera_prime.fixed

    def unpack(p: Array) -> Rotation:
        zoom = np.exp(p[3]) if free else 1.0
        zoom_prime = np.exp(p[-1]) if free_prime else 1.0
        return Rotation(camera.scaled(zoom), camera_prime.scaled(zoom_prime), rotation_from_vector(p[:3]) @ start)

    def residuals(p: Array) -> Array:
        ray = x @ unpack(p).H_inf.T
        with np.errstate(divide="ignore", invalid="ignore"):
            away = (project(ray) - few.y) / sigma
        # behind the camera the error has no meaning: the largest
        away = np.where((ray[:, 2:] > 0) & np.isfinite(away), np.clip(away, -most, most), most)
        prior = [p[3] / camera.log_sigma] if free else []
        if free_prime:
            prior.append(p[-1] / camera_prime.log_sigma)
        if free and free_prime:
            prior.append((p[3] - p[-1]) / ROTATION.common_focal_sigma)
        return np.concatenate([away.ravel(), prior])

    factors = [1.0]
    if free and camera.assumed:
        factors += [share * max(camera.size) / camera.focal for share in ROTATION.focal_starts]
    found: list[tuple[float, Rotation]] = []
    for factor in factors:
        K, K_prime = camera.scaled(factor if free else 1.0), camera_prime.scaled(factor if free_prime else 1.0)
        start = nearest_rotation(inverse_intrinsics(K_prime) @ H @ K)
        p = np.zeros(3 + free + free_prime)
        p[3:] = np.log(factor)
        solution = least_squares(residuals, p, loss="cauchy", max_nfev=ROTATION.evaluations)
        found.append((float(solution.cost), unpack(solution.x)))
    return min(found, key=lambda item: item[0])[1]


def nearest_rotation(M: Array) -> Array:
    """The rotation nearest to a multiple of M (orthogonal Procrustes)."""
    U, _, Vt = np.linalg.svd(M)
    R: Array = U @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(U @ Vt)))]) @ Vt
    return R
