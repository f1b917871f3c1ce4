"""OpenCV's Stitcher: one place for all pictures, seams around what does not fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...measure.placed.options import PLACED
from ...measure.placed.placed import PlacedPicture, PlacedSet, union
from ...pictures.picture import Picture
from ...raster.arrays import Array
from ...raster.picture_map import PictureMap, falls_inside
from ...raster.sampling import fetch
from ...system.errors import StitchError

# What its codes mean.
CODES = {
    cv2.Stitcher_ERR_NEED_MORE_IMGS: "too few pictures connect", cv2.Stitcher_ERR_HOMOGRAPHY_EST_FAIL: "no homography",
    cv2.Stitcher_ERR_CAMERA_PARAMS_ADJUST_FAIL: "its bundle adjustment failed",
}  # fmt: skip


class StitcherFailed(StitchError):
    """OpenCV's Stitcher made no panorama."""


@dataclass(frozen=True, eq=False)
class Registered:
    """What it finds: stitcher, whose `composePanorama` goes on; used (M): numbers of the pictures it uses; focals (M)
    px; rotations (M, 3, 3) from each one's axes to the panorama's."""

    stitcher: Any
    used: list[int]
    focals: Array
    rotations: Array

    def intrinsics(self, k: int, size: tuple[int, int]) -> NDArray[np.float32]:
        """K (3, 3) of its k-th picture of (W, H) px."""
        return np.array([[self.focals[k], 0, size[0] / 2], [0, self.focals[k], size[1] / 2], [0, 0, 1]], np.float32)


def registered(pictures: Sequence[NDArray[np.uint8]]) -> Registered:
    """Its cameras of pictures (H, W, 3), B, G, R, all options as they are. It finds the focal lengths by itself: it can
    be told none. Raises StitcherFailed."""
    cv2.setRNGSeed(0)
    stitcher = cv2.Stitcher_create(cv2.Stitcher_PANORAMA)
    try:
        checked(stitcher.estimateTransform(list(pictures)))
    except cv2.error as error:
        raise StitcherFailed(f"OpenCV's Stitcher: {error.err}") from error
    cameras = stitcher.cameras()
    focals = np.array([camera.focal for camera in cameras]) / stitcher.workScale()
    rotations = np.array([np.asarray(camera.R, np.float64) for camera in cameras])
    return Registered(stitcher, [int(number) for number in stitcher.component()], focals, rotations)


def checked(code: int) -> None:
    """Raises StitcherFailed for a code that is not that of success."""
    if code != cv2.Stitcher_OK:
        raise StitcherFailed(f"OpenCV's Stitcher: {CODES.get(code, f'code {code}')}")


def stitcher_panorama(pictures: Sequence[Picture]) -> PlacedSet:
    """Where it places the pictures that it uses, on a sphere, as its own warper maps them. Raises StitcherFailed."""
    views = [np.repeat(one.view, 3, axis=2) if one.view.shape[2] == 1 else one.view for one in pictures]
    found = registered([np.ascontiguousarray(view[..., ::-1]) for view in views])
    warper = cv2.PyRotationWarper("spherical", PLACED.px_per_radian)
    placed = []
    for k, number in enumerate(found.used):
        size = views[number].shape[1], views[number].shape[0]
        K, R = found.intrinsics(k, size), found.rotations[k].astype(np.float32)
        (left, top, _, _), x, y = warper.buildMaps(size, K, R)
        shows = falls_inside(x, y, size)
        colours = fetch(views[number], np.where(shows, x, -1), np.where(shows, y, -1), cv2.INTER_LINEAR)
        one = PlacedPicture.cut_out(pictures[number].name, colours, shows, PictureMap(x, y, size), (left, top))
        placed.append(one)
    left, top = np.min([one.corner for one in placed], axis=0).tolist()
    right, bottom = np.max(
        [(one.corner[0] + one.shows.shape[1], one.corner[1] + one.shows.shape[0]) for one in placed], axis=0
    ).tolist()
    size = right - left, bottom - top
    shifted = [
        PlacedPicture(one.name, one.colours, one.shows, (one.corner[0] - left, one.corner[1] - top), one.map)
        for one in placed
    ]  # fmt: skip

    def rays_at(at: Array) -> Array:
        """Unit rays in its axes: x right, y down, z ahead."""
        along, rise = (at[..., 0] + left) / PLACED.px_per_radian, np.pi - (at[..., 1] + top) / PLACED.px_per_radian
        level = np.sin(rise)
        return np.stack([level * np.sin(along), np.cos(rise), level * np.cos(along)], axis=-1)

    return PlacedSet(size, tuple(shifted), rays_at, union(size, shifted), PLACED.px_per_radian)
