"""Whether things that the world numbers are whole in a panorama, by the object pass of every picture."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import dilated
from ...core.raster.sampling import fetch
from .set_measures import Found

# px of the sphere that a thing must be seen on to be judged.
SMALLEST_PX = 100
# px of the sphere by which a thing may be shown beside its place and be the same: two degrees and a half.
REACH_PX = 11
# A thing is cut if it is farther than this share from being whole or gone.
CUT = 0.15


def thing_figures(found: Found) -> dict[str, float]:
    """things: how many things several or one of the pictures show; things_cut: how many of them are cut or shown once
    more elsewhere; things_half: how far that which is farthest is from being whole or gone (see `half`)."""
    things = found.truth.rendered.things
    if not things:
        return {}
    seen = found.truth.views_at(found.numbers) > 0
    true, shown = np.where(seen, things[-1], 0), np.where(seen, shown_things(found), 0)
    numbers, areas = np.unique(true[true > 0], return_counts=True)
    halves = np.array([half(shown == number, true == number) for number in numbers[areas >= SMALLEST_PX]])
    return {
        "things": float(len(halves)), "things_cut": float((halves > CUT).sum()),
        "things_half": float(halves.max(initial=0.0)),
    }  # fmt: skip


def shown_things(found: Found) -> NDArray[np.uint8]:
    """Numbers (H, W) of the things that the panorama shows at the sphere's pixels: by the picture that each comes from,
    and where it is fetched there."""
    at, labels = found.on_maps(), found.labels_on_sphere
    shown: NDArray[np.uint8] = np.zeros(labels.shape, np.uint8)
    for order, number in enumerate(found.numbers):
        own = labels == order
        x, y = found.result.warp.maps[order].arrays().between(at[own]).astype(np.float32).T[:, None]
        shown[own] = fetch(found.truth.rendered.things[number][..., None], x, y, cv2.INTER_NEAREST)[0, :, 0]
    return shown


def half(shown: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """How far a thing is from being whole or gone, of where (H, W) it is shown and where it truly is: the share of its
    area that is shown in or beside its place, or that is not, whichever is less; the surplus, if more is shown; or what
    is shown elsewhere, if that is more. Where in its place it is does not count: maps are judged for that."""
    area = int(true.sum())
    beside = dilated(true, REACH_PX)
    near, elsewhere = int((shown & beside).sum()) / area, int((shown & ~beside).sum()) / area
    return max(min(near, abs(1 - near)), elsewhere)
