"""What each picture cannot see, and what would come from another picture there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..field.folding import folds, turned_over, turning
from ..field.visibility import by_agreement, occluded
from ..panorama.layers import Layer
from ..raster.lazy import AnyImage
from .options import WINDOW
from .window import Window

if TYPE_CHECKING:
    from ..panorama.warp import Warp


@dataclass(frozen=True)
class Unseen:
    """What (H, W) a picture cannot see or would show mirrored, the part of it that the depth order alone tells, and the
    share of its map that is folded."""

    hidden: NDArray[np.bool_]
    by_depth: NDArray[np.bool_]
    folds: float = 0.0


def unseen_by_each(
    layers: Sequence[Layer], warp: Warp, views: Sequence[View], windows: Sequence[Window | None],
    progress: Callable[[float], None],
) -> list[Unseen]:
    """What each picture cannot see; windows: where they show anything, of more than two; progress is called with the
    share that is done.

    Of a pair, the reference cannot see what is `behind`, and all else is judged beside it. Of a larger set, the depth
    order counts only where dense refinement knows it: a smooth field through sparse points hides what is seen. What no
    picture sees comes from the one that shows it all the same.
    """
    nothing = np.broadcast_to(np.False_, layers[0].alpha.shape)
    if len(layers) == 2:
        progress(0.0)
        behind = nothing if warp.behind is None else warp.behind & (layers[0].alpha > 0)
        shown = layers[0].alpha > 0
        if warp.behind is not None:
            shown &= ~warp.behind
        window = Window.whole(warp.canvas)
        return [Unseen(behind, behind), _unseen(window, warp, 1, warp.nearness(views, 1), shown)]
    count = np.zeros(nothing.shape, np.int16)
    for layer, part in zip(layers, windows, strict=True):
        for there, _ in [] if part is None else part.parts:
            count[there] += layer.alpha[there] > 0
    found = []
    for number, (layer, tight) in enumerate(zip(layers, windows, strict=True)):
        progress(number / len(layers))
        if tight is None:
            found.append(Unseen(nothing, nothing))
            continue
        part = tight.with_margin(WINDOW.seam_margin_px)
        others: NDArray[np.bool_] = part.plane(count) > (part.plane(layer.alpha) > 0)
        nearness = None if warp.lazy_confidence is None else part.image(warp.nearness(views, number))
        one = _unseen(part, warp, number, nearness, others)
        hidden, by_depth = (
            part.spread(mask & others) if (mask & others).any() else nothing for mask in (one.hidden, one.by_depth)
        )
        found.append(Unseen(hidden, by_depth, one.folds))
    return _last_of_each_pixel_shown(found, layers, count)


def _unseen(
    window: Window, warp: Warp, number: int, nearness: AnyImage | None, shown: NDArray[np.bool_]
) -> Unseen:
    """What one picture cannot see in a window; nearness (h, w): see `Warp.nearness`, None if the depth order tells
    nothing; shown (h, w): what others show."""
    picture_map = window.map(warp.maps[number])
    hidden = by_depth = np.zeros(window.shape, bool)
    if nearness is not None:
        confidence = None if warp.lazy_confidence is None else window.image(warp.lazy_confidence)
        by_depth = occluded(picture_map, nearness)
        hidden = by_agreement(by_depth, picture_map, confidence, shown)
        by_depth &= hidden
    turns = turning(picture_map)
    folded = folds(turns, hidden)
    # the others are right where the map mirrors the picture
    mirrored = turned_over(turns) & shown
    hidden |= mirrored
    by_depth |= mirrored
    if warp.refilled is not None:
        refilled = window.plane(warp.refilled)
        hidden, by_depth = hidden & ~refilled, by_depth & ~refilled
    return Unseen(hidden, by_depth, folded)


def _last_of_each_pixel_shown(
    found: Sequence[Unseen], layers: Sequence[Layer], count: NDArray[np.int16]
) -> list[Unseen]:
    """The same without what is hidden from all pictures that show it; count (H, W): how many do."""
    if not any(one.hidden.any() for one in found):
        return list(found)
    seen = np.zeros(count.shape, bool)
    for one, layer in zip(found, layers, strict=True):
        seen |= (layer.alpha > 0) & ~one.hidden
    nobody = (count > 0) & ~seen
    if not nobody.any():
        return list(found)
    return [Unseen(one.hidden & ~nobody, one.by_depth & ~nobody, one.folds) for one in found]
