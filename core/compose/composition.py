"""From layers to a panorama: pictures are added one after the other to the reference (docs/method.md, 8).

For each: what it cannot see, its exposure, the seam to the panorama so far (`before`), and the blend across it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cameras.view import View
from ..field.folding import folds, turned_over, turning
from ..field.visibility import by_agreement, occluded
from ..options import StitchOptions
from ..panorama.layers import Layer
from ..panorama.warp import Warp
from ..raster.arrays import bounds, larger_parts, with_margin
from ..raster.lazy import AnyImage, Weighed, whole
from ..raster.picture_map import CanvasMap, PictureMap
from ..system.progress import ReportProgress
from .blend import averaged, distance_labels, feathered, feathered_across, in_bands
from .exposure import Exposure, exposures_for, pooled, unchanged
from .inpaint import closed_holes, holes_of, inpainted
from .min_cut import FREE, SECOND
from .moving_things import moving_labels
from .options import EXPOSURE
from .overlap import Overlap, overlap_of
from .seam import find_seam, known_labels
from .seam_costs import SeamCosts, averaged_costs, seam_costs
from .wraparound import roll_for, rolled, rolled_layer, rolled_map


@dataclass(frozen=True)
class Decided:
    """What was decided about one picture before pixels are mixed; the frames of a clip share it.

    Attributes
    ----------
    hidden : (H, W) bool array
        What the picture cannot see, or would show mirrored.
    hidden_by_depth : (H, W) bool array
        The part of it that the depth order alone tells, which the seam avoids: with all of it, foliage would leave the
        seam no way through. `hidden` itself if not kept.
    exposure : Exposure
    exposure_before : Exposure
        What is done to the panorama before, when this picture is added: to the reference, if anything.
    chosen : (H, W) bool array or None
        What comes from this picture and not from those before; None without a seam.
    known, costs : (H, W) int8 array and SeamCosts, or None
        What the seam was cut by (see `find_seam`), if it was and is kept.
    roll : int
        Columns by which these are rolled (see `wraparound`).
    holes : int
        Pixels that the picture cannot see and none before it shows. They are transparent or filled.
    folds : float
        Share of the picture's map that is folded, away from what is hidden (see `folding.folds`).
    """

    hidden: NDArray[np.bool_]
    hidden_by_depth: NDArray[np.bool_]
    exposure: Exposure
    exposure_before: Exposure
    chosen: NDArray[np.bool_] | None = None
    known: NDArray[np.int8] | None = None
    costs: SeamCosts | None = None
    roll: int = 0
    holes: int = 0
    folds: float = 0.0


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
    keep: bool = False,
) -> Composition:  # fmt: skip
    """Compose layers into a panorama.

    What no picture shows is transparent, and so is what only a picture that cannot see it would show, unless holes are
    to be inpainted.

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
        What an artist decided about the seam (see `known_labels`).
    progress : callable
        Called with a stage's name and the share of all stages of this name that is done.
    decided : sequence of Decided, optional
        Taken over instead of decided anew: from other frames of the same cameras.
    keep : bool
        Keep what the seams were cut by, for `pooled_decision`.

    Returns
    -------
    Composition
    """
    out, shape = layers[0], layers[0].alpha.shape
    behind = np.broadcast_to(np.False_, shape) if warp.behind is None else warp.behind & (out.alpha > 0)
    as_it_is = unchanged(out.light.shape[2])
    steps = [_Step(out, out, Decided(behind, behind, as_it_is, as_it_is), np.zeros(0, bool))]
    for number, layer in enumerate(layers[1:], 1):
        added = _Added(
            layer, warp.maps[number].arrays(), warp.maps[: number + 1], warp.nearness(views, number), warp, options,
            (any(floats[:number]), floats[number]), _count(layers[:number]) if options.blend == "linear" else None,
        )  # fmt: skip

        def report(stage: str, share: float, before: int = number - 1) -> None:
            progress(stage, (before + share) / (len(layers) - 1))

        steps.append(_add(out, added, painted, report, decided[number] if decided else None, keep))
        out = steps[-1].panorama
        if number == 1:
            light = steps[1].decided.exposure_before
            reference = light.applied(layers[0], warp.maps[0])
            steps[0] = replace(steps[0], layer=reference, decided=replace(steps[0].decided, exposure=light))
    exposed, found = tuple(step.layer for step in steps), tuple(step.decided for step in steps)
    filled = _filled(out, steps, options)
    labels = _labels((layers[0].alpha > 0) & (out.alpha > 0), found)
    return Composition(inpainted(out, filled, warp.depth), exposed, found, labels, filled)


def _filled(panorama: Layer, steps: Sequence[_Step], options: StitchOptions) -> NDArray[np.bool_]:
    """What (H, W) no picture shows and is to be filled."""
    if options.holes == "auto":
        return closed_holes(panorama.alpha > 0, small=True)[0]
    holes = [step.holes for step in steps if step.holes.size]
    nothing = np.broadcast_to(np.False_, panorama.alpha.shape)
    return np.logical_or.reduce(holes) & (panorama.alpha == 0) if holes else nothing


@dataclass(frozen=True)
class _Added:
    """A picture to be added.

    maps: of all pictures so far and this one; nearness (H, W): see `Warp.nearness`; floats: whether the panorama
    before, and this picture, come from floats;
    count (H, W): how many pictures the panorama before is the average of, None where none is made.
    """

    layer: Layer
    picture_map: PictureMap
    maps: tuple[CanvasMap, ...]
    nearness: AnyImage
    warp: Warp
    options: StitchOptions
    floats: tuple[bool, bool]
    count: NDArray[Any] | None


@dataclass(frozen=True)
class _Step:
    """The panorama with a picture added; its layer, exposed; what was decided; holes (H, W) to fill, empty if none are.
    """

    panorama: Layer
    layer: Layer
    decided: Decided
    holes: NDArray[np.bool_]


def _add(
    before: Layer, added: _Added, painted: NDArray[np.int8] | None, progress: ReportProgress, decided: Decided | None,
    keep: bool,
) -> _Step:  # fmt: skip
    """Add one picture to the panorama before."""
    options, layer, behind = added.options, added.layer, added.warp.behind
    progress("occlusion", 0.0)
    hidden, by_depth, folded = (
        (decided.hidden, decided.hidden_by_depth, decided.folds) if decided else _hidden(before, added)
    )

    progress("exposure", 0.0)
    box = bounds((before.alpha > 0) & (layer.alpha > 0))
    # Exposure and overlap both read it. It is dropped before the seam: fetching again costs less than its memory.
    fetched = layer if decided or box is None else layer.keep(with_margin(box, EXPOSURE.block_px, before.alpha.shape))
    exposure_before, exposure = (decided.exposure_before, decided.exposure) if decided else exposures_for(
        (before, fetched), added.maps, hidden if behind is None else hidden | behind, added.floats, options.exposure
    )  # fmt: skip
    before = exposure_before.applied(before, added.warp.maps[0])
    fetched, layer = (exposure.applied(one, added.picture_map) for one in (fetched, layer))

    progress("seam", 0.0)
    if added.count is not None:
        progress("blend", 0.0)
        found = Decided(hidden, by_depth, exposure, exposure_before, folds=folded)
        return _Step(averaged(before, fetched, added.count), fetched, found, np.zeros(0, bool))
    holes = holes_of(hidden, before, layer)
    if behind is not None:
        holes |= behind & (before.alpha > 0) & (hidden | (layer.alpha == 0))
        before = _without(before, holes)
    visible, fetched = (_without(one, holes) if holes.any() else one for one in (layer, fetched))
    roll = decided.roll if decided else roll_for(added.warp.canvas, before, visible)
    before, visible, rolled_hidden = rolled_layer(before, roll), rolled_layer(visible, roll), rolled(by_depth, roll)
    behind = None if behind is None else rolled(behind, roll)
    unseen = rolled_hidden if behind is None else rolled_hidden | behind
    overlap = overlap_of(before, rolled_layer(fetched, roll), unseen) if options.has_seam else None
    del fetched
    if decided:
        found = decided
    else:
        start = Decided(
            hidden, rolled_hidden, exposure, exposure_before, roll=roll, holes=int(holes.sum()), folds=folded
        )  # fmt: skip
        found = _with_seam(
            start, before, visible, overlap, added, behind, None if painted is None else rolled(painted, roll)
        )
        chosen = None if found.chosen is None else rolled(found.chosen, -roll)
        found = replace(found, hidden_by_depth=by_depth, chosen=chosen)
        if not keep:
            found = replace(found, hidden_by_depth=hidden, known=None, costs=None)
        del start
    if options.holes != "inpaint":
        holes = np.zeros(0, bool)
    del by_depth, rolled_hidden  # each as large as the canvas: the peak of memory is ahead

    progress("blend", 0.0)
    if found.chosen is None:
        out = feathered(before, visible, rolled(hidden, roll), behind)
    else:
        # a decision taken over from another frame may choose pixels that this one does not show
        side = (rolled(found.chosen, roll) & (visible.alpha > 0)) | (before.alpha == 0)
        blended = in_bands if options.blend == "multiband" else feathered_across
        # handed over without a reference of our own, so that blending can free it at its peak of memory
        handed, overlap = [overlap], None
        out = blended(before, visible, side, handed.pop())
    return _Step(rolled_layer(out, -roll), layer, found, holes)


def _hidden(before: Layer, added: _Added) -> tuple[NDArray[np.bool_], NDArray[np.bool_], float]:
    """What (H, W) a picture cannot see, the part of it that the depth order alone tells, and its share of folds."""
    by_depth = occluded(added.picture_map, added.nearness)
    shown = before.alpha > 0
    if added.warp.behind is not None:
        shown &= ~added.warp.behind
    hidden = by_agreement(by_depth, added.picture_map, added.warp.lazy_confidence, shown)
    by_depth &= hidden
    turns = turning(added.picture_map)
    folded = folds(turns, hidden)
    # the panorama before is right where the map mirrors the picture
    mirrored = turned_over(turns) & shown
    hidden |= mirrored
    by_depth |= mirrored
    if added.warp.refilled is not None:
        hidden, by_depth = hidden & ~added.warp.refilled, by_depth & ~added.warp.refilled
    return hidden, by_depth, folded


def _count(layers: Sequence[Layer]) -> NDArray[np.int16]:
    """How many layers show something (H, W)."""
    count = np.zeros(layers[0].alpha.shape, np.int16)
    for layer in layers:
        count += layer.alpha > 0
    return count


def _labels(reference: NDArray[np.bool_], decided: Sequence[Decided]) -> NDArray[np.int16] | None:
    """Which picture (H, W) each pixel comes from, −1 where none shows it; None without a seam.

    reference (H, W): what the reference shows of the panorama.
    """
    labels = np.where(reference, np.int16(0), np.int16(-1))
    for number, one in enumerate(decided[1:], 1):
        if one.chosen is None:
            return None
        labels[one.chosen] = number
    return labels


def pooled_decision(decisions: Sequence[Sequence[Decided]]) -> tuple[Decided, ...]:
    """One decision about each picture for several frames of the same cameras.

    Parameters
    ----------
    decisions : sequence of sequences of Decided
        Of each frame, about each picture, made with `keep`.

    Returns
    -------
    tuple of Decided
        The median of the exposures, and the seam that is cheapest on average over the frames.
    """
    return tuple(_pooled(about_one) for about_one in zip(*decisions, strict=True))


def _pooled(decisions: Sequence[Decided]) -> Decided:
    """The same about one picture, by the frames that overlap in the same box."""
    before, exposure = (
        pooled([getattr(one, name) for one in decisions]) for name in ("exposure_before", "exposure")
    )
    first = replace(decisions[0], exposure=exposure, exposure_before=before)
    if first.known is None or first.costs is None:
        return first
    alike = [
        one.costs for one in decisions
        if one.costs is not None and (one.costs.box, one.roll) == (first.costs.box, first.roll)
    ]  # fmt: skip
    costs = averaged_costs(alike)
    chosen = rolled(find_seam(first.known, costs), -first.roll)
    return replace(first, costs=costs, chosen=chosen)


def _without(layer: Layer, holes: NDArray[np.bool_]) -> Layer:
    """A layer that shows nothing in holes (H, W), black there: files keep colours below alpha 0."""
    alpha = np.where(holes, layer.alpha.dtype.type(0), layer.alpha)
    return Layer(Weighed(layer.light, alpha if alpha.dtype == bool else ~holes), alpha)


def _with_seam(
    so_far: Decided, before: Layer, layer: Layer, overlap: Overlap | None, added: _Added,
    behind: NDArray[np.bool_] | None, painted: NDArray[np.int8] | None,
) -> Decided:
    """What was decided, with the seam. All but the picture's map is rolled; behind (H, W): what the panorama before
    cannot see."""
    options = added.options
    if not options.has_seam:
        return so_far
    if options.seam == "none" or overlap is None:
        known = known_labels(before, layer, painted, so_far.hidden_by_depth)
        if behind is not None:
            known[larger_parts(behind) & (known == FREE)] = SECOND
        # without an overlap nothing is free
        nearest = distance_labels(before, layer) if overlap is not None else known == SECOND
        return replace(so_far, chosen=np.where(known == FREE, nearest, known == SECOND))
    known = known_labels(before, layer, painted)
    picture_map = rolled_map(added.picture_map, so_far.roll)
    confidence, slide = (
        rolled(whole(image), so_far.roll) if image is not None and so_far.roll else image
        for image in (added.warp.lazy_confidence, added.warp.slide)
    )
    unseen = so_far.hidden_by_depth if behind is None else so_far.hidden_by_depth | behind
    moving = moving_labels(overlap, picture_map, before, layer, unseen)
    costs = seam_costs(overlap, picture_map, confidence, so_far.hidden_by_depth, moving, behind, slide)
    return replace(so_far, chosen=find_seam(known, costs), known=known, costs=costs)
