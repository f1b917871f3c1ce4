"""Where a picture is torn within itself: its map jumps, and what comes after the jump does not go on there.

A map jumps at every edge of depth, from a near thing to what is behind it. Where the picture has an edge at that place
too, the jump is not seen; where the map leaves a thing too early or too late, the thing is torn.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane, larger_parts
from ...raster.picture_map import PictureMap
from ...raster.sampling import fetch
from .seam_options import TEARS


def tears(tones: Plane, seen: PictureMap, shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find the pixels (H, W) of a small panorama before which a picture is torn, from the left or from above.

    tones (h, w): of the picture; seen: where the panorama shows it; shown (H, W): where it is what is shown.
    """
    x, y = seen.arrays().x, seen.arrays().y
    out: NDArray[np.bool_] = np.zeros(x.shape, bool)
    busy = contrast(tones)
    down = _torn_downwards(tones, busy, x, y, shown)
    across = _torn_downwards(tones, busy, x.T, y.T, shown.T).T
    out[2:-1] |= down
    out[:, 2:-1] |= across
    return larger_parts(out, TEARS.least_px)


def contrast(tones: Plane) -> Plane:
    """Standard deviation (h, w) of a picture's tones (h, w) around each pixel."""
    side = (TEARS.contrast_px, TEARS.contrast_px)
    variance = np.maximum(cv2.blur(np.square(tones), side) - np.square(cv2.blur(tones, side)), 0)
    deviation: Plane = np.sqrt(variance)
    return deviation


def _torn_downwards(tones: Plane, busy: Plane, x: Plane, y: Plane, shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which rows (H − 3, W), from the third to the last but one, are torn from the row above."""
    places = np.stack([x, y])
    with np.errstate(invalid="ignore"):
        step = np.diff(places, axis=1)
        length = np.hypot(*step)
        jumps = (length[1:-1] > TEARS.jump_px) & shown[1:-2] & shown[2:-1]
        # how the map would go on without the jump, unless it jumps there as well
        usual = length < TEARS.jump_px
        goes_on = jumps & usual[:-2] & usual[2:]
        ahead = places[:, 1:-2] + step[:, :-2]
        back = places[:, 2:-1] - step[:, 2:]
    at = np.flatnonzero(goes_on)

    def at_jumps(values: Plane, where: Plane) -> Plane:
        across, down = (one.ravel()[at][None].astype(np.float32) for one in where)
        fetched: Plane = fetch(values[..., None], across, down, cv2.INTER_LINEAR)[0, :, 0]
        return fetched

    before, after = (at_jumps(tones, places[:, one]) for one in (np.s_[1:-2], np.s_[2:-1]))
    ends = ((before, after), (at_jumps(tones, ahead), after), (before, at_jumps(tones, back)))
    apart = np.minimum.reduce([np.abs(one - other) for one, other in ends])
    # foliage is torn unseen; beside the jump, since an edge there is no foliage
    aside = TEARS.aside_px
    busy = np.minimum(
        at_jumps(busy, places[:, 1:-2] - aside * step[:, :-2]), at_jumps(busy, places[:, 2:-1] + aside * step[:, 2:])
    )
    torn = np.zeros(jumps.shape, bool)
    torn.ravel()[at[apart > TEARS.visible_tone + TEARS.hidden_by_contrast * busy]] = True
    return torn
