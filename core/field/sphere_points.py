"""Which of a rig's points the field on the sphere stands on, and how well their pictures tell their ranges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.projective import ahead_of_camera
from ..cameras.rig import Rig
from ..cameras.view import View
from ..raster.arrays import Array
from .sphere_options import SPHERE
from .transfer import slope_of


@dataclass(frozen=True, eq=False)
class SpherePoints:
    """Points (N) of a rig.

    rays (N, 3): unit; inverse_ranges, deviations (N,): and their standard deviations, in any unit; sensitivity (N,): px
    per unit of inverse range, over all pictures that see a point; error_px (N,): how far it is off in the worst one.
    """

    rays: Array
    inverse_ranges: Array
    deviations: Array
    sensitivity: Array
    error_px: Array

    def __len__(self) -> int:
        return len(self.rays)

    def subset(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> SpherePoints:
        """The points that a mask or index array selects."""
        return SpherePoints(
            self.rays[keep], self.inverse_ranges[keep], self.deviations[keep], self.sensitivity[keep],
            self.error_px[keep],
        )  # fmt: skip

    @property
    def noise(self) -> Array:
        """Noise (N,) of the inverse ranges, relative to the median point's, bounded."""
        return np.clip(self.deviations / np.median(self.deviations), *SPHERE.noise_range)


def points_of(rig: Rig) -> SpherePoints:
    """The points of a rig whose range at least two pictures tell, to within their noise."""
    count = len(rig.rays)
    squared, error, seen = np.zeros(count), np.zeros(count), np.zeros(count, int)
    observations = rig.observations
    for number, view in enumerate(rig.views):
        here = observations.used & (observations.picture == number)
        point = observations.point[here]
        rays, inverse_ranges = rig.rays[point], rig.inverse_ranges[point]
        slope = slope_of(_homogeneous_pixels(view, rays, inverse_ranges), view.K @ view.t)
        np.add.at(squared, point, np.square(slope).sum(axis=1))
        off = np.linalg.norm(seen_at(view, rays, inverse_ranges) - observations.pixels[here], axis=1)
        np.maximum.at(error, point, np.nan_to_num(off, nan=np.inf))
        np.add.at(seen, point, 1)
    sensitivity = np.sqrt(squared)
    usable = (seen >= 2) & (error < SPHERE.max_error_px * px_scale(rig)) & (sensitivity > 0)
    if usable.any():
        usable &= sensitivity > SPHERE.min_relative_sensitivity * np.median(sensitivity[usable])
    # those of the bundle know that a point's direction is not known either; else from the sensitivity alone
    known = bool((rig.deviations[usable] > 0).all())
    deviations = rig.deviations if known else 1 / np.maximum(sensitivity, 1e-300)
    return SpherePoints(rig.rays, rig.inverse_ranges, deviations, sensitivity, error).subset(usable)


def seen_at(view: View, rays: Array, inverse_ranges: Array) -> Array:
    """Raw px (N, 2) of a picture where it sees unit rays (N, 3) at inverse ranges (N,), NaN behind its camera."""
    a, b, c = _homogeneous_pixels(view, rays, inverse_ranges).T
    c = np.where(ahead_of_camera(a, b, c), c, np.nan)
    return distort(np.stack([a / c, b / c], axis=-1), view.camera)


def px_scale(rig: Rig) -> float:
    """px of the largest picture for each of a picture of usual size."""
    return max(1.0, max(max(camera.size) for camera in rig.cameras) / SPHERE.usual_side)


def angular_unit(rig: Rig) -> float:
    """√(W·H) / f of the middle picture, in radians."""
    return float(np.median([np.sqrt(np.prod(view.size)) / view.K[0, 0] for view in rig.views]))


def _homogeneous_pixels(view: View, rays: Array, inverse_ranges: Array) -> Array:
    """K (R r + ρ t) (N, 3) for unit rays (N, 3) and inverse ranges ρ (N,)."""
    pixels: Array = (rays @ view.R.T + inverse_ranges[:, None] * view.t) @ view.K.T
    return pixels
