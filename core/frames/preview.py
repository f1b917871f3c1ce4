"""How much smaller pictures are worked on for a panorama that is only looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..cameras.camera import Camera
from ..cameras.projective import homogeneous, inverse_intrinsics
from ..options import LEAST_SCALE
from ..raster.arrays import Array
from .options import PREVIEW


def first_share(cameras: Sequence[Camera], rotations: Sequence[Array], wanted: float | None = None) -> float:
    """By which share of their sides pictures are to be worked on, as far as that can be told before the panorama is
    framed: by how many px it has that all pictures lie in, each at infinity.

    Parameters
    ----------
    cameras : sequence of Camera
        The reference's first.
    rotations : sequence of (3, 3) arrays
        From the reference's frame to each camera's; NaN where one is not known.
    wanted : float, optional
        px of the panorama; by itself as many as a preview has.
    """
    rays = np.concatenate([
        _border(camera) @ (R if np.isfinite(R).all() else np.eye(3))
        for camera, R in zip(cameras, rotations, strict=True)
    ])  # fmt: skip
    headings = np.sort(np.arctan2(rays[:, 0], rays[:, 2]))
    gap = max(float(np.diff(headings).max()), float(headings[0] + 2 * np.pi - headings[-1]))
    rise = np.arctan2(rays[:, 1], np.hypot(rays[:, 0], rays[:, 2]))
    return _share(1.0, (2 * np.pi - gap) * float(np.ptp(rise)) * cameras[0].focal ** 2, wanted)


def next_share(share: float, pixels: int) -> float:
    """By which share instead, where pictures at `share` made a panorama of so many px; the same if that will do."""
    too_small = pixels < PREVIEW.least_pixels and share < 1
    return _share(share, pixels) if too_small or pixels > PREVIEW.most_pixels else share


def _share(share: float, pixels: float, wanted: float | None = None) -> float:
    """What makes a panorama of these px one of as many as are wanted, or of a preview's."""
    return float(np.clip(share * np.sqrt((wanted or PREVIEW.pixels) / max(pixels, 1)), LEAST_SCALE, 1.0))


def _border(camera: Camera) -> Array:
    """Rays (N, 3) along a picture's border, in its own frame."""
    width, height = camera.size
    u = np.linspace(0, 1, PREVIEW.border_points)
    sides = [np.column_stack(side) for side in ((u, 0 * u), (u, 0 * u + 1), (0 * u, u), (0 * u + 1, u))]
    points = np.concatenate(sides) * [width - 1.0, height - 1.0]
    rays: Array = homogeneous(points) @ inverse_intrinsics(camera.K).T
    return rays
