"""Lines that a user says are upright or level, and which way is down by them (docs/method.md, 6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..cameras.lens import undistort
from ..cameras.projective import homogeneous, inverse_intrinsics
from ..cameras.view import View
from ..pictures.picture import Picture
from ..raster.arrays import Array
from .options import LEVELLING


def constraints(pictures: Sequence[Picture], views: Sequence[View]) -> Array:
    """What down is perpendicular to, by the guides of pictures.

    An upright line lies in a plane with the camera, and so does down: it is perpendicular to that plane's normal. The
    ends of a level line lie equally high, u · r = u · r', so down is perpendicular to r − r'.

    Parameters
    ----------
    pictures : sequence of Picture
    views : sequence of View
        What is known of them, the reference's first.

    Returns
    -------
    (N, 3) array
        Unit vectors in the reference's frame; none for a picture whose orientation is not known.
    """
    rows = []
    for picture, view in zip(pictures, views, strict=True):
        if not picture.guides or not np.isfinite(view.R).all():
            continue
        size = np.array(view.size, np.float64)
        for kind, ends in picture.guides:
            points = undistort(np.reshape(ends, (2, 2)) * size - 0.5, view.camera)
            rays = homogeneous(points) @ inverse_intrinsics(view.K).T @ view.R
            first, other = rays / np.linalg.norm(rays, axis=1, keepdims=True)
            row = np.cross(first, other) if kind == "vertical" else first - other
            rows.append(row / max(float(np.linalg.norm(row)), 1e-12))
    return np.reshape(rows, (-1, 3))


def guided(down: Array, rows: Array) -> Array:
    """The unit vector (3,) down that is perpendicular to rows (N, 3), see `constraints`, and where these leave it open
    as `down` (3,) has it."""
    held = LEVELLING.guided_share
    found = np.linalg.solve(rows.T @ rows + held * np.eye(3), held * down)
    length = float(np.linalg.norm(found))
    unit: Array = found / length
    return unit


def guide_warnings(down: Array, rows: Array, otherwise: Array) -> tuple[str, ...]:
    """What is said where lines, see `constraints`, do not agree on one `down` (3,), or hardly with what is down
    otherwise (3,)."""
    off = np.degrees(np.arcsin(np.minimum(np.abs(rows @ down), 1.0))).max()
    turned = np.degrees(np.arccos(np.clip(down @ otherwise, -1, 1)))
    kind = "see whether one of them is of the other kind"
    if off > LEVELLING.contradicting_deg:
        return (f"the lines that are upright or level contradict each other by {off:.0f}°: {kind}",)
    if turned > LEVELLING.overturned_deg:
        return (f"the lines that are upright or level turn the panorama by {turned:.0f}°: {kind}",)
    return ()
