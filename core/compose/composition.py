"""How two layers become a panorama: what the target cannot see, its exposure, the seam, and the blend across it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..cameras.two_view import TwoView
from ..options import StitchOptions
from ..panorama.folding import folds, turned_over, turning
from ..panorama.layers import Layer
from ..panorama.visibility import by_agreement, occluded
from ..panorama.warp import Warp
from ..raster.arrays import bounds, with_margin, without_specks
from ..raster.lazy import Weighed
from .blend import averaged, distance_labels, feathered, feathered_across, in_bands
from .exposure import BLOCK, Exposure, match_exposure, pooled, unchanged
from .inpaint import holes_of, inpainted
from .moving_things import times
from .overlap import Overlap, overlap_of
from .seam import find_seam, known_labels, seam_cost, target_price
from .wraparound import roll_for, rolled, rolled_layer, rolled_maps

# Called with a stage's name and how much of it is done.
ReportProgress = Callable[[str, float], None]


@dataclass(frozen=True)
class Decided:
    """What was decided before a pixel was mixed; the frames of a clip share it.

    hidden (H, W): what the target cannot see, or would show mirrored; surely (H, W): that of it which the depth
    order says by itself, which is what the seam goes by: more would leave it no way through leaves (hidden if that
    is not kept); exposure: the target's; from_target (H, W): which side of the seam a pixel lies on, None without a
    seam; known, cost, price, box: what the seam was cut by (see `find_seam`), None if it was not or they are not
    kept; roll: by how many columns those four are rolled (see `wraparound`); holes: pixels that the target cannot see
    and the reference does not show: transparent or filled, but in an average; folds: `folding.folds` away from what
    is hidden behind something near.
    """

    hidden: NDArray[np.bool_]
    surely: NDArray[np.bool_]
    exposure: Exposure
    from_target: NDArray[np.bool_] | None = None
    known: NDArray[np.int8] | None = None
    cost: NDArray[np.float32] | None = None
    price: NDArray[np.float32] | None = None
    box: tuple[slice, slice] | None = None
    roll: int = 0
    holes: int = 0
    folds: float = 0.0


def composed(
    reference: Layer, target: Layer, warp: Warp, two_view: TwoView, target_size: tuple[int, int],
    options: StitchOptions, floats: tuple[bool, bool], painted: NDArray[np.int8] | None, steps: ReportProgress,
    decided: Decided | None = None, keep: bool = False, camera: Camera | None = None,
) -> tuple[Layer, Layer, Decided]:
    """The panorama, the target's layer as it was exposed for it, and what was decided.

    What neither picture shows is transparent, and so is what only a target that cannot see it would show, unless it is
    to be inpainted. floats: whether reference and target come from float pictures; painted (H, W): see
    `masks.read_painted`; decided: from other frames of the same two cameras, kept to; keep: what
    the seam was cut by, for `pooled_decision`; camera: the reference's, if its lens matters.
    """
    steps("occlusion", 0.0)
    if decided:
        hidden, surely, folded = decided.hidden, decided.surely, decided.folds
    else:
        surely = occluded(warp, two_view, target_size, camera)
        hidden = by_agreement(surely, warp, target_size, reference.alpha > 0)
        surely &= hidden
        turns = turning(warp, target_size)
        folded = folds(turns, hidden)
        # what is mirrored comes from the reference, too, where that shows anything
        mirrored = turned_over(turns) & (reference.alpha > 0)
        surely, hidden = surely | mirrored, hidden | mirrored
        del turns, mirrored

    steps("exposure", 0.0)
    box = bounds((reference.alpha > 0) & (target.alpha > 0))
    # asked for twice unless decided, and let go before the cut: to fetch it again costs less than the room it takes
    held = target if decided or box is None else target.keep(with_margin(box, BLOCK, reference.alpha.shape))
    if decided:
        exposure = decided.exposure
    elif options.exposure:
        exposure = match_exposure(reference, held, hidden, floats)
    else:
        exposure = unchanged(target.light.shape[2])
    held, target = exposure.applied(held), exposure.applied(target)

    steps("seam", 0.0)
    if options.blend == "linear":
        found = Decided(hidden, surely, exposure, folds=folded)
        steps("blend", 0.0)
        return averaged(reference, held), held, found
    holes = holes_of(hidden, reference, target)
    seen, held = (_without(layer, holes) if holes.any() else layer for layer in (target, held))
    roll = decided.roll if decided else roll_for(warp.canvas, reference, seen)
    reference, seen, surely_there = rolled_layer(reference, roll), rolled_layer(seen, roll), rolled(surely, roll)
    overlap = overlap_of(reference, rolled_layer(held, roll), surely_there) if options.has_seam else None
    del held
    if decided:
        found = decided
    else:
        start = Decided(hidden, surely_there, exposure, roll=roll, holes=int(holes.sum()), folds=folded)
        painted = None if painted is None else rolled(painted, roll)
        found = _with_seam(start, reference, seen, overlap, rolled_maps(warp, roll), options, painted)
        side = None if found.from_target is None else rolled(found.from_target, -roll)
        found = replace(found, surely=surely, from_target=side)
        if not keep:
            found = replace(found, surely=hidden, known=None, cost=None, price=None, box=None)
        del start
    if options.holes != "inpaint":
        holes = np.zeros(0, bool)
    del surely, surely_there  # each as large as the canvas, and the bands need the room

    steps("blend", 0.0)
    if found.from_target is None:
        out = feathered(reference, seen, rolled(hidden, roll))
    else:
        # the frames of a clip need not show the same everywhere
        side = (rolled(found.from_target, roll) & (seen.alpha > 0)) | (reference.alpha == 0)
        blended = in_bands if options.blend == "multiband" else feathered_across
        # handed over, not kept: the bands need the room
        handed, overlap = [overlap], None
        out = blended(reference, seen, side, handed.pop())
    out = rolled_layer(out, -roll)
    return inpainted(out, holes, warp.depth) if options.holes == "inpaint" else out, target, found


def pooled_decision(decisions: Sequence[Decided]) -> Decided:
    """One decision for several frames of two fixed cameras: the exposure in their middle, the seam that is cheapest
    over all of them."""
    first = decisions[0]
    exposure = pooled([decision.exposure for decision in decisions])
    if first.known is None or first.box is None:
        return replace(first, exposure=exposure)
    alike = [one for one in decisions if (one.box, one.roll) == (first.box, first.roll)]
    cost, price = (
        np.mean(np.stack([values for values in parts if values is not None]), axis=0)
        for parts in ([decision.cost for decision in alike], [decision.price for decision in alike])
    )
    from_target = rolled(find_seam(first.known, cost, price, first.box), -first.roll)
    return replace(first, exposure=exposure, cost=cost, price=price, from_target=from_target)


def _without(layer: Layer, holes: NDArray[np.bool_]) -> Layer:
    """A layer that shows nothing in holes (H, W), and has no colour there either: files keep it under the alpha."""
    alpha = np.where(holes, layer.alpha.dtype.type(0), layer.alpha)
    return Layer(Weighed(layer.light, alpha if alpha.dtype == bool else ~holes), alpha)


def _with_seam(
    so_far: Decided, reference: Layer, target: Layer, overlap: Overlap | None, warp: Warp,
    options: StitchOptions, painted: NDArray[np.int8] | None,
) -> Decided:
    if not options.has_seam:
        return so_far
    cuts = options.seam != "none" and overlap is not None
    known = known_labels(reference, target, without_specks(so_far.surely) if cuts else so_far.surely, painted)
    if overlap is None:
        return replace(so_far, from_target=known == 1)
    if options.seam == "none":
        nearest = distance_labels(reference, target)
        return replace(so_far, from_target=np.where(known == 0, nearest, known == 1))
    when = times(overlap, warp, reference, target, so_far.surely)
    cost, price = seam_cost(overlap, warp), target_price(overlap, so_far.surely, when)
    from_target = find_seam(known, cost, price, overlap.box)
    return replace(so_far, from_target=from_target, known=known, cost=cost, price=price, box=overlap.box)
