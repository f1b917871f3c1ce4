"""What a seam would cut through, looked up in small pictures before the panorama's geometry is settled.

It tells one way of laying out the pictures from another: where they agree along some line through the overlap, a seam
is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...cameras.view import View
from ...field.visibility import by_agreement, occluded
from ...panorama.layers import Layer, layer_of
from ...panorama.warp import Warp
from ...pictures.picture import Picture, picture_from_array
from ...raster.arrays import dilated, without_specks
from ...raster.lazy import whole
from ...raster.log_encoding import log_encode
from ...raster.picture_map import PictureMap
from ...raster.resizing import resized_points
from .overlap import Overlap, overlap_of
from .seam import find_seam, known_labels
from .seam_costs import seam_costs
from .seam_options import ROUGH_SEAM
from .tears import contrast, tears


@dataclass(frozen=True)
class RoughSeam:
    """Cuts a seam through two small pictures; pictures: these, the reference's first; views: of the full ones; last:
    the warp that was looked at before, and how it looks."""

    pictures: tuple[Picture, ...]
    views: tuple[View, ...]
    last: list[tuple[Warp, Look]] = field(default_factory=list)

    @staticmethod
    def of(pictures: Sequence[Picture], views: Sequence[View], px_per_radian: float) -> RoughSeam:
        """With pictures that have so many px per radian in their middle."""
        scales = [px_per_radian / np.sqrt(view.K[0, 0] * view.K[1, 1]) for view in views]
        small = [small_picture(picture, float(scale)) for picture, scale in zip(pictures, scales, strict=True)]
        return RoughSeam(tuple(small), tuple(views))

    def __call__(self, warp: Warp) -> float:
        """px of the seam, on the canvas of a warp, at which the pictures differ by more than blending evens out, of
        tears within a picture that are seen, and around holes."""
        seen = self.look(warp)
        if seen.overlap is None:
            return 0.0
        # also where the overlap ends: what the border of one picture cuts off does not go on in the other
        others = (seen.shown[0] | seen.shown[1]) & ~seen.chosen
        seam = (dilated(seen.chosen, 1) & dilated(others, 1))[seen.overlap.box] & seen.overlap.both
        tones = [log_encode(np.ascontiguousarray(one.light[seen.overlap.box])).mean(axis=2) for one in seen.layers]
        busy = np.minimum(*(contrast(one) for one in tones))
        visible = ROUGH_SEAM.visible_tone + ROUGH_SEAM.hidden_by_contrast * busy
        apart = np.abs(seen.overlap.difference).mean(axis=2) > visible
        torn = 0
        for number, (picture, places) in enumerate(zip(self.pictures, seen.maps, strict=True)):
            own = log_encode(whole(picture.light)).mean(axis=2)
            torn += int(tears(own, places, seen.shown[number] & (seen.chosen == bool(number))).sum())
        return float((seam & apart).sum()) / 2 + torn + _around_holes(seen)  # a pixel on either side of the seam

    def look(self, warp: Warp) -> Look:
        """Both small pictures on the canvas of a warp, and the seam between them."""
        if not self.last or self.last[0][0] is not warp:
            self.last[:] = [(warp, self._looked(warp))]
        return self.last[0][1]

    def _looked(self, warp: Warp) -> Look:
        """See `look`."""
        maps = [map_to_small(one.arrays(), picture) for one, picture in zip(warp.maps, self.pictures, strict=True)]
        before, layer = (layer_of(picture, one) for picture, one in zip(self.pictures, maps, strict=True))
        hidden = occluded(maps[1], warp.nearness(self.views, 1))
        if warp.lazy_confidence is not None:
            hidden &= by_agreement(hidden, maps[1], warp.lazy_confidence, before.alpha > 0)
        if warp.refilled is not None:
            hidden &= ~warp.refilled
        overlap = overlap_of(before, layer, hidden)
        if overlap is None:
            return Look((before, layer), maps, hidden, None, layer.alpha > 0)
        # as if exposure were matched already
        overlap.difference[overlap.both] -= np.median(overlap.difference[overlap.both], axis=0)
        costs = seam_costs(overlap, maps[1], warp.lazy_confidence, hidden, behind=warp.behind, slide=warp.slide)
        chosen = find_seam(known_labels(before, layer), costs)
        return Look((before, layer), maps, hidden, overlap, chosen)


@dataclass(frozen=True, eq=False)
class Look:
    """Two small pictures on a canvas; hidden, chosen (H, W): what the second cannot see, and where it is shown."""

    layers: tuple[Layer, Layer]
    maps: list[PictureMap]
    hidden: NDArray[np.bool_]
    overlap: Overlap | None
    chosen: NDArray[np.bool_]

    @cached_property
    def shown(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Where (H, W) each shows something."""
        first, second = self.layers
        return first.alpha > 0, second.alpha > 0


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


def _around_holes(seen: Look) -> int:
    """px around what only the second picture could show, but cannot see either; specks are filled."""
    holes = without_specks(seen.hidden & seen.shown[1] & ~seen.shown[0])
    return int((dilated(holes, 1) & ~holes).sum())
