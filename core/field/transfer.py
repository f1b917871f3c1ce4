"""From a canvas point and its inverse depth to a picture's pixel, and back: x' ~ H_inf p + d e'."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..cameras.projective import ahead_of_camera, homogeneous, project
from ..raster.arrays import Array


class Transfer(Protocol):
    """What leads from canvas points to a picture, a `View` or a `TwoView`: H_inf (3, 3) and e_prime (3,)."""

    @property
    def H_inf(self) -> Array: ...

    @property
    def e_prime(self) -> Array: ...


def target_points(view: Transfer, points: Array, inverse_depth: Array) -> Array:
    """Pixels of a picture, π(H_inf p + d e').

    Parameters
    ----------
    view : Transfer
    points : (…, 2) array
        p, ideal pixels of the reference's plane.
    inverse_depth : (…) array
        d; NaN is allowed where there is no baseline.

    Returns
    -------
    (…, 2) array
        Ideal pixels, NaN where the point lies behind the picture's camera.
    """
    x, y = points[..., 0], points[..., 1]
    return np.stack(transfer(view, [(h[0] * x + h[1] * y) + h[2] for h in view.H_inf], inverse_depth), axis=-1)


def transfer(view: Transfer, infinite: list[Array], inverse_depth: Array) -> tuple[Array, Array]:
    """Pixels of a picture from canvas points that were brought to infinity: π(q + d e').

    Parameters
    ----------
    view : Transfer
    infinite : list of three (…) arrays
        The coordinates of q = H_inf p (see `Canvas.project_rows`).
    inverse_depth : (…) array
        d.

    Returns
    -------
    x, y : (…) arrays
        Ideal px, NaN where the point lies behind the picture's camera.
    """
    e = view.e_prime
    depth = inverse_depth if e.any() else 0.0  # without a baseline no depth, not even NaN, moves a point
    a, b, c = (part + depth * e[k] for k, part in enumerate(infinite))
    c = np.where(ahead_of_camera(a, b, c), c, np.nan)
    return a / c, b / c


def inverse_depths(view: Transfer, x: Array, y: Array) -> tuple[Array, Array]:
    """Inverse depths of matches: d_i = argmin |π(H_inf x_i + d e') − y_i|.

    The algebraic solution −(y×q)·(y×e') / |y×e'|², q = H_inf x, is refined by Gauss-Newton steps.

    Parameters
    ----------
    view : Transfer
        With a baseline (e' ≠ 0).
    x, y : (N, 2) array
        Matched points of the reference and of the target, ideal px.

    Returns
    -------
    d : (N,) array
        Inverse depths, NaN where the point comes to lie behind the picture's camera.
    sensitivity : (N,) array
        |∂π/∂d| there, target px per unit of d.
    """
    q = homogeneous(x) @ view.H_inf.T
    e = view.e_prime
    yh = homogeneous(y)
    cross_e = np.cross(yh, e)
    d = -np.sum(np.cross(yh, q) * cross_e, axis=1) / np.maximum(np.sum(cross_e**2, axis=1), 1e-300)
    for _ in range(8):
        ray = q + d[:, None] * e
        slope = slope_of(ray, e)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.sum(slope * (y - project(ray)), axis=1) / np.maximum(np.sum(slope**2, axis=1), 1e-300)
        d = np.where(np.isfinite(step), d + step, d)
    ray = q + d[:, None] * e
    behind = ray[:, 2] <= 0
    return np.where(behind, np.nan, d), np.where(behind, np.nan, np.linalg.norm(slope_of(ray, e), axis=1))


def slope_of(ray: Array, e: Array) -> Array:
    """∂π(ray)/∂d (…, 2) for rays (…, 3) that change by e (3,) per unit of d."""
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Array = (e[:2] * ray[..., 2:] - ray[..., :2] * e[2]) / ray[..., 2:] ** 2
        return result
