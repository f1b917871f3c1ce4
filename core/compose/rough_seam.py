"""What a seam would cut through, looked up in small pictures before the panorama's geometry is settled.

It tells one way of laying out the pictures from another: where they agree along some line through the overlap, a seam
is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..cameras.view import View
from ..field.visibility import occluded
from ..panorama.layers import layer_of
from ..panorama.warp import Warp
from ..pictures.picture import Picture, picture_from_array
from ..raster.arrays import dilated
from ..raster.picture_map import PictureMap
from ..raster.resizing import resized_points
from .options import ROUGH_SEAM
from .overlap import overlap_of
from .seam import added_price, find_seam, known_labels, seam_cost


@dataclass(frozen=True)
class RoughSeam:
    """Cuts a seam through two small pictures; pictures: these, the reference's first; views: of the full ones."""

    pictures: tuple[Picture, ...]
    views: tuple[View, ...]

    @staticmethod
    def of(pictures: Sequence[Picture], views: Sequence[View], px_per_radian: float) -> RoughSeam:
        """With pictures that have so many px per radian in their middle."""
        scales = [px_per_radian / np.sqrt(view.K[0, 0] * view.K[1, 1]) for view in views]
        small = [small_picture(picture, float(scale)) for picture, scale in zip(pictures, scales, strict=True)]
        return RoughSeam(tuple(small), tuple(views))

    def __call__(self, warp: Warp) -> float:
        """px of the seam, on the canvas of a warp, at which the pictures differ by more than blending evens out."""
        maps = [map_to_small(one.arrays(), picture) for one, picture in zip(warp.maps, self.pictures, strict=True)]
        before, layer = (layer_of(picture, one) for picture, one in zip(self.pictures, maps, strict=True))
        hidden = occluded(maps[1], warp.nearness(self.views, 1))
        overlap = overlap_of(before, layer, hidden)
        if overlap is None:
            return 0.0
        difference = overlap.difference
        # as if exposure were matched already
        difference[overlap.both] -= np.median(difference[overlap.both], axis=0)
        cost, price = seam_cost(overlap, maps[1], None), added_price(overlap, hidden, behind=warp.behind)
        chosen = find_seam(known_labels(before, layer, hidden), cost, price, overlap.box)
        # also where the overlap ends: what the border of one picture cuts off does not go on in the other
        others = ((before.alpha > 0) | (layer.alpha > 0)) & ~chosen
        seam = (dilated(chosen, 1) & dilated(others, 1))[overlap.box] & overlap.both
        apart = np.abs(difference).mean(axis=2) > ROUGH_SEAM.visible_tone
        return float((seam & apart).sum()) / 2  # a pixel on either side of the seam


def small_picture(picture: Picture, scale: float) -> Picture:
    """A picture as it is looked at, shrunk where the scale is below 1: its light itself would take long to decode."""
    scale = min(1.0, scale)
    height, width = picture.view.shape[:2]
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small = picture_from_array(cv2.resize(picture.view, size, interpolation=cv2.INTER_AREA))
    if picture.alpha is None:
        return small
    return replace(small, alpha=cv2.resize(picture.alpha, size, interpolation=cv2.INTER_AREA))


def map_to_small(picture_map: PictureMap, small: Picture) -> PictureMap:
    """A map to a picture as one to its small copy."""
    height, width = small.view.shape[:2]
    x, y = (
        resized_points(values, old, new).astype(np.float32)
        for values, old, new in zip((picture_map.x, picture_map.y), picture_map.size, (width, height), strict=True)
    )
    return PictureMap(x, y, (width, height))
