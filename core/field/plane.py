"""The plane that a displacement field continues as outside the overlap.

The least-squares plane of the whole overlap need not lie on any surface: it would cut a room's corner diagonally. What
lies beyond the border most often continues the largest flat surface next to it, so that surface is searched for. On
rendered rooms and streets this gains 2 to 9 dB over the whole picture, measured against the truth.
"""

from __future__ import annotations

import numpy as np

from ..cameras.projective import ahead_of_camera, homogeneous, project
from ..raster.arrays import Array
from ..raster.robust import sigma_of
from .options import PLANE


def fit_plane(x: Array, d: Array, sensitivity: Array, noise_px: float) -> Array:
    """The plane m (3,) that minimises Σ ρ(s_i (d_i − m·x_i)), by iteratively reweighted least squares.

    x (N, 2) px, d (N,), sensitivity s (N,) px per unit of d. ρ is Cauchy's, its scale from the residuals (px), at least
    noise_px.
    """
    centre, scale = x.mean(axis=0), max(float(x.std()), 1e-9)
    design = np.column_stack([(x - centre) / scale, np.ones(len(x))])
    weight = sensitivity.copy()
    coefficients = np.zeros(3)
    for _ in range(PLANE.max_reweightings):
        previous = coefficients
        coefficients = np.linalg.lstsq(design * weight[:, None], d * weight, rcond=None)[0]
        residual = sensitivity * (d - design @ coefficients)
        scale_px = max(noise_px, sigma_of(residual))
        weight = sensitivity / np.sqrt(1 + (residual / (2.385 * scale_px)) ** 2)
        if np.abs(coefficients - previous).max() < 1e-10 * np.abs(coefficients).max():
            break
    a, b = coefficients[:2] / scale
    return np.array([a, b, coefficients[2] - a * centre[0] - b * centre[1]])


def beyond_reference(H: Array, size: tuple[int, int], target_size: tuple[int, int]) -> Array:
    """Points (N, 2) px on the reference's border across which the target shows more, by a homography H (3, 3) from
    reference to target; size, target_size: (W, H) px. Empty where the target shows nothing beyond the reference.
    """
    last = np.array(target_size) - 1.0
    u, v = np.meshgrid(np.linspace(0, last[0], PLANE.target_nodes), np.linspace(0, last[1], PLANE.target_nodes))
    back = homogeneous(np.column_stack([u.ravel(), v.ravel()])) @ np.linalg.inv(H).T
    points = project(back[ahead_of_camera(*back.T)])
    end = np.array(size) - 1.0
    result: Array = np.clip(points[((points < 0) | (points > end)).any(axis=1)], 0, end)
    return result


def continued_plane(
    x: Array, d: Array, sensitivity: Array, weight: Array, beyond: Array, side: float, tolerance_px: float,
    noise_px: float,
) -> Array:  # fmt: skip
    """The plane m (3,) that holds the most area near the border points `beyond` (M, 2) px.

    Planes through three random matches (RANSAC, Fischler and Bolles 1981) are scored by the area whose matches lie
    within tolerance_px of them (MSAC, Torr and Zisserman 2000); the best is fitted again to its inliers. x (N, 2) px, d
    (N,), sensitivity (N,) px per unit of d, weight (N,); side: of the picture, px.
    """
    distance = np.linalg.norm(x[:, None] - beyond[None], axis=2).min(axis=1)
    cell = np.floor(x / (PLANE.cell * side)).astype(int)
    cell_of = np.unique(cell, axis=0, return_inverse=True)[1].ravel()
    area = np.exp(-distance / (PLANE.nearby * side)) * weight / np.bincount(cell_of, weight)[cell_of]
    random = np.random.default_rng(0)
    triples = random.choice(len(x), (PLANE.draws, 3), p=area / area.sum())
    # in normalised coordinates the determinant measures how far three points are from one line
    centre = x.mean(axis=0)
    points = homogeneous((x - centre) / side)
    triples = triples[np.abs(np.linalg.det(points[triples])) > PLANE.cell**2]
    if not len(triples):
        return fit_plane(x, d, sensitivity, noise_px)
    planes = np.linalg.solve(points[triples], d[triples][..., None])[..., 0]
    error = np.square(sensitivity * (d - planes @ points.T) / tolerance_px)
    best = int(np.argmin(np.minimum(error, 1) @ area))
    inlier = error[best] < 4  # twice the tolerance: the plane through three matches is not yet the best one
    return fit_plane(x[inlier], d[inlier], sensitivity[inlier] * np.sqrt(area[inlier]), noise_px)
