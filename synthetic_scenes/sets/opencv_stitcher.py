"""OpenCV's Stitcher as a rival on sets: one place for all, seams around what does not fit."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...core.compare.elsewhere.opencv_stitcher import StitcherFailed, checked, registered
from ...core.raster.arrays import Array
from ...core.raster.colour import decode
from .rendered_set import RenderedSet
from .rival_panorama import RivalPanorama


def stitcher_panorama(rendered: RenderedSet, numbers: Sequence[int]) -> RivalPanorama:
    """Its panorama of a set, all options as they are. It finds the focal lengths by itself: it can be told none.

    numbers: of the pictures that must be in it, and by which it is turned. Raises StitcherFailed.
    """
    pictures = [cv2.imread(str(path), cv2.IMREAD_COLOR) for path in rendered.pictures]
    found = registered(pictures)
    try:
        code, made = found.stitcher.composePanorama()
    except cv2.error as error:
        raise StitcherFailed(f"OpenCV's Stitcher: {error.err}") from error
    checked(code)
    used, R = found.used, found.rotations
    missing = len(set(numbers) - set(used))
    if missing:
        raise StitcherFailed(f"OpenCV's Stitcher leaves out {missing} of {len(numbers)} pictures")
    # what it warps with: the median of its focal lengths for all
    scale = float(np.float32(np.median(found.focals)))
    warper = cv2.PyRotationWarper("spherical", scale)
    corners = []
    for k, number in enumerate(used):
        size = pictures[number].shape[1::-1]
        corners.append(warper.warpRoi(size, found.intrinsics(k, size), R[k].astype(np.float32))[:2])
    left, top = np.min(corners, axis=0)

    def pixels(directions: Array) -> tuple[Array, Array]:
        """Where it shows directions (…, 3) in its own axes: x right, y down, z ahead."""
        along, down = np.arctan2(directions[..., 0], directions[..., 2]), directions[..., 1]
        rise = np.arccos(np.clip(down / np.linalg.norm(directions, axis=-1), -1, 1))
        return scale * along - left, scale * (np.pi - rise) - top

    # it tells no mask: what it does not show is black
    shown = made.any(axis=-1).astype(np.float32)
    rotations = {number: R[k].T for k, number in enumerate(used) if number in numbers}
    return RivalPanorama(decode(np.ascontiguousarray(made[..., ::-1])), shown, pixels, rotations)
