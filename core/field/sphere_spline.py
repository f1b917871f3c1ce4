"""Smoothing splines on the sphere: the thin plate's kernel of the chords between unit rays.

r² ln r is conditionally positive definite of order 2 in space as well as in the plane (Duchon 1977), so the system is
that of `spline` with one more coordinate. Functions a·r + b have no energy: as inverse ranges these are all planes
(d = n·r) and all spheres about the viewpoint. Over small angles it is the planar spline.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from ..raster.arrays import Array
from ..system.threads import each
from .fade import fading
from .options import SPLINE
from .spline import SmoothingProblem


@dataclass(frozen=True, eq=False)
class SphereSpline:
    """f(r) = Σ w_i ½ c_i² ln c_i² + a·(r, 1) / unit, c_i = |r − r_i| / unit, for unit rays r.

    centres (N, 3): r_i / unit; weights w (N, k) and affine a (4, k) of k functions; unit: radians.
    """

    centres: Array
    weights: Array
    affine: Array
    unit: float

    def at(self, rays: Array) -> Array:
        """Values (…, k) at unit rays (…, 3); the kernel's logarithm in float32."""
        points = rays.reshape(-1, 3) / self.unit
        out: Array = points @ self.affine[:-1] + self.affine[-1]
        half = (0.5 * self.weights).astype(np.float32)
        rows = max(1, SPLINE.line_values_at_once // max(1, len(self.centres)))

        def add(start: int) -> None:
            r2 = squared_chords(points[start : start + rows], self.centres, self.unit).astype(np.float32)
            np.maximum(r2, np.float32(1e-20), out=r2)
            r2 *= cv2.log(r2)
            out[start : start + rows] += r2 @ half

        if len(self.centres):
            each(add, range(0, len(points), rows))
        return out.reshape(*rays.shape[:-1], out.shape[1])


def squared_chords(points: Array, centres: Array, unit: float) -> Array:
    """|p − c|² (N, M) of points (N, 3) and centres (M, 3) that all have the length 1 / unit."""
    squared = points @ (-2 * centres.T)
    squared += 2 / unit**2
    return squared


def share_near(points: Array, rays: Array, reach: float, width: float) -> Array:
    """1 (N,) for unit rays (N, 3) up to `reach` from the nearest of some points (M, 3), fading to 0 over `width`; both
    are chords in radians."""
    return fading(np.maximum(cKDTree(points).query(rays)[0] - reach, 0.0), width)


def problem_on_sphere(rays: Array, noise: Array, unit: float) -> SmoothingProblem:
    """The smoothing problem of values at unit rays (N, 3) with relative noise (N,); λ in units of unit² rad²."""
    return SmoothingProblem.build(rays, noise, unit, np.zeros(3))


def solved_on_sphere(problem: SmoothingProblem, values: Array, smoothing: float) -> tuple[SphereSpline, Array]:
    """The spline of values (N, k) at λ = smoothing, and its residuals (N, k)."""
    spline, residual = problem.solve(values, smoothing)
    return SphereSpline(spline.centres, spline.weights, spline.affine, spline.scale), residual
