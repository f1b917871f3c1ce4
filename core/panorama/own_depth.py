"""How far what each picture shows lies from that picture's own camera, by a coarse map of both.

A map gives depth along rays from the reference's place. Here it is turned into depth along each picture's own rays, so
that what a picture shows can be followed to wherever a sliding viewpoint shows it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort
from ..cameras.projective import project
from ..cameras.view import View
from ..raster.arrays import Array
from ..raster.resizing import resized_points
from .options import OWN_DEPTH
from .projection import Projection
from .warp import Warp


@dataclass(frozen=True)
class Things:
    """Things that a picture shows: X = q / d in the reference's frame, for directions q (…, 3) and d (…)."""

    q: Array
    d: Array


@dataclass(frozen=True)
class OwnDepth:
    """Inverse range from a picture's own camera, 1 / baseline.

    Attributes
    ----------
    view : View
    place : (3,) array
        Of its camera, in the reference's frame.
    base : (H, W) float32 array
        Inverse range from the reference's place on a coarse panorama, at least 0.
    projection : Projection
        Of that panorama.
    offset : (int, int)
        Its canvas pixel of the projection's pixel (0, 0).
    nearest : (h, w) float32 array
        The picture, shrunk: inverse range of the nearest that falls on each pixel.
    """

    view: View
    place: Array
    base: NDArray[np.float32]
    projection: Projection
    offset: tuple[int, int]
    nearest: NDArray[np.float32]

    @staticmethod
    def of(base: Warp, view: View, number: int) -> OwnDepth:
        """Of picture `number`; base: of all pictures from the reference's place, coarse, on a cylinder or sphere."""
        canvas, projection = base.canvas, base.canvas.projection
        assert projection is not None
        place = -view.R.T @ view.t
        scale = projection.focal / np.sqrt(view.K[0, 0] * view.K[1, 1])
        width, height = (max(2, round(scale * side)) for side in view.size)
        d = np.maximum(np.nan_to_num(base.inverse_depth), 0)
        rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
        nearest = _nearest(base, number, d / np.linalg.norm(rays - d[..., None] * place, axis=-1), (width, height))
        return OwnDepth(view, place, d, projection, canvas.offset, nearest)

    def things(self, rays: Array) -> Things:
        """What the picture shows along unit rays (…, 3) from its place, in the reference's frame."""
        raw = distort(project(rays @ (self.view.K @ self.view.R).T), self.view.camera)
        places = resized_points(raw, self.view.size, self.nearest.shape[::-1])
        d = _looked_up(self.nearest, places)
        for _ in range(OWN_DEPTH.rounds):
            # below a pixel: what the panorama has there, where that is the same surface
            q = rays + d[..., None] * self.place
            length = np.linalg.norm(q, axis=-1, keepdims=True)
            seen = _looked_up(self.base, self.projection.points(q) + np.array(self.offset))
            finer = seen / np.linalg.norm(q / length - seen[..., None] * self.place, axis=-1)
            same = np.abs(finer - d) < OWN_DEPTH.same_share * d + OWN_DEPTH.same_parallax
            d = np.where(same, finer, d)
        return Things(rays + d[..., None] * self.place, d)

    def smoothed(self, sigma: float) -> OwnDepth:
        """Without noise, and without what is thin: blurred by σ, in longer sides of the picture."""
        blurred = [
            cv2.GaussianBlur(cv2.medianBlur(one, 5), (0, 0), sigma * max(self.nearest.shape))
            for one in (self.base, self.nearest)
        ]
        return replace(self, base=blurred[0], nearest=blurred[1])


def _nearest(base: Warp, number: int, d: Array, size: tuple[int, int]) -> NDArray[np.float32]:
    """The nearest (h, w) of canvas points at inverse ranges d (H, W) that falls on each pixel of a picture shrunk to a
    size (w, h); where there is none, the farthest beside it goes on."""
    picture_map = base.maps[number].arrays()
    seen = picture_map.inside()
    values = d[seen]
    order = np.argsort(values, kind="stable")
    x, y = (
        np.clip(np.rint(resized_points(one[seen][order], old, new)).astype(int), 0, new - 1)
        for one, old, new in zip((picture_map.x, picture_map.y), picture_map.size, size, strict=True)
    )
    out = np.full(size[::-1], np.inf, np.float32)
    out[y, x] = values[order]
    for _ in range(max(size)):
        if np.isfinite(out).all():
            break
        beside = cv2.erode(out, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
        out = np.where(np.isfinite(out), out, beside)
    return np.where(np.isfinite(out), out, np.float32(0))


def _looked_up(image: NDArray[np.float32], places: Array) -> Array:
    """Values (…) of an image (h, w) at pixels (…, 2), beyond its border those of the border."""
    if not places.size:
        return np.zeros(places.shape[:-1])
    x, y = (np.ascontiguousarray(places[..., k], np.float32) for k in (0, 1))
    values: Array = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
    return values
