"""The plane that a displacement field fades to outside the overlap: the one that carries on there.

A mean plane of the whole overlap lies on nothing that is there: a room's corner would continue as its diagonal. What is
seen beyond the border most often continues the largest flat thing beside it, so that one is sought. On rendered rooms
and streets this is worth 2 to 9 dB of the whole picture against the true one.
"""

from __future__ import annotations

import numpy as np

from ..cameras.projective import homogeneous, project
from ..raster.arrays import Array
from .options import PLANE


def fit_plane(x: Array, d: Array, sensitivity: Array, noise_px: float) -> Array:
    """m (3,) that minimises Σ ρ(s_i (d_i − m·x_i)) robustly (Cauchy, scale from the residuals, at least noise_px)."""
    centre, scale = x.mean(axis=0), max(float(x.std()), 1e-9)
    design = np.column_stack([(x - centre) / scale, np.ones(len(x))])
    weight = sensitivity.copy()
    coefficients = np.zeros(3)
    for _ in range(PLANE.max_reweightings):
        previous = coefficients
        coefficients = np.linalg.lstsq(design * weight[:, None], d * weight, rcond=None)[0]
        residual = sensitivity * (d - design @ coefficients)
        scale_px = max(noise_px, float(np.median(np.abs(residual))) / 0.6745)
        weight = sensitivity / np.sqrt(1 + (residual / (2.385 * scale_px)) ** 2)
        if np.abs(coefficients - previous).max() < 1e-10 * np.abs(coefficients).max():
            break
    a, b = coefficients[:2] / scale
    return np.array([a, b, coefficients[2] - a * centre[0] - b * centre[1]])


def beyond_reference(H: Array, size: tuple[int, int], target_size: tuple[int, int]) -> Array:
    """Points (N, 2) of the reference's border through which the target goes on, by a homography reference → target.

    size, target_size: (W, H) px. None where the target shows nothing else.
    """
    last = np.array(target_size) - 1.0
    u, v = np.meshgrid(np.linspace(0, last[0], PLANE.target_nodes), np.linspace(0, last[1], PLANE.target_nodes))
    back = homogeneous(np.column_stack([u.ravel(), v.ravel()])) @ np.linalg.inv(H).T
    points = project(back[back[:, 2] > 1e-6 * np.abs(back[:, :2]).max(axis=1)])
    end = np.array(size) - 1.0
    return np.clip(points[((points < 0) | (points > end)).any(axis=1)], 0, end)


def continued_plane(
    x: Array, d: Array, sensitivity: Array, weight: Array, beyond: Array, side: float, tolerance_px: float,
    noise_px: float,
) -> Array:  # fmt: skip
    """m (3,) of the plane that most of the area near the border points `beyond` (M, 2) lies on.

    x (N, 2) px, d (N,), sensitivity (N,) px per unit of d, weight (N,); side: of the picture, px. Planes through three
    matches are drawn (RANSAC, Fischler and Bolles 1981) and compared by the area whose matches lie within tolerance_px
    of them (MSAC, Torr and Zisserman 2000); the best is fitted to its matches.
    """
    distance = np.linalg.norm(x[:, None] - beyond[None], axis=2).min(axis=1)
    cell = np.floor(x / (PLANE.cell * side)).astype(int)
    of = np.unique(cell, axis=0, return_inverse=True)[1].ravel()
    area = np.exp(-distance / (PLANE.nearby * side)) * weight / np.bincount(of, weight)[of]
    random = np.random.default_rng(0)
    corners = random.choice(len(x), (PLANE.draws, 3), p=area / area.sum())
    # normalised, so that a determinant says how far three points are from lying on a line
    centre = x.mean(axis=0)
    points = homogeneous((x - centre) / side)
    corners = corners[np.abs(np.linalg.det(points[corners])) > PLANE.cell**2]
    if not len(corners):
        return fit_plane(x, d, sensitivity, noise_px)
    planes = np.linalg.solve(points[corners], d[corners][..., None])[..., 0]
    off = np.square(sensitivity * (d - planes @ points.T) / tolerance_px)
    best = int(np.argmin(np.minimum(off, 1) @ area))
    on = off[best] < 4
    return fit_plane(x[on], d[on], sensitivity[on] * np.sqrt(area[on]), noise_px)
