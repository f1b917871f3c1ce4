"""The truth of a set proves itself: the sphere and every camera, each figure by a road of its own."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.measure.metrics import psnr
from ...core.raster.arrays import Array, dilated, eroded
from ...core.raster.colour import encode
from ...core.raster.sampling import fetch
from ..ground_truth import SAME_DEPTH, visible
from ..passes import Passes
from ..proof import flat_there, gentle, prove_camera, worst_of
from ..scene_camera import SceneCamera
from .sphere_camera import SphereCamera
from .sphere_truth import seen_by

# A ray that gets this far towards a point meets its own surface.
ALL_THE_WAY = 1 - SAME_DEPTH


class SphereProof:
    """Takes the cameras of a set one after the other.

    rays (N, 3 + cameras): [x, y, distance, share of the way that is free from each camera, …] as Blender cast them
    through the sphere's pixels. distance (H, W): how far what the sphere shows is away, inf where there is nothing.
    """

    def __init__(self, sphere: SphereCamera, passes: Passes, rays: NDArray) -> None:
        self.sphere, self.passes, self.rays = sphere, passes, rays
        away = passes.position.astype(np.float64) - sphere.place
        length = np.linalg.norm(away, axis=-1)
        self.directions = sphere.all_directions()
        self.distance: NDArray[np.float32] = np.where(np.isfinite(passes.depth), length, np.inf).astype(np.float32)
        self._smooth = gentle(self.distance)
        self._away = away / np.maximum(length, 1e-12)[..., None]
        self._cameras: list[dict[str, float]] = []
        self._wrong, self._asked = 0, 0
        self._right: list[float] = []
        self._off: list[float] = []

    def add(self, passes: Passes, camera: SceneCamera, rays: NDArray) -> None:
        """Proves the next camera; rays: [x, y, depth] that were cast through its pixels."""
        number = len(self._cameras)
        self._cameras.append(prove_camera(passes, camera, rays))
        pixels, shown, smooth = self._seen(camera, passes.depth)
        x, y = self.rays[:, 0].astype(int), self.rays[:, 1].astype(int)
        asked = smooth[y, x]
        free = self.rays[:, 3 + number] >= ALL_THE_WAY
        self._asked += int(asked.sum())
        self._wrong += int((shown[y, x] != free)[asked].sum())
        self._compare(passes.light, pixels, shown & smooth)

    def add_bent(self, light: NDArray[np.float32], depth: NDArray[np.float32], camera: SceneCamera) -> None:
        """Proves the picture that a lens with distortion makes of the last camera's."""
        pixels, shown, smooth = self._seen(camera, depth)
        self._compare(light, pixels, shown & smooth)

    def figures(self) -> dict[str, float]:
        """How far the truth is from the renders it is made of.

        position_px, depth_relative, ray_cast_relative: of the cameras, as in `proof.prove`; direction_deg: the sphere's
        Position pass as seen from the viewpoint, from where its pixels look (worst); distance_relative: rays cast in
        Blender against it (worst); visibility_wrong: share of what Blender's rays from the cameras hit or do not hit
        that their depths say otherwise, edges left out; visibility_asked: of how many; sphere_psnr_db: a picture
        fetched by its true map against the sphere, on smooth surfaces that it sees (worst); half_pixel_loss_db: by how
        much that is better than the same half a pixel off (worst).
        """
        smooth = self._smooth
        cross = np.linalg.norm(np.cross(self._away[smooth], self.directions[smooth]), axis=-1)
        cosine = (self._away[smooth] * self.directions[smooth]).sum(axis=-1)
        x, y = self.rays[:, 0].astype(int), self.rays[:, 1].astype(int)
        some = smooth[y, x]
        ranges = np.abs(self.rays[some, 2] / self.distance[y, x][some] - 1)
        return {
            **worst_of(self._cameras), "direction_deg": float(np.degrees(np.arctan2(cross, cosine)).max()),
            "distance_relative": float(ranges.max(initial=0.0)),
            "visibility_wrong": self._wrong / max(self._asked, 1), "visibility_asked": float(self._asked),
            "sphere_psnr_db": min(self._right, default=0.0),
            "half_pixel_loss_db": min((a - b for a, b in zip(self._right, self._off, strict=True)), default=0.0),
        }  # fmt: skip

    def _seen(
        self, camera: SceneCamera, depths: NDArray[np.float32]
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Where (H, W, 2) a camera sees what the sphere shows, what of it it sees, and what is smooth in both."""
        pixels, there = seen_by(camera, self.sphere, self.directions, self.distance)
        return pixels, visible(pixels, there, depths), self._smooth & flat_there(pixels, depths)

    def _compare(self, light: NDArray[np.float32], pixels: Array, where: NDArray[np.bool_]) -> None:
        where = eroded(where, 1)  # what is averaged lies in the picture
        if not where.any():
            return
        true = encode(self.passes.light, 8)
        for shift, found in ((0.0, self._right), (0.5, self._off)):
            found.append(psnr(true, encode(resampled(light, pixels + shift, where), 8), where))


def resampled(light: NDArray[np.float32], pixels: Array, where: NDArray[np.bool_]) -> NDArray[np.float32]:
    """A picture (H, W, C) at pixels (h, w, 2), averaged over the area that each of these covers; only `where` they lie
    close together."""
    steps = [np.gradient(pixels, axis=axis) / 4 for axis in (0, 1)]
    total: NDArray[np.float32] = np.zeros((*where.shape, light.shape[2]), np.float32)
    near = dilated(where, 1)
    for a in (-1, 1):
        for b in (-1, 1):
            at = np.where(near[..., None], pixels + a * steps[0] + b * steps[1], -1)
            at = np.nan_to_num(at, nan=-1).astype(np.float32)
            total += fetch(light, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    return total / 4
