"""Lenses that are no pinhole with Brown's distortion: fisheyes, and the radial polynomial of Hugin and lensfun.

A lens is told by how far from the picture's principal point it shows a ray at the angle θ from its axis, in focal
lengths: first by its projection, then by the polynomial. All of them are radially symmetric. Frames: OpenCV's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np

from ..raster.arrays import Array
from .options import LENS


class LensProjection(StrEnum):
    """How far from the principal point a ray at θ from the axis is shown, in focal lengths."""

    RECTILINEAR = "rectilinear"  # tan θ
    EQUIDISTANT = "equidistant"  # θ
    EQUISOLID = "equisolid"  # 2 sin(θ / 2)
    STEREOGRAPHIC = "stereographic"  # 2 tan(θ / 2)
    ORTHOGRAPHIC = "orthographic"  # sin θ


@dataclass(frozen=True)
class Lens:
    """A radially symmetric lens; as it stands here, one without distortion.

    Attributes
    ----------
    projection : LensProjection
    angular : (k1, k2, k3, k4)
        Of an equidistant lens: θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) in place of θ (Kannala and Brandt; OpenCV's
        fisheye).
    ptlens : (a, b, c)
        The projection's radius s is shown at s (a q³ + b q² + c q + 1 − a − b − c), q = s / radius.
    radius : float
        Where that polynomial is 1, in focal lengths: Hugin and lensfun take half the shorter side of the picture.

    References
    ----------
    J. Kannala, S. Brandt, A Generic Camera Model and Calibration Method, PAMI 28, 2006. H. Dersch, Panorama Tools.
    """

    projection: str = LensProjection.RECTILINEAR
    angular: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    ptlens: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius: float = 1.0

    @property
    def bends(self) -> bool:
        """Whether it shows anything else than a pinhole does."""
        return self.projection != LensProjection.RECTILINEAR or any(self.ptlens)

    @property
    def limit(self) -> float:
        """The angle from the axis in rad up to which it can be inverted: beyond it the lens folds, or shows nothing."""
        return _limit(self)

    def zoomed(self, factor: float) -> Lens:
        """The lens when the focal length is called so many times as long: its polynomial moves the same pixels."""
        return replace(self, radius=self.radius / factor)

    def project(self, rays: Array) -> Array:
        """Where rays are shown.

        Parameters
        ----------
        rays : (…, 3)
            Of any length, in the camera's axes.

        Returns
        -------
        (…, 2)
            From the principal point, in focal lengths; NaN beyond the limit.
        """
        across = np.hypot(rays[..., 0], rays[..., 1])
        angle = np.arctan2(across, rays[..., 2])
        radius = np.where(angle <= self.limit, self.shown_at(np.minimum(angle, self.limit)), np.nan)
        shown: Array = rays[..., :2] * (radius / np.maximum(across, 1e-300))[..., None]
        return shown

    def unproject(self, points: Array) -> Array:
        """The rays that are shown at points: the inverse of `project`.

        Parameters
        ----------
        points : (…, 2)
            From the principal point, in focal lengths.

        Returns
        -------
        (…, 3)
            Unit rays; NaN beyond what is shown at the limit.
        """
        radius = np.hypot(points[..., 0], points[..., 1])
        angle = self.angle_at(radius)
        across = points * (np.sin(angle) / np.maximum(radius, 1e-300))[..., None]
        return np.concatenate([across, np.cos(angle)[..., None]], axis=-1)

    def shown_at(self, angle: Array) -> Array:
        """Radii (…) in focal lengths at which rays at such angles (…) from the axis, rad, up to the limit are shown."""
        s = _projected(self, angle)[0]
        a, b, c = self.ptlens
        q = s / self.radius
        return s * (((a * q + b) * q + c) * q + 1 - a - b - c)

    def slope_at(self, angle: Array) -> Array:
        """The derivative (…) of `shown_at`, focal lengths per rad."""
        s, slope = _projected(self, angle)
        a, b, c = self.ptlens
        q = s / self.radius
        with np.errstate(over="ignore", invalid="ignore"):  # coefficients of no lens fold at once, however large
            return slope * (((4 * a * q + 3 * b) * q + 2 * c) * q + 1 - a - b - c)

    def angle_at(self, radius: Array) -> Array:
        """Angles (…) from the axis, rad, at which rays shown at such radii (…) stand: by Newton's method, kept between
        bounds that close in; NaN beyond the limit."""
        limit = self.limit
        beyond = ~(radius <= float(self.shown_at(np.array(limit))))
        wanted = np.where(beyond, 0.0, radius)
        low, high = np.zeros_like(wanted), np.full_like(wanted, limit)
        angle = np.minimum(wanted, limit)
        for _ in range(LENS.iterations):
            off = self.shown_at(angle) - wanted
            low, high = np.where(off < 0, angle, low), np.where(off > 0, angle, high)
            new = angle - off / np.maximum(self.slope_at(angle), 1e-9)
            new = np.where((new < low) | (new > high), (low + high) / 2, new)
            step, angle = np.abs(new - angle), new
            if step.max(initial=0.0) < LENS.angle_tolerance:
                break
        found: Array = np.where(beyond, np.nan, angle)
        return found


def _projected(lens: Lens, angle: Array) -> tuple[Array, Array]:
    """The projection's radius, and its derivative by the angle."""
    if lens.projection == LensProjection.EQUISOLID:
        return 2 * np.sin(angle / 2), np.cos(angle / 2)
    if lens.projection == LensProjection.STEREOGRAPHIC:
        return 2 * np.tan(angle / 2), 1 / np.cos(angle / 2) ** 2
    if lens.projection == LensProjection.ORTHOGRAPHIC:
        return np.sin(angle), np.cos(angle)
    if lens.projection == LensProjection.RECTILINEAR:
        return np.tan(angle), 1 / np.cos(angle) ** 2
    k1, k2, k3, k4 = lens.angular
    t = angle * angle
    bent = angle * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4))))
    slope = 1.0 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4)))
    return bent, slope


@lru_cache(maxsize=256)
@np.errstate(over="ignore", invalid="ignore")  # of coefficients of no lens
def _limit(lens: Lens) -> float:
    narrow = lens.projection in (LensProjection.RECTILINEAR, LensProjection.ORTHOGRAPHIC)
    whole = np.radians(LENS.widest_flat if narrow else LENS.widest_round)
    angles = np.linspace(0, whole, LENS.radius_samples)
    least = LENS.least_angular_slope
    folded = ~(lens.slope_at(angles) >= least)  # not a number counts as folded
    if not folded.any():
        return float(whole)
    first = int(np.argmax(folded))
    low, high = angles[max(first - 1, 0)], angles[first]
    for _ in range(LENS.iterations):
        middle = (low + high) / 2
        low, high = (middle, high) if lens.slope_at(middle) >= least else (low, middle)
    return float(low)
