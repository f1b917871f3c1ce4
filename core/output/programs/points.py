"""Points in space that several pictures see, from a stitch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...cameras.lens import distort
from ...cameras.projective import homogeneous, inverse_intrinsics, project
from ...field.transfer import inverse_depths
from ...raster.arrays import Array
from ...raster.resizing import resized_points
from ..camera_file import FoundCamera

if TYPE_CHECKING:
    from ...pipeline import StitchResult

# Points at infinity, and beyond it, lie so many baselines away: their parallax is below what any feature shows.
FARTHEST = 1e6


@dataclass(frozen=True, eq=False)
class Points:
    """X (P, 3): in the frame of the first picture, in the unit of the cameras; and where pictures see them: picture,
    point (O,), pixels (O, 2) of the full picture; error (O,): px to where the camera projects the point."""

    X: Array
    picture: NDArray[np.intp]
    point: NDArray[np.intp]
    pixels: Array
    error: Array


def points_of(result: StitchResult, found: list[FoundCamera]) -> Points:
    """The points that the cameras rest on; of a pair, its inliers.

    Parameters
    ----------
    result : StitchResult
    found : list of FoundCamera
        Of this result, with poses.
    """
    if result.rig is None:
        rays, d, picture, point, pixels = _of_pair(result)
    else:
        seen = result.rig.observations
        kept = np.flatnonzero(seen.used)
        rays, d = result.rig.rays, result.rig.inverse_ranges
        sizes = np.array([[camera.size for camera in result.rig.cameras], result.full_sizes])
        picture, point = seen.picture[kept], seen.point[kept]
        pixels = resized_points(seen.pixels[kept], sizes[0][picture], sizes[1][picture])
    X = rays / np.maximum(d, 1 / FARTHEST)[:, None] * result.scale.factor
    error = np.zeros(len(picture))
    for number, one in enumerate(found):
        here = picture == number
        q = (X[point[here]] @ one.R.T + one.t) @ one.camera.K.T if one.R is not None else np.zeros((0, 3))
        error[here] = np.linalg.norm(distort(project(q), one.camera) - pixels[here], axis=1)
    return Points(X, picture, point, pixels, error)


def _of_pair(result: StitchResult) -> tuple[Array, Array, NDArray[np.intp], NDArray[np.intp], Array]:
    """Rays with z = 1 and inverse depths of a pair's inliers, and where both pictures see them."""
    (edge,) = result.edges
    matches = result.matches_of(edge).subset(edge.two_view.inliers)
    reference, target = result.views
    ideal = edge.inliers
    rays = homogeneous(ideal.x) @ inverse_intrinsics(reference.K).T
    d = inverse_depths(target, ideal.x, ideal.y)[0] if target.e_prime.any() else np.ones(len(rays))
    picture, point = np.repeat((0, 1), len(rays)), np.tile(np.arange(len(rays)), 2)
    return rays, np.nan_to_num(d), picture, point, np.concatenate([matches.x, matches.y])
