"""A small copy of a panorama and of the pictures on it, as the verdict looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ..compose.seams.rough_seam import map_to_small, small_picture
from ..panorama.layers import layer_of
from ..raster.arrays import Box
from ..raster.colour import encode
from ..raster.picture_map import CanvasMap, PictureMap
from ..system.threads import ask
from .options import VERDICT

if TYPE_CHECKING:
    from ..compose.tone.exposure import Exposure
    from ..pictures.picture import Picture

Levels = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Look:
    """A small copy of a panorama: every `step`-th pixel of its canvas.

    Attributes
    ----------
    step : int
    maps : tuple of PictureMap
        To the small pictures.
    tones, taken : tuple of (h, w, C) uint8 arrays
        Each picture on the canvas, in levels of 255: as it is shown, and as it was taken.
    shows : tuple of (h, w) bool arrays
        Where each shows anything.
    hidden : (h, w) bool array
        What one of them shows though something nearer hides it there.
    labels : (h, w) int array or None
        Which picture each pixel comes from, −1 for none.
    """

    step: int
    maps: tuple[PictureMap, ...]
    tones: tuple[Levels, ...]
    taken: tuple[Levels, ...]
    shows: tuple[NDArray[np.bool_], ...]
    hidden: NDArray[np.bool_]
    labels: NDArray[np.int16] | None

    @property
    def side(self) -> int:
        """Its longer side, px."""
        return max(self.hidden.shape)

    def shown(self, number: int) -> NDArray[np.bool_]:
        """Where (h, w) a picture is what is shown; without a seam, where it shows anything."""
        return self.shows[number] if self.labels is None else self.labels == number

    def box(self, mask: NDArray[np.bool_], shift: tuple[int, int]) -> Box:
        """The box around a mask (h, w) in px of the panorama."""
        x, y, width, height = (self.step * int(v) for v in cv2.boundingRect(mask.astype(np.uint8)))
        return x + shift[0], y + shift[1], width, height


def look_at(
    pictures: Sequence[Picture], maps: Sequence[CanvasMap], exposures: Sequence[Exposure],
    hidden: Sequence[NDArray[np.bool_]], labels: NDArray[np.int16] | None,
) -> Look:  # fmt: skip
    """A small copy of a panorama.

    Parameters
    ----------
    pictures : sequence of Picture
    maps : sequence of CanvasMap
        Of the panorama's canvas, as it is cropped.
    exposures : sequence of Exposure
        What was done to the pictures' light.
    hidden : sequence of (H, W) bool arrays
        What each picture cannot see.
    labels : (H, W) int array, optional

    Returns
    -------
    Look
    """
    height, width = hidden[0].shape
    step = -(-max(height, width) // VERDICT.side_px)
    nodes = np.s_[step // 2 :: step, step // 2 :: step]
    found = [_small(*each, nodes) for each in zip(pictures, maps, exposures, strict=True)]
    small_maps, tones, taken, shows = zip(*found, strict=True)
    unseen = np.logical_or.reduce([one[nodes] for one in hidden])
    return Look(step, small_maps, tones, taken, shows, unseen, None if labels is None else labels[nodes])


def _small(
    picture: Picture, picture_map: CanvasMap, exposure: Exposure, nodes: tuple[slice, slice]
) -> tuple[PictureMap, Levels, Levels, NDArray[np.bool_]]:
    """One picture of a small copy: its map, tones as shown and as taken, and where it shows anything."""
    ask()
    full = picture_map.arrays()
    coarse = PictureMap(full.x[nodes], full.y[nodes], full.size)
    with np.errstate(invalid="ignore"):
        apart = np.hypot(np.diff(coarse.x, axis=1), np.diff(coarse.y, axis=1))[coarse.inside()[:, 1:]]
    small = small_picture(picture, 1 / max(1.0, float(np.nanmedian(apart))) if apart.size else 1.0)
    own = map_to_small(coarse, small)
    layer = layer_of(small, own)
    tones, taken = (encode(one.pixels, 8) for one in (exposure.applied(layer, own), layer))
    return own, tones, taken, layer.alpha > VERDICT.least_alpha
