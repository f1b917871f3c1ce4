"""OpenCV's Stitcher as a rival on sets: one place for all, seams around what does not fit."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ...core.raster.arrays import Array
from ...core.raster.colour import decode
from ...core.system.errors import StitchError
from .rendered_set import RenderedSet
from .rival_panorama import RivalPanorama

# What its codes mean.
CODES = {
    cv2.Stitcher_ERR_NEED_MORE_IMGS: "too few pictures connect", cv2.Stitcher_ERR_HOMOGRAPHY_EST_FAIL: "no homography",
    cv2.Stitcher_ERR_CAMERA_PARAMS_ADJUST_FAIL: "its bundle adjustment failed",
}  # fmt: skip


class StitcherFailed(StitchError):
    """OpenCV's Stitcher made no panorama of all pictures."""


def stitcher_panorama(rendered: RenderedSet, numbers: Sequence[int]) -> RivalPanorama:
    """Its panorama of a set, all options as they are. It finds the focal lengths by itself: it can be told none.

    numbers: of the pictures that must be in it, and by which it is turned. Raises StitcherFailed.
    """
    cv2.setRNGSeed(0)
    stitcher = cv2.Stitcher_create(cv2.Stitcher_PANORAMA)
    pictures = [cv2.imread(str(path), cv2.IMREAD_COLOR) for path in rendered.pictures]
    try:
        code = stitcher.estimateTransform(pictures)
        if code == cv2.Stitcher_OK:
            code, made = stitcher.composePanorama()
    except cv2.error as error:
        raise StitcherFailed(f"OpenCV's Stitcher: {error.err}") from error
    if code != cv2.Stitcher_OK:
        raise StitcherFailed(f"OpenCV's Stitcher: {CODES.get(code, f'code {code}')}")
    used = [int(number) for number in stitcher.component()]
    missing = len(set(numbers) - set(used))
    if missing:
        raise StitcherFailed(f"OpenCV's Stitcher leaves out {missing} of {len(numbers)} pictures")
    cameras = stitcher.cameras()
    # what it warps with: focal lengths in px of the pictures, and their median for all
    focals = np.array([camera.focal for camera in cameras]) / stitcher.workScale()
    scale = float(np.float32(np.median(focals)))
    # its rotations are from a picture's axes to the panorama's
    R = [np.asarray(camera.R, np.float64) for camera in cameras]
    warper = cv2.PyRotationWarper("spherical", scale)
    corners = []
    for k, number in enumerate(used):
        height, width = pictures[number].shape[:2]
        K = np.array([[focals[k], 0, width / 2], [0, focals[k], height / 2], [0, 0, 1]], np.float32)
        corners.append(warper.warpRoi((width, height), K, R[k].astype(np.float32))[:2])
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
