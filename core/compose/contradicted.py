"""What depth says a picture cannot see, though the picture itself shows that it can.

Who walks through two pictures has a depth there, too near or too far, and is then said to hide what another picture
shows. But what a picture cannot see begins with an edge in it: there it shows a copy of what hides the place. Where it
goes on smoothly instead, and what the others show would not, it is believed.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import Plane
from ..raster.lazy import whole
from ..raster.log_encoding import log_encode
from ..system.threads import ask
from .options import CONTRADICTED
from .unseen import Unseen
from .window import Window

# Each side's pixels beside a border, and those beyond it.
ACROSS = (
    (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:, 1:], np.s_[:, :-1]),
    (np.s_[:-1], np.s_[1:]), (np.s_[1:], np.s_[:-1]),
)  # fmt: skip


def without_contradicted(
    unseen: Sequence[Unseen], layers: Sequence[Layer], windows: Sequence[Window | None]
) -> list[Unseen]:
    """What pictures cannot see, without the places at which they go on smoothly and what others show there would not.

    Parameters
    ----------
    unseen : sequence of Unseen
        Of each of more than two pictures.
    layers : sequence of Layer
        With their exposures matched.
    windows : sequence of Window or None
        Where they show anything.

    Returns
    -------
    list of Unseen
    """
    if not any(one.hidden.any() for one in unseen):
        return list(unseen)
    total = np.zeros(layers[0].alpha.shape, np.float32)
    count = np.zeros(total.shape, np.int16)
    for one, layer, window in zip(unseen, layers, windows, strict=True):
        if window is not None:
            sees, tones = _tones_of(one, layer, window)
            window.put(window.plane(total) + np.where(sees, tones, np.float32(0)), total)
            window.put(window.plane(count) + sees, count)
    found = []
    for one, layer, window in zip(unseen, layers, windows, strict=True):
        if window is None or not one.hidden.any():
            found.append(one)
            continue
        sees, tones = _tones_of(one, layer, window)
        hidden, others = window.plane(one.hidden), window.plane(count)
        with np.errstate(invalid="ignore"):
            elsewhere = np.where(others > 0, window.plane(total) / others, np.float32(np.nan))
        kept = window.spread(hidden & ~_contradicted(hidden, sees, tones, elsewhere))
        found.append(Unseen(kept, one.by_depth & kept, one.folds))
    return found


def _tones_of(unseen: Unseen, layer: Layer, window: Window) -> tuple[NDArray[np.bool_], Plane]:
    """What (h, w) a picture shows and can see in its window, and its tones (h, w)."""
    ask()
    here = window.layer(layer)
    tones: Plane = log_encode(whole(here.light)).mean(axis=2)
    return (here.alpha > 0) & ~window.plane(unseen.hidden), tones


def _contradicted(
    hidden: NDArray[np.bool_], sees: NDArray[np.bool_], tones: Plane, elsewhere: Plane
) -> NDArray[np.bool_]:
    """Which of what is hidden (h, w) a picture goes on through smoothly, though the others do not.

    sees (h, w): what the picture can see; tones, elsewhere (h, w): its own, and the mean of what the others see.
    """
    parts, labels = cv2.connectedComponents(hidden.astype(np.uint8), connectivity=8)
    borders, own, other = np.zeros(parts), np.zeros(parts), np.zeros(parts)
    for inside, outside in ACROSS:
        beside = hidden[inside] & sees[outside] & np.isfinite(elsewhere[inside])
        which = labels[inside][beside]
        borders += np.bincount(which, minlength=parts)
        for steps, values in ((own, tones), (other, elsewhere)):
            smooth = np.abs(values[inside][beside] - tones[outside][beside]) < CONTRADICTED.smooth_tone
            steps += np.bincount(which[smooth], minlength=parts)
    wrong = (borders >= CONTRADICTED.least_px) & (own >= CONTRADICTED.least_smooth * borders)
    wrong &= other <= CONTRADICTED.most_smooth_elsewhere * borders
    wrong[0] = False
    found: NDArray[np.bool_] = wrong[labels]
    return found
