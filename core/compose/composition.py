"""From layers to a panorama (docs/method.md, 8).

First what each picture cannot see and the exposure of all; then one picture after the other is added to the panorama so
far, the one that is placed best first: the seam to it, and the blend across it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..options import StitchOptions
from ..panorama.layers import Layer
from ..panorama.warp import Warp
from ..raster.arrays import bounds, dilated, with_margin
from ..raster.lazy import whole
from ..system.progress import ReportProgress
from .contradicted import without_contradicted
from .decided import Decided
from .growing import Panorama, SetPanorama
from .inpaint import fillable_holes, inpainted
from .options import EXPOSURE, INPAINT
from .placing import Placing, adding_order
from .tone.exposure import Exposure, exposures_for
from .tone.graph_exposure import graph_exposures
from .tone.raw_highlights import without_clipped
from .unseen import Unseen, unseen_by_each
from .window import goes_round, window_of
from .wraparound import middle_of_widest, rolled, rolled_layer


@dataclass(frozen=True)
class Composition:
    """A panorama and what it was made of.

    Attributes
    ----------
    panorama : Layer
    exposed : tuple of Layer
        The pictures' layers with their exposure matched.
    decided : tuple of Decided
        One for each picture, the reference first.
    labels : (H, W) int16 array or None
        Which picture each pixel comes from: 0 the reference, −1 none; None without a seam.
    filled : (H, W) bool array
        What no picture shows and was filled.
    """

    panorama: Layer
    exposed: tuple[Layer, ...]
    decided: tuple[Decided, ...]
    labels: NDArray[np.int16] | None
    filled: NDArray[np.bool_]


def composed(
    layers: Sequence[Layer], warp: Warp, views: Sequence[View], options: StitchOptions, floats: Sequence[bool],
    painted: NDArray[np.int8] | None, progress: ReportProgress, decided: Sequence[Decided] | None = None,
    keep: bool = False, wanted: NDArray[np.int16] | None = None,
) -> Composition:  # fmt: skip
    """Compose layers into a panorama.

    What no picture shows is transparent, and so is what only a picture that cannot see it would show of a pair, unless
    holes are to be inpainted.

    Parameters
    ----------
    layers : sequence of Layer
        All on the same canvas, the reference's first.
    warp : Warp
        Of the same canvas.
    views : sequence of View
        What is known of the pictures, in the same order.
    options : StitchOptions
        Its exposure, seam, blend and holes.
    floats : sequence of bool
        Which layers come from float pictures, which do not clip.
    painted : (H, W) int8 array or None
        What an artist decided between the reference and all others (see `known_labels`).
    progress : callable
        Called with a stage's name and the share of all stages of this name that is done.
    decided : sequence of Decided, optional
        Taken over instead of decided anew: from other frames of the same cameras.
    keep : bool
        Keep what the seams were cut by, for `pooled_decision`.
    wanted : (H, W) int16 array, optional
        Which picture is to be shown, if it shows anything there; −1 where the seams decide (see `wanted_on`).

    Returns
    -------
    Composition
    """
    windows = [] if len(layers) == 2 else [window_of(warp.canvas, layer.alpha > 0) for layer in layers]
    unseen = (
        [Unseen(one.hidden, one.hidden_by_depth, one.folds) for one in decided] if decided
        else unseen_by_each(layers, warp, views, windows, partial(progress, "occlusion"))
    )  # fmt: skip
    layers = without_clipped(layers, [one.hidden for one in unseen])
    fetched: list[Layer] = []
    exposures = (
        [one.exposure for one in decided] if decided
        else _exposures(layers, warp, views, unseen, floats, options, fetched, partial(progress, "exposure"))
    )  # fmt: skip
    if fetched and options.blend == "linear":
        layers = [layers[0], fetched[0]]
    fetched = [exposures[1].applied(one, warp.maps[1]) for one in fetched]
    exposed = [one.applied(layer, where) for one, layer, where in zip(exposures, layers, warp.maps, strict=True)]
    if len(layers) > 2 and not decided:
        unseen = without_contradicted(unseen, exposed, windows)
    found = list(decided) if decided else [
        Decided(here.hidden, here.by_depth, light, folds=here.folds)
        for here, light in zip(unseen, exposures, strict=True)
    ]  # fmt: skip
    if len(layers) == 2:
        order, panorama = [0, 1], Panorama(warp, exposed, options, wanted)
    else:
        placing = Placing(warp, views)
        order = adding_order(placing, layers, windows)
        panorama = SetPanorama(warp, exposed, options, placing, windows, wanted)
    if order:
        panorama.begin(order[0], found[order[0]])
    for step, number in enumerate(order[1:]):

        def report(stage: str, share: float, before: int = step) -> None:
            part = share if len(order) == 2 else (share + (stage == "blend")) / 2  # seam and blend take turns
            progress(stage, (before + part) / (len(order) - 1))

        found[number] = panorama.add(number, found[number], fetched, painted, (decided is not None, keep), report)
    out, labels = panorama.layer, panorama.labels(found)
    if options.holes == "auto":
        filled = fillable_holes(out, goes_round(warp.canvas))
    else:
        filled = panorama.open_holes()
    return Composition(_without_holes(out, filled, warp), tuple(exposed), tuple(found), labels, filled)


def _without_holes(panorama: Layer, holes: NDArray[np.bool_], warp: Warp) -> Layer:
    """A panorama with its holes (H, W) filled, also where they lie across ±180°."""
    columns = dilated(holes, INPAINT.reach_px).any(axis=0)
    roll = 0
    if goes_round(warp.canvas) and (columns[0] or columns[-1]) and not columns.all():
        roll = middle_of_widest(~columns)
    depth = rolled(whole(warp.depth), roll) if roll else warp.depth
    return rolled_layer(inpainted(rolled_layer(panorama, roll), rolled(holes, roll), depth), -roll)


def _exposures(
    layers: Sequence[Layer], warp: Warp, views: Sequence[View], unseen: Sequence[Unseen], floats: Sequence[bool],
    options: StitchOptions, fetched: list[Layer], progress: Callable[[float], None],
) -> Sequence[Exposure]:  # fmt: skip
    """What is done to the light of each picture; of a pair, `fetched` takes the second with its overlap kept."""
    if len(layers) != 2:
        hidden = [one.hidden for one in unseen]
        cameras = [view.camera for view in views]
        return graph_exposures(layers, warp.maps, cameras, hidden, floats, options.exposure, progress)
    progress(0.0)
    first, second = layers
    box = bounds((first.alpha > 0) & (second.alpha > 0))
    # Exposure and overlap both read it. It is dropped before the seam: fetching again costs less than its memory.
    fetched.append(
        second if box is None else second.keep(with_margin(box, EXPOSURE.block_px, first.alpha.shape))
    )
    hidden_by_any = unseen[1].hidden if warp.behind is None else unseen[1].hidden | warp.behind
    return exposures_for(
        (first, fetched[0]), (warp.maps[0], warp.maps[1]), hidden_by_any, (floats[0], floats[1]), options.exposure
    )
