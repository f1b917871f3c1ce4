"""Round panoramas, cylindrical and equirectangular: which ray each of their points shows (docs/method.md, 6).

A panorama has axes of its own: x to the right, y down, z ahead; levelled, y points along gravity. Its plane is in px, u
to the right and v down from the direction ahead. There both kinds have f px per radian, as the reference has:

    r = (cos φ sin θ, sin φ, cos φ cos θ),  θ = u / f,  tan φ = v / f (cylinder)  or  φ = v / f (equirectangular)

All equations for a canvas point p of the reference's plane (x' ~ H_inf p + d e', d = m·p on a plane) hold for the rays
of a round panorama with p = K r, |r| = 1 in the reference camera's frame, and d = |baseline| / range along r.
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
    """How a round panorama is unrolled into a plane.

    Attributes
    ----------
    kind : {"cylindrical", "equirectangular"}
    focal : float
        px per radian.
    centre : (float, float)
        (u, v) of the direction ahead, px of the plane; pixel centres are integers.
    rotation : (3, 3) array
        From the panorama's axes to the reference camera's.
    K : (3, 3) array
        Of the reference, px.
    """

    kind: str
    focal: float
    centre: tuple[float, float]
    rotation: Array
    K: Array

    @property
    def sphere(self) -> tuple[int, int, int, int] | None:
        """left, top, width, height (px of the plane) of the whole sphere; None for a cylinder."""
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
        """φ in radians, positive downwards, of lines v, px of the plane; not limited to ±90°."""
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
    """The projection that has as many px per radian as the middle of the reference.

    Parameters
    ----------
    kind : {"cylindrical", "equirectangular"}
    K : (3, 3) array
        Of the reference, px.
    rotation : (3, 3) array
        From the panorama's axes to the reference camera's.

    Returns
    -------
    Projection
        An equirectangular one is scaled a little, so that the sphere has a whole number of pixels.
    """
    focal = float(np.sqrt(K[0, 0] * K[1, 1]))
    if kind == "cylindrical":
        return Projection(kind, focal, (0.0, 0.0), rotation, K)
    # the sphere is 2 h × h px with an even h; its middle lies between pixels
    height = 2 * max(1, round(np.pi * focal / 2))
    return Projection(kind, height / np.pi, (-0.5, -0.5), rotation, K)


def extent(projection: Projection, outline: Array, shows: Callable[[Array], bool]) -> Array:
    """The rectangle that what a closed outline encloses takes up.

    An outline that crosses ±180°, or goes around a pole and therefore crosses it too, takes the whole width.

    Parameters
    ----------
    projection : Projection
    outline : (N, 3) array
        Rays in order, in the reference camera's frame; neighbours less than half a circle apart.
    shows : callable
        Whether a ray (3,) lies inside.

    Returns
    -------
    (4,) array
        left, top, right, bottom, px of the plane.
    """
    points = projection.points(np.vstack([outline, outline[:1]]))
    left, top, right, bottom = projection.limits
    low, high = points.min(axis=0), points.max(axis=0)
    poles = [shows(sign * projection.rotation[:, 1]) for sign in (-1.0, 1.0)]
    if np.abs(np.diff(points[:, 0])).max() > (right - left) / 2:
        low[0], high[0] = left, right
    return np.array([low[0], top if poles[0] else low[1], high[0], bottom if poles[1] else high[1]])
