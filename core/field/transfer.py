"""From a canvas point and its inverse depth to the target pixel, and back: x' ~ H_inf p + d e'."""

from __future__ import annotations

import numpy as np

from ..cameras.projective import homogeneous, project
from ..cameras.two_view import TwoView
from ..raster.arrays import Array


def target_points(two_view: TwoView, points: Array, inverse_depth: Array) -> Array:
    """Target pixels π(H_inf p + d e').

    Parameters
    ----------
    two_view : TwoView
    points : (…, 2) array
        p, ideal pixels of the reference's plane.
    inverse_depth : (…) array
        d; NaN is allowed where there is no baseline.

    Returns
    -------
    (…, 2) array
        Ideal target pixels, NaN where the point lies behind the target camera.
    """
    x, y = points[..., 0], points[..., 1]
    return np.stack(transfer(two_view, [(h[0] * x + h[1] * y) + h[2] for h in two_view.H_inf], inverse_depth), axis=-1)


def transfer(two_view: TwoView, infinite: list[Array], inverse_depth: Array) -> tuple[Array, Array]:
    """x and y (…) of π(q + d e') for the three coordinates (…) of q = H_inf p (see `Canvas.project_rows`) and d (…).

    NaN where the point lies behind the target camera.
    """
    e = two_view.e_prime
    depth = inverse_depth if e.any() else 0.0  # without a baseline no depth, not even NaN, moves a point
    a, b, c = (part + depth * e[k] for k, part in enumerate(infinite))
    # relative to the ray's own length: less than this in front is behind for any picture
    c = np.where(c <= 1e-6 * np.maximum(np.abs(a), np.abs(b)), np.nan, c)
    return a / c, b / c


def inverse_depths(two_view: TwoView, x: Array, y: Array) -> tuple[Array, Array]:
    """Inverse depths of matches: d_i = argmin |π(H_inf x_i + d e') − y_i|.

    The algebraic solution −(y×q)·(y×e') / |y×e'|², q = H_inf x, is refined by Gauss-Newton steps.

    Parameters
    ----------
    two_view : TwoView
        With a baseline (e' ≠ 0).
    x, y : (N, 2) array
        Matched points of the reference and of the target, ideal px.

    Returns
    -------
    d : (N,) array
        Inverse depths, NaN where the point comes to lie behind the target camera.
    sensitivity : (N,) array
        |∂π/∂d| there, target px per unit of d.
    """
    q = homogeneous(x) @ two_view.H_inf.T
    e = two_view.e_prime
    yh = homogeneous(y)
    cross_e = np.cross(yh, e)
    d = -np.sum(np.cross(yh, q) * cross_e, axis=1) / np.maximum(np.sum(cross_e**2, axis=1), 1e-300)
    for _ in range(8):
        ray = q + d[:, None] * e
        slope = _slope(ray, e)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.sum(slope * (y - project(ray)), axis=1) / np.maximum(np.sum(slope**2, axis=1), 1e-300)
        d = np.where(np.isfinite(step), d + step, d)
    ray = q + d[:, None] * e
    behind = ray[:, 2] <= 0
    return np.where(behind, np.nan, d), np.where(behind, np.nan, np.linalg.norm(_slope(ray, e), axis=1))


def _slope(ray: Array, e: Array) -> Array:
    """∂π(ray)/∂d (N, 2) for rays (N, 3) that change by e (3,) per unit of d."""
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Array = (e[:2] * ray[:, 2:] - ray[:, :2] * e[2]) / ray[:, 2:] ** 2
        return result
