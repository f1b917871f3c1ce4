"""The cameras of a set from above: where they truly stand and look, and where a stitch has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import Array

if TYPE_CHECKING:
    from .set_measures import Found

SIDE, MARGIN = 720, 90  # px
LOOK = 55  # px of the line that says where a camera looks
TRUE_COLOUR, FOUND_COLOUR, INK = (60, 150, 80), (220, 40, 150), (40, 40, 40)


def top_view(found: Found) -> NDArray[np.uint8]:
    """A drawing: true cameras green and thick, found ones pink and thin, brought onto them by the similarity that fits
    best; as wide as they spread, the viewpoint named 00."""
    true = np.array([camera.place for camera in found.cameras])
    placed, _ = found.places
    ahead = np.array([camera.R[2] for camera in found.cameras])
    found_ahead = (found.rig.R @ found.gauge)[:, 2]
    both = np.concatenate([true, placed])[:, :2]
    middle = (both.max(axis=0) + both.min(axis=0)) / 2
    scale = (SIDE - 2 * MARGIN) / max(float(np.ptp(both, axis=0).max()), 0.05)
    out = np.full((SIDE, SIDE, 3), 255, np.uint8)

    def at(place: Array) -> tuple[int, int]:
        x, y = (place[:2] - middle) * scale
        return round(SIDE / 2 + x), round(SIDE / 2 - y)

    for places, directions, colour, thick in ((true, ahead, TRUE_COLOUR, 4), (placed, found_ahead, FOUND_COLOUR, 1)):
        for place, way in zip(places, directions, strict=True):
            x, y = at(place)
            cv2.circle(out, (x, y), 4 + thick, colour, -1 if thick == 1 else 2, cv2.LINE_AA)
            cv2.line(out, (x, y), (round(x + LOOK * way[0]), round(y - LOOK * way[1])), colour, thick, cv2.LINE_AA)
    for number, place in zip(found.numbers, true, strict=True):
        x, y = at(place)
        cv2.putText(out, f"{number:02d}", (x + 9, y - 9), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    step = 10.0 ** np.floor(np.log10((SIDE / 3) / scale))
    cv2.line(out, (20, SIDE - 20), (20 + round(step * scale), SIDE - 20), INK, 2)
    cv2.putText(out, f"{step:g} m", (24, SIDE - 28), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    return out
