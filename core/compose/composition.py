"""How layers become a panorama: one picture after the other is added to what is there, the reference first. For each:
what it cannot see, its exposure, the seam, and the blend across it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from ..raster.arrays import bounds, with_margin, without_specks
from ..raster.lazy import AnyImage, Weighed, whole
from ..raster.picture_map import PictureMap
from .blend import averaged, distance_labels, feathered, feathered_across, in_bands
from .exposure import Exposure, match_exposure, pooled, unchanged
from .inpaint import holes_of, inpainted
from .moving_things import times
from .options import EXPOSURE
from .overlap import Overlap, overlap_of
from .seam import added_price, find_seam, known_labels, seam_cost
from .wraparound import roll_for, rolled, rolled_layer, rolled_map

# Called with a stage's name and how much of it is done.
ReportProgress = Callable[[str, float], None]


@dataclass(frozen=True)
class Decided:
    """What was decided about one picture before a pixel was mixed; the frames of a clip share it.

    hidden (H, W): what the picture cannot see, or would show mirrored; surely (H, W): that of it which the depth order
    says by itself, which is what the seam goes by: more would leave it no way through leaves (`hidden` if that is not
    kept); exposure: the picture's; chosen (H, W): what comes from it and not from the pictures before, None without a
    seam; known, cost, price, box: what the seam was cut by (see `find_seam`), None if it was not or they are not kept;
    roll: by how many columns those four are rolled (see `wraparound`); holes: pixels that it cannot see and that no
    picture before shows: transparent or filled, but in an average; folds: `folding.folds` away from what is hidden
    behind something near.
    """

    hidden: NDArray[np.bool_]
    surely: NDArray[np.bool_]
    exposure: Exposure
    chosen: NDArray[np.bool_] | None = None
    known: NDArray[np.int8] | None = None
    cost: NDArray[np.float32] | None = None
    price: NDArray[np.float32] | None = None
    box: tuple[slice, slice] | None = None
    roll: int = 0
    holes: int = 0
    folds: float = 0.0


@dataclass(frozen=True)
class Composition:
    """The panorama; the pictures' layers as they were exposed for it; what was decided about each; labels (H, W): which
    picture a pixel comes from (0 the reference, −1 none), None without a seam."""

    panorama: Layer
    exposed: tuple[Layer, ...]
    decided: tuple[Decided, ...]
    labels: NDArray[np.int16] | None


def composed(
    layers: Sequence[Layer], warp: Warp, views: Sequence[View], options: StitchOptions, floats: Sequence[bool],
    painted: NDArray[np.int8] | None, progress: ReportProgress, decided: Sequence[Decided] | None = None,
    keep: bool = False,
) -> Composition:  # fmt: skip
    """The panorama of layers, of which the first is the reference's and keeps its light.

    What no picture shows is transparent, and so is what only a picture that cannot see it would show, unless it is to
    be inpainted. floats: which layers come from float pictures; painted (H, W): see `masks.read_painted`; decided: from
    other frames of the same cameras, kept to; keep: what the seams were cut by, for `pooled_decision`.
    """
    out, shape = layers[0], layers[0].alpha.shape
    nothing = np.broadcast_to(np.False_, shape)
    steps = [_Step(out, out, Decided(nothing, nothing, unchanged(out.light.shape[2])), np.zeros(0, bool))]
    for number, layer in enumerate(layers[1:], 1):
        added = _Added(
            layer, warp.maps[number].arrays(), warp.nearness(views, number), warp, options,
            (any(floats[:number]), floats[number]), _count(layers[:number]) if options.blend == "linear" else None,
        )  # fmt: skip

        def report(stage: str, share: float, before: int = number - 1) -> None:
            progress(stage, (before + share) / (len(layers) - 1))

        steps.append(_add(out, added, painted, report, decided[number] if decided else None, keep))
        out = steps[-1].panorama
    exposed, found = tuple(step.layer for step in steps), tuple(step.decided for step in steps)
    holes = [step.holes for step in steps if step.holes.size]
    if holes:
        out = inpainted(out, np.logical_or.reduce(holes) & (out.alpha == 0), warp.depth)
    return Composition(out, exposed, found, _labels(layers[0], found))


@dataclass(frozen=True)
class _Added:
    """A picture that is to be added: its layer, its map, how near it is to what (H, W) (see `Warp.nearness`); whether
    what was there before, and it, come from float pictures; of how many pictures (H, W) an average was made so far."""

    layer: Layer
    picture_map: PictureMap
    nearness: AnyImage
    warp: Warp
    options: StitchOptions
    floats: tuple[bool, bool]
    count: NDArray[Any] | None


@dataclass(frozen=True)
class _Step:
    """The panorama with a picture added, the picture's layer as it was exposed, what was decided, and its holes (H, W),
    empty where they are not to be filled."""

    panorama: Layer
    layer: Layer
    decided: Decided
    holes: NDArray[np.bool_]


def _add(
    before: Layer, added: _Added, painted: NDArray[np.int8] | None, progress: ReportProgress, decided: Decided | None,
    keep: bool,
) -> _Step:  # fmt: skip
    """The panorama of what was there before and one picture more."""
    options, layer = added.options, added.layer
    progress("occlusion", 0.0)
    hidden, surely, folded = (decided.hidden, decided.surely, decided.folds) if decided else _unseen(before, added)

    progress("exposure", 0.0)
    box = bounds((before.alpha > 0) & (layer.alpha > 0))
    # asked for twice unless decided, and let go before the cut: to fetch it again costs less than the room it takes
    held = layer if decided or box is None else layer.keep(with_margin(box, EXPOSURE.block_px, before.alpha.shape))
    if decided:
        exposure = decided.exposure
    elif options.exposure:
        exposure = match_exposure(before, held, hidden, added.floats)
    else:
        exposure = unchanged(layer.light.shape[2])
    held, layer = exposure.applied(held), exposure.applied(layer)

    progress("seam", 0.0)
    if added.count is not None:
        progress("blend", 0.0)
        found = Decided(hidden, surely, exposure, folds=folded)
        return _Step(averaged(before, held, added.count), held, found, np.zeros(0, bool))
    holes = holes_of(hidden, before, layer)
    seen, held = (_without(one, holes) if holes.any() else one for one in (layer, held))
    roll = decided.roll if decided else roll_for(added.warp.canvas, before, seen)
    before, seen, surely_there = rolled_layer(before, roll), rolled_layer(seen, roll), rolled(surely, roll)
    overlap = overlap_of(before, rolled_layer(held, roll), surely_there) if options.has_seam else None
    del held
    if decided:
        found = decided
    else:
        start = Decided(hidden, surely_there, exposure, roll=roll, holes=int(holes.sum()), folds=folded)
        found = _with_seam(start, before, seen, overlap, added, None if painted is None else rolled(painted, roll))
        chosen = None if found.chosen is None else rolled(found.chosen, -roll)
        found = replace(found, surely=surely, chosen=chosen)
        if not keep:
            found = replace(found, surely=hidden, known=None, cost=None, price=None, box=None)
        del start
    if options.holes != "inpaint":
        holes = np.zeros(0, bool)
    del surely, surely_there  # each as large as the canvas, and the bands need the room

    progress("blend", 0.0)
    if found.chosen is None:
        out = feathered(before, seen, rolled(hidden, roll))
    else:
        # the frames of a clip need not show the same everywhere
        side = (rolled(found.chosen, roll) & (seen.alpha > 0)) | (before.alpha == 0)
        blended = in_bands if options.blend == "multiband" else feathered_across
        # handed over, not kept: the bands need the room
        handed, overlap = [overlap], None
        out = blended(before, seen, side, handed.pop())
    return _Step(rolled_layer(out, -roll), layer, found, holes)


def _unseen(before: Layer, added: _Added) -> tuple[NDArray[np.bool_], NDArray[np.bool_], float]:
    """What (H, W) a picture cannot see, what of it the depth order says by itself, and its share of folds."""
    surely = occluded(added.picture_map, added.nearness)
    hidden = by_agreement(surely, added.picture_map, added.warp.lazy_confidence, before.alpha > 0)
    surely &= hidden
    turns = turning(added.picture_map)
    folded = folds(turns, hidden)
    # what is mirrored comes from the pictures before, too, where they show anything
    mirrored = turned_over(turns) & (before.alpha > 0)
    return hidden | mirrored, surely | mirrored, folded


def _count(layers: Sequence[Layer]) -> NDArray[np.int16]:
    """How many layers show something (H, W)."""
    count = np.zeros(layers[0].alpha.shape, np.int16)
    for layer in layers:
        count += layer.alpha > 0
    return count


def _labels(reference: Layer, decided: Sequence[Decided]) -> NDArray[np.int16] | None:
    """Which picture (H, W) each pixel comes from, −1 where none shows it; None without a seam."""
    labels = np.where(reference.alpha > 0, np.int16(0), np.int16(-1))
    for number, one in enumerate(decided[1:], 1):
        if one.chosen is None:
            return None
        labels[one.chosen] = number
    return labels


def pooled_decision(decisions: Sequence[Sequence[Decided]]) -> tuple[Decided, ...]:
    """One decision about each picture for several frames of the same cameras: its exposure in their middle, the seam
    that is cheapest over all of them. decisions: of each frame, about each picture."""
    return tuple(_pooled(about_one) for about_one in zip(*decisions, strict=True))


def _pooled(decisions: Sequence[Decided]) -> Decided:
    first = decisions[0]
    exposure = pooled([decision.exposure for decision in decisions])
    if first.known is None or first.box is None:
        return replace(first, exposure=exposure)
    alike = [one for one in decisions if (one.box, one.roll) == (first.box, first.roll)]
    cost, price = (
        np.mean(np.stack([values for values in parts if values is not None]), axis=0)
        for parts in ([decision.cost for decision in alike], [decision.price for decision in alike])
    )
    chosen = rolled(find_seam(first.known, cost, price, first.box), -first.roll)
    return replace(first, exposure=exposure, cost=cost, price=price, chosen=chosen)


def _without(layer: Layer, holes: NDArray[np.bool_]) -> Layer:
    """A layer that shows nothing in holes (H, W), and has no colour there either: files keep it under the alpha."""
    alpha = np.where(holes, layer.alpha.dtype.type(0), layer.alpha)
    return Layer(Weighed(layer.light, alpha if alpha.dtype == bool else ~holes), alpha)


def _with_seam(
    so_far: Decided, before: Layer, layer: Layer, overlap: Overlap | None, added: _Added,
    painted: NDArray[np.int8] | None,
) -> Decided:
    """What was decided, with the seam; layers, overlap and what is painted are rolled, the picture's map is not."""
    options = added.options
    if not options.has_seam:
        return so_far
    cuts = options.seam != "none" and overlap is not None
    known = known_labels(before, layer, without_specks(so_far.surely) if cuts else so_far.surely, painted)
    if overlap is None:
        return replace(so_far, chosen=known == 1)
    if options.seam == "none":
        nearest = distance_labels(before, layer)
        return replace(so_far, chosen=np.where(known == 0, nearest, known == 1))
    picture_map, confidence = rolled_map(added.picture_map, so_far.roll), added.warp.lazy_confidence
    if confidence is not None and so_far.roll:
        confidence = rolled(whole(confidence), so_far.roll)
    when = times(overlap, picture_map, before, layer, so_far.surely)
    cost, price = seam_cost(overlap, picture_map, confidence), added_price(overlap, so_far.surely, when)
    chosen = find_seam(known, cost, price, overlap.box)
    return replace(so_far, chosen=chosen, known=known, cost=cost, price=price, box=overlap.box)
