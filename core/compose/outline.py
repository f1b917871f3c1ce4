"""The frame that other choices would give a panorama, without a picture: by the outlines of its pictures alone."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..choices import Crop
from ..panorama.framing import Coverage, FrameRequest, coarse_sphere, frame_of
from ..panorama.framing_options import FRAMING
from ..panorama.projection import Projection
from ..raster.arrays import Array
from ..system.errors import BadRequest
from .crop import crop_box


def frame_outline(
    asked: FrameRequest, crop: Crop, views: Sequence[View], outlines: Sequence[Array]
) -> tuple[Projection, Array] | None:
    """The border of the frame that is asked for, after cropping.

    Parameters
    ----------
    asked : FrameRequest
    crop : Crop
        A box in px counts from what is shown, at the size that the frame would have.
    views : sequence of View
        What is known of the pictures, the reference's first.
    outlines : sequence of (N, 3) arrays
        Rays in order around each picture, in the reference's frame, as the panorama shows them.

    Returns
    -------
    (Projection, (4,) array) or None
        The frame, and left, top, right, bottom in px of its plane; None where they cannot be told: a picture reaches
        around the back, or the frame lies beside both, or the crop is none.
    """
    shown = _shown(coarse_sphere(views), views, outlines)
    if shown is None:
        return None
    try:
        frame = frame_of(asked, views, None, None, shown)
    except BadRequest:
        return None
    limits, points = frame.limits, frame.points(shown.rays)
    low, high = np.maximum(points.min(axis=0), limits[:2]), np.minimum(points.max(axis=0), limits[2:])
    if frame.window is not None:
        low, high = limits[:2], limits[2:]
    step = max(high - low) / FRAMING.side_px
    if not step > 0:
        return None
    grid = np.stack(np.meshgrid(*(np.arange(low[axis], high[axis], step) for axis in (0, 1))), axis=-1)
    if frame.sphere is not None and crop in ("full", "auto"):
        return frame, limits
    own = frame.points(outlines[0])
    first, last = (np.clip((end - low) / step, 0, None) for end in (own.min(axis=0), own.max(axis=0)))
    reference = (*first.astype(int), *np.ceil(last - first).astype(int))
    if not isinstance(crop, str):
        crop = tuple(int(round(part / step)) for part in crop)  # type: ignore[assignment]
    height, width = grid.shape[:2]
    try:
        shows = shown.at(frame.rays(grid))
        left, top, across, down = crop_box(crop, (0, 0, width, height), shows, reference, len(views))
    except BadRequest:
        return None
    corner = low + np.array([left, top]) * step
    return frame, np.concatenate([corner, np.minimum(corner + np.array([across, down]) * step, high)])


def border_of(frame: Projection, box: Array, count: int = 48) -> Array:
    """Rays (4·count + 1, 3) around a box (left, top, right, bottom) px of a frame's plane, closed."""
    left, top, right, bottom = box
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]])
    at = np.linspace(0, 4, 4 * count + 1)
    points = np.stack([np.interp(at, np.arange(5), corners[:, axis]) for axis in (0, 1)], axis=-1)
    return frame.rays(points)


def _shown(sphere: Projection, views: Sequence[View], outlines: Sequence[Array]) -> Coverage | None:
    """What lies inside the outlines, on a coarse sphere; None where one goes around the back of it."""
    left, top, width, height = sphere.sphere or (0, 0, 0, 0)
    mask: NDArray[np.uint8] = np.zeros((height, width), np.uint8)
    for outline in outlines:
        points = sphere.points(outline) - [left, top]
        if np.abs(np.diff(points[:, 0], append=points[0, 0])).max() > width / 2:
            return None
        cv2.fillPoly(mask, [np.rint(points).astype(np.int32)], 1)
    inside = mask > 0
    rows, columns = np.nonzero(inside)
    plane = np.stack([columns + left, rows + top], axis=-1).astype(np.float64)
    rays = sphere.rays(plane)
    solid_angle = np.cos((plane[:, 1] - sphere.centre[1]) / sphere.focal) / sphere.focal**2
    # as sharp as the middle of the reference
    sharpness = np.full(len(rays), float(views[0].K[0, 0] * views[0].K[1, 1]))
    return Coverage(sphere, (-left, -top), inside, rays, solid_angle, sharpness) if len(rays) else None
