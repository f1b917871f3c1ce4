"""Round panoramas, cylindrical and equirectangular: which ray each of their points shows.

A panorama has axes of its own: x to the right, y down, z ahead; levelled, y is gravity. Its plane is measured in px, u
to the right and v down from the direction ahead, where both kinds have f px per radian, as the reference picture:

    r = (cos φ sin θ, sin φ, cos φ cos θ),  θ = u / f,  tan φ = v / f (cylinder)  or  φ = v / f (equirectangular)

Everything that is said of a canvas point p in the reference's plane (x' ~ H_inf p + d e', d = m·p on a plane) holds for
the rays of a round panorama with p = K r, |r| = 1 in the reference camera's frame, and d = |baseline| / range along r.
A flat panorama needs nothing of this: its p are the reference's pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..cameras.projective import homogeneous, inverse_intrinsics
from ..raster.arrays import Array
from .options import PROJECTION


@dataclass(frozen=True, eq=False)
class Projection:
    """How a round panorama's plane unrolls.

    kind: cylindrical or equirectangular; focal: px per radian; centre: (u, v) of the direction ahead, in px of the
    plane (pixel centres are integers); rotation (3, 3): from the panorama's axes to the reference camera's; K (3, 3) of
    the reference.
    """

    kind: str
    focal: float
    centre: tuple[float, float]
    rotation: Array
    K: Array

    @property
    def sphere(self) -> tuple[int, int, int, int] | None:
        """left, top, width, height (px of the plane) of the whole sphere; a cylinder has no such thing."""
        half = round(np.pi * self.focal)
        return (-half, -half // 2, 2 * half, half) if self.kind == "equirectangular" else None

    @property
    def limits(self) -> Array:
        """left, top, right, bottom (exclusive) of the plane, px."""
        if self.sphere is not None:
            left, top, width, height = self.sphere
            return np.array([left, top, left + width, top + height], np.float64)
        across, up = np.floor(np.pi * self.focal), np.floor(PROJECTION.max_cylinder_slope * self.focal)
        return np.array([-across, -up, across + 1, up + 1])

    def headings(self, u: Array) -> Array:
        """θ in radians of columns u, px of the plane."""
        return (u - self.centre[0]) / self.focal

    def elevations(self, v: Array) -> Array:
        """φ in radians, positive downwards, of rows v, px of the plane; goes on over the poles."""
        rise = (v - self.centre[1]) / self.focal
        return np.arctan(rise) if self.kind == "cylindrical" else rise

    def rays(self, points: Array) -> Array:
        """Unit rays (…, 3) in the reference camera's frame of points (…, 2) of the plane."""
        theta, phi = self.headings(points[..., 0]), self.elevations(points[..., 1])
        own = np.stack([np.cos(phi) * np.sin(theta), np.sin(phi), np.cos(phi) * np.cos(theta)], axis=-1)
        rays: Array = own @ self.rotation.T
        return rays

    def points(self, rays: Array) -> Array:
        """Points (…, 2) of the plane that show rays (…, 3) of any length, −π < θ ≤ π: the inverse of `rays`."""
        x, y, z = np.moveaxis(rays @ self.rotation, -1, 0)
        level = np.hypot(x, z)
        with np.errstate(divide="ignore"):
            rise = y / level if self.kind == "cylindrical" else np.arctan2(y, level)
        points: Array = np.stack([np.arctan2(x, z), rise], axis=-1) * self.focal + np.array(self.centre)
        return points

    def of_reference(self, points: Array) -> Array:
        """Points (…, 2) of the plane that show ideal pixels (…, 2) of the reference."""
        return self.points(homogeneous(points) @ inverse_intrinsics(self.K).T)

    def project_rows(self, rows: Array, u: Array, v: Array) -> list[Array]:
        """rows (k, 3) times p = K r, each (len(v), len(u)), for columns u and lines v, px of the plane."""
        theta, phi = self.headings(u), self.elevations(v)
        sine, cosine = np.sin(theta), np.cos(theta)
        rise, level = np.sin(phi)[:, None], np.cos(phi)[:, None]
        own = rows @ self.K @ self.rotation
        return [level * (a * sine + c * cosine) + b * rise for a, b, c in own]


def round_projection(kind: str, K: Array, rotation: Array) -> Projection:
    """The projection with as many px per radian as the middle of the reference, to within what makes a sphere of whole
    pixels.

    kind: cylindrical or equirectangular; K (3, 3) of the reference; rotation: see Projection.
    """
    focal = float(np.sqrt(K[0, 0] * K[1, 1]))
    if kind == "cylindrical":
        return Projection(kind, focal, (0.0, 0.0), rotation, K)
    # the sphere is 2 h × h px with an even h; its middle lies between pixels
    height = 2 * max(1, round(np.pi * focal / 2))
    return Projection(kind, height / np.pi, (-0.5, -0.5), rotation, K)


def extent(projection: Projection, outline: Array, shows: Callable[[Array], bool]) -> Array:
    """left, top, right, bottom (px of the plane) of what a closed outline of rays (N, 3) encloses.

    shows(ray): whether a ray lies inside. An outline that crosses the line behind, or goes round a pole, takes the
    whole width; round a pole it crosses that line, seen from which no step of it turns by half a circle.
    """
    points = projection.points(np.vstack([outline, outline[:1]]))
    left, top, right, bottom = projection.limits
    low, high = points.min(axis=0), points.max(axis=0)
    poles = [shows(sign * projection.rotation[:, 1]) for sign in (-1.0, 1.0)]
    if np.abs(np.diff(points[:, 0])).max() > (right - left) / 2:
        low[0], high[0] = left, right
    return np.array([low[0], top if poles[0] else low[1], high[0], bottom if poles[1] else high[1]])
