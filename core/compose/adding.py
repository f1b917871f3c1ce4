"""One picture is added to the panorama so far (`before`): the seam to it, and the blend across it.

All planes lie in the window that the picture is added in.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..options import StitchOptions
from ..panorama.canvas import Canvas
from ..panorama.layers import Layer
from ..raster.arrays import Plane, larger_parts
from ..raster.lazy import AnyImage, Weighed, whole
from ..raster.picture_map import PictureMap
from ..system.progress import ReportProgress
from .blend import averaged, distance_labels, feathered, feathered_across, in_bands
from .decided import Decided
from .inpaint import holes_of
from .seams.min_cut import FREE, SECOND
from .seams.moving_things import moving_labels
from .seams.overlap import Overlap, overlap_of
from .seams.seam import find_seam, known_labels
from .seams.seam_costs import seam_costs
from .window import Window
from .wraparound import roll_for, rolled, rolled_layer, rolled_map


@dataclass(frozen=True)
class Added:
    """A picture to be added.

    Attributes
    ----------
    layer : Layer
        With its exposure matched.
    fetched : list of Layer
        The same with its light of the overlap kept, to be let go as soon as that was looked at; or none.
    picture_map : PictureMap
    window : Window
    canvas : Canvas
    hidden, hidden_by_depth : (h, w) bool arrays
        See `Decided`.
    behind : (h, w) bool array or None
        See `Warp.behind`.
    confidence, slide : (h, w) image or None
        See `Warp`.
    painted : (h, w) int8 array or None
        What an artist decided about the seam (see `known_labels`).
    misplaced : (h, w) float32 array or None
        px by which it is expected to be further from its place than what the panorama before shows (see `placing`).
    count : (h, w) array or None
        How many pictures the panorama before is the average of, None where none is made.
    options : StitchOptions
    """

    layer: Layer
    fetched: list[Layer]
    picture_map: PictureMap
    window: Window
    canvas: Canvas
    hidden: NDArray[np.bool_]
    hidden_by_depth: NDArray[np.bool_]
    behind: NDArray[np.bool_] | None
    confidence: AnyImage | None
    slide: AnyImage | None
    painted: NDArray[np.int8] | None
    misplaced: Plane | None
    count: NDArray[Any] | None
    options: StitchOptions


@dataclass(frozen=True)
class Step:
    """The panorama with a picture added, in its window; chosen, known, costs, roll, holes: see `Decided`; open (h, w):
    holes to fill, empty if none are."""

    panorama: Layer
    decided: Decided
    open: NDArray[np.bool_]


def add(before: Layer, added: Added, so_far: Decided, is_decided: bool, keep: bool, progress: ReportProgress) -> Step:
    """Add one picture to the panorama before.

    Parameters
    ----------
    before : Layer
    added : Added
    so_far : Decided
        What was decided about it.
    is_decided : bool
        Whether the seam was decided, too.
    keep : bool
        Keep what the seam was cut by.
    progress : callable
    """
    options, layer, hidden, by_depth, behind = (
        added.options, added.layer, added.hidden, added.hidden_by_depth, added.behind
    )  # fmt: skip
    progress("seam", 0.0)
    fetched = added.fetched.pop() if added.fetched else layer
    if added.count is not None:
        progress("blend", 0.0)
        return Step(averaged(before, fetched, added.count), so_far, np.zeros(0, bool))
    holes = holes_of(hidden, before, layer)
    if behind is not None:
        holes |= behind & (before.alpha > 0) & (hidden | (layer.alpha == 0))
        before = _without(before, holes)
    visible, fetched = (_without(one, holes) if holes.any() else one for one in (layer, fetched))
    roll = so_far.roll if is_decided or not added.window.is_whole else roll_for(added.canvas, before, visible)
    before, visible, rolled_hidden = rolled_layer(before, roll), rolled_layer(visible, roll), rolled(by_depth, roll)
    behind = None if behind is None else rolled(behind, roll)
    unseen = rolled_hidden if behind is None else rolled_hidden | behind
    overlap = overlap_of(before, rolled_layer(fetched, roll), unseen) if options.has_seam else None
    del fetched
    found = so_far
    if not is_decided:
        start = replace(so_far, window=added.window, roll=roll, holes=int(holes.sum()))
        found = _with_seam(start, before, visible, overlap, added, rolled_hidden, behind)
        chosen = None if found.chosen is None else added.window.closed(rolled(found.chosen, -roll))
        found = replace(found, chosen=chosen)
        if not keep:
            found = replace(found, hidden_by_depth=found.hidden, known=None, costs=None)
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
    return Step(rolled_layer(out, -roll), found, holes)


def _without(layer: Layer, holes: NDArray[np.bool_]) -> Layer:
    """A layer that shows nothing in holes (H, W), black there: files keep colours below alpha 0."""
    alpha = np.where(holes, layer.alpha.dtype.type(0), layer.alpha)
    return Layer(Weighed(layer.light, alpha if alpha.dtype == bool else ~holes), alpha)


def _with_seam(
    so_far: Decided, before: Layer, layer: Layer, overlap: Overlap | None, added: Added,
    hidden: NDArray[np.bool_], behind: NDArray[np.bool_] | None,
) -> Decided:  # fmt: skip
    """What was decided, with the seam, rolled as before and layer are; hidden (h, w): by depth; behind (h, w): what the
    panorama before cannot see."""
    options, roll = added.options, so_far.roll
    if not options.has_seam:
        return so_far
    painted = None if added.painted is None else rolled(added.painted, roll)
    if options.seam == "none" or overlap is None:
        known = known_labels(before, layer, painted, hidden)
        if behind is not None:
            known[larger_parts(behind) & (known == FREE)] = SECOND
        # without an overlap nothing is free
        nearest = distance_labels(before, layer) if overlap is not None else known == SECOND
        return replace(so_far, chosen=np.where(known == FREE, nearest, known == SECOND))
    known = known_labels(before, layer, painted)
    picture_map = rolled_map(added.picture_map, roll)
    confidence, slide = (
        rolled(whole(image), roll) if image is not None and roll else image
        for image in (added.confidence, added.slide)
    )
    misplaced = None if added.misplaced is None else rolled(added.misplaced, roll)
    unseen = hidden if behind is None else hidden | behind
    moving = moving_labels(overlap, picture_map, before, layer, unseen)
    costs = seam_costs(overlap, picture_map, confidence, hidden, moving, behind, slide, misplaced)
    return replace(so_far, chosen=find_seam(known, costs), known=known, costs=costs)
