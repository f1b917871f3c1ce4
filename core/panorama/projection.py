"""Surfaces that a panorama is drawn on, and which ray each of their points shows (docs/method.md, 6).

A panorama has axes of its own: x to the right, y down, z ahead; levelled, y points along gravity. Its plane is in px, u
to the right and v down from the direction ahead, with x = u / f and y = v / f. Its point shows the ray

    r = (cos φ sin θ, sin φ, cos φ cos θ)

    equirectangular   θ = x, φ = y
    cylindrical       θ = x, tan φ = y
    pannini           S sin θ = x, S tan φ = y,  S = (D + 1) / (D + cos θ)
    perspective       the same with D = 0: a plane

Pannini's projection of distance D looks at a cylinder from D behind its middle: uprights and what runs towards the
middle of the picture stay straight. All kinds have f px per radian in their middle.

All equations for a canvas point p of the reference's plane (x' ~ H_inf p + d e', d = m·p on a plane) hold for the rays
of a panorama with p = K r, |r| = 1 in the reference camera's frame, and d = |baseline| / range along r.

References
----------
Sharpless, Postle and German, Pannini: A New Projection for Rendering Wide Angle Perspective Images, CAe 2010.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.projective import homogeneous, inverse_intrinsics
from ..raster.arrays import Array, angle_of
from .options import PROJECTION


@dataclass(frozen=True, eq=False)
class Projection:
    """How a panorama is unrolled into a plane.

    Attributes
    ----------
    kind : {"perspective", "pannini", "cylindrical", "equirectangular"}
    focal : float
        px per radian in the middle.
    centre : (float, float)
        (u, v) of the direction ahead, px of the plane; pixel centres are integers.
    rotation : (3, 3) array
        From the panorama's axes to the reference camera's.
    K : (3, 3) array
        Of the reference, px.
    distance : float
        Pannini's, 0 to 1; 0 for all other kinds.
    window : (left, top, right, bottom), optional
        px of the plane, the last two exclusive: the part that is shown; all of it by default.
    """

    kind: str
    focal: float
    centre: tuple[float, float]
    rotation: Array
    K: Array
    distance: float = 0.0
    window: tuple[float, float, float, float] | None = None

    @property
    def sphere(self) -> tuple[int, int, int, int] | None:
        """left, top, width, height (px of the plane) of the whole sphere; None for all other kinds."""
        half = round(np.pi * self.focal)
        return (-half, -half // 2, 2 * half, half) if self.kind == "equirectangular" else None

    @property
    def cuts(self) -> bool:
        """Whether it leaves out what lies beyond its limits: a sphere has all, and what a window leaves out was asked
        for."""
        return self.sphere is None and self.window is None

    @property
    def limits(self) -> Array:
        """left, top, right, bottom (exclusive) of what the plane may show, px."""
        if self.sphere is not None:
            left, top, width, height = self.sphere
            return np.array([left, top, left + width, top + height], np.float64)
        up = np.floor(PROJECTION.max_slope * self.focal)
        across = np.floor(np.pi * self.focal) if self.kind == "cylindrical" else up
        limits = np.array([-across, -up, across + 1, up + 1])
        if self.window is None:
            return limits
        window = np.array(self.window)
        inner: Array = np.concatenate([np.maximum(limits[:2], window[:2]), np.minimum(limits[2:], window[2:])])
        return inner

    def enlarged(self, times: int, K: Array) -> Projection:
        """The same with so many times as many px a side; K (3, 3): of the reference, enlarged."""
        u, v = (times * (middle + 0.5) - 0.5 for middle in self.centre)
        window = self.window
        if window is not None:
            left, top, right, bottom = (times * edge for edge in window)
            window = left, top, right, bottom
        return replace(self, focal=times * self.focal, centre=(u, v), K=K, window=window)

    def rays(self, points: Array) -> Array:
        """Unit rays (…, 3) in the reference camera's frame of points (…, 2) of the plane."""
        x, y = np.moveaxis((points - np.array(self.centre)) / self.focal, -1, 0)
        sine, cosine, level, rise = self._angles(x, y)
        rays: Array = np.stack([level * sine, rise, level * cosine], axis=-1) @ self.rotation.T
        return rays

    def points(self, rays: Array) -> Array:
        """Points (…, 2) of the plane that show rays (…, 3) of any length, −π < θ ≤ π: the inverse of `rays`.

        What a plane or Pannini's projection cannot show lies far beyond the limits, on the ray's side.
        """
        points: Array = np.stack(self.points_of(*np.moveaxis(rays @ self.rotation, -1, 0)), axis=-1)
        return points

    def points_of(self, x: NDArray[Any], y: NDArray[Any], z: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """The same (u, v) for rays in the panorama's own axes, of their precision."""
        level = np.hypot(x, z)
        if self.kind == "equirectangular":
            out = angle_of(x, z), angle_of(y, level)
        else:
            with np.errstate(divide="ignore", invalid="ignore"):
                rise = y / level
            if self.kind == "cylindrical":
                out = angle_of(x, z), rise
            else:
                with np.errstate(divide="ignore", invalid="ignore"):
                    sine, cosine = x / level, z / level
                stretch = (self.distance + 1) / np.maximum(self.distance + cosine, PROJECTION.least_forward)
                out = stretch * sine, stretch * rise
        kind = level.dtype.type
        u, v = (part * kind(self.focal) + kind(middle) for part, middle in zip(out, self.centre, strict=True))
        return u, v

    def of_reference(self, points: Array) -> Array:
        """Points (…, 2) of the plane that show ideal pixels (…, 2) of the reference."""
        return self.points(homogeneous(points) @ inverse_intrinsics(self.K).T)

    def project_rows(self, rows: Array, u: Array, v: Array) -> list[Array]:
        """rows (k, 3) times p = K r, each (len(v), len(u)), for columns u and lines v, px of the plane."""
        sine, cosine, level, rise = self._angles(
            (u - self.centre[0]) / self.focal, ((v - self.centre[1]) / self.focal)[:, None]
        )
        own = rows @ self.K @ self.rotation
        return [level * (a * sine + c * cosine) + b * rise for a, b, c in own]

    def area(self, rays: Array) -> Array:
        """px of the plane per steradian (…) around unit rays (…, 3); infinite where the projection shows nothing."""
        x, y, z = np.moveaxis(rays @ self.rotation, -1, 0)
        level = np.maximum(np.hypot(x, z), PROJECTION.least_forward)
        if self.kind == "equirectangular":
            density = 1 / level
        elif self.kind == "cylindrical":
            density = level**-3
        else:
            D, cosine = self.distance, z / level
            ahead = D + cosine
            # dx/dθ · S, over cos³ φ
            with np.errstate(divide="ignore", invalid="ignore"):
                density = (D + 1) ** 2 * (1 + D * cosine) / (ahead * level) ** 3
            density = np.where(ahead > PROJECTION.least_forward, density, np.inf)
        per_steradian: Array = self.focal**2 * density
        return per_steradian

    def _angles(self, x: Array, y: Array) -> tuple[Array, Array, Any, Any]:
        """sin θ and cos θ, as x is shaped, and cos φ and sin φ at x and y, which broadcast against each other."""
        stretch: Any = 1.0
        if self.kind in ("cylindrical", "equirectangular"):
            sine, cosine = np.sin(x), np.cos(x)
        else:
            D = self.distance
            t = np.square(x / (D + 1))
            cosine = (np.sqrt(1 + t * (1 - D * D)) - D * t) / (1 + t)
            stretch = (D + 1) / (D + cosine)
            sine = x / stretch
        if self.kind == "equirectangular":
            return sine, cosine, np.cos(y), np.sin(y)
        rise = y / stretch
        level = 1 / np.sqrt(1 + rise * rise)
        return sine, cosine, level, rise * level


def round_projection(kind: str, K: Array, rotation: Array, focal: float | None = None) -> Projection:
    """A cylinder or sphere.

    Parameters
    ----------
    kind : {"cylindrical", "equirectangular"}
    K : (3, 3) array
        Of the reference, px.
    rotation : (3, 3) array
        From the panorama's axes to the reference camera's.
    focal : float, optional
        px per radian; by default as many as the middle of the reference has.

    Returns
    -------
    Projection
        An equirectangular one is scaled a little, so that the sphere has a whole number of pixels.
    """
    focal = focal_of(K) if focal is None else focal
    if kind == "cylindrical":
        return Projection(kind, focal, (0.0, 0.0), rotation, K)
    # the sphere is 2 h × h px with an even h; its middle lies between pixels
    height = 2 * max(1, round(np.pi * focal / 2))
    return Projection(kind, height / np.pi, (-0.5, -0.5), rotation, K)


def focal_of(K: Array) -> float:
    """px per radian in the middle of a picture with intrinsics K (3, 3)."""
    return float(np.sqrt(K[0, 0] * K[1, 1]))


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
