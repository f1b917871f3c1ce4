"""Polar rectification: the reference's plane resampled so that its epipolar lines are rows.

Polar coordinates around the epipole (Pollefeys, Koch and Van Gool, ICCV 1999), of the reference only: the target is
warped into the reference's plane, where both have the same lines. Unlike a rectifying homography it works wherever the
epipole lies: inside the picture, beside it or at infinity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..raster.arrays import Array
from .options import LINES


@dataclass(frozen=True)
class EpipolarRows:
    """Row v, column u ↔ point p = c + r (cos θ, sin θ) with r = r₀ + u q and θ = θ₀ + v q / r₁.

    epipole: c (2,) px of the reference's plane; start: (r₀, θ₀); reach: r₁ px, the largest distance from the epipole,
    at which rows are q px apart; step: q px; shape: (rows, columns).
    """

    epipole: Array
    start: tuple[float, float]
    reach: float
    step: float
    shape: tuple[int, int]

    @staticmethod
    def over(epipole: Array, box: Array, step: float, margin: float) -> EpipolarRows:
        """Rows that cover a rectangle (left, top, right, bottom) px, extended by `margin` px at either end.

        epipole (3,): homogeneous, in the same plane.
        """
        low, high = box[:2], box[2:]
        middle, side = (low + high) / 2, float((high - low).max())
        away = epipole[:2] - epipole[2] * middle
        if np.linalg.norm(away) >= abs(epipole[2]) * LINES.max_epipole_distance * side:
            centre = middle + LINES.max_epipole_distance * side * away / np.linalg.norm(away)
        else:
            centre = epipole[:2] / epipole[2]
        u = np.linspace(0, 1, 65)
        edge = np.concatenate([np.column_stack(p) for p in ((u, 0 * u), (u, 0 * u + 1), (0 * u, u), (0 * u + 1, u))])
        r, theta = _polar(low + edge * (high - low) - centre, middle - centre)
        reach, turn = float(r.max()), float(np.arctan2(*(middle - centre)[::-1]))
        first, last = max(float(r.min()) - margin, 0.0), reach + margin
        begin, end = float(theta.min()), float(theta.max())
        if ((centre >= low) & (centre <= high)).all():
            # all the way around, and a little further: the first and the last row need neighbours
            first, begin, end = 0.0, -1.1 * np.pi, 1.1 * np.pi
        shape = int(np.ceil((end - begin) * reach / step)) + 1, int(np.ceil((last - first) / step)) + 1
        return EpipolarRows(centre, (first, turn + begin), reach, step, shape)

    def points(self, u: Array, v: Array) -> Array:
        """Points (len(v), len(u), 2) px of the reference's plane where columns u and rows v cross."""
        return self.point(u[None, :], v[:, None])

    def point(self, u: Array, v: Array) -> Array:
        """Points (…, 2) of columns u and rows v."""
        r = self.start[0] + self.step * u
        theta = self.start[1] + v * (self.step / self.reach)
        result: Array = self.epipole + r[..., None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        return result

    def column_row(self, points: Array) -> tuple[Array, Array]:
        """u and v (…) of points (…, 2) px of the reference's plane."""
        rows, _ = self.shape
        middle = self.start[1] + (rows - 1) / 2 * (self.step / self.reach)
        r, theta = _polar(points - self.epipole, np.array([np.cos(middle), np.sin(middle)]))
        return (r - self.start[0]) / self.step, (theta + (middle - self.start[1])) * (self.reach / self.step)


def _polar(away: Array, zero: Array) -> tuple[Array, Array]:
    """Distance, and angle from the direction `zero` (2,) in (−π, π], of vectors (…, 2)."""
    cosine, sine = zero / max(float(np.linalg.norm(zero)), 1e-12)
    along, across = away @ np.array([cosine, sine]), away @ np.array([-sine, cosine])
    return np.hypot(along, across), np.arctan2(across, along)
