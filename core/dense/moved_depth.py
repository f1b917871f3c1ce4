"""From moves along and across epipolar lines to what is added to inverse depth.

Inverse depth takes the moves up as they are, so that x' ~ H_inf p + d e' stays the whole warp. Beyond the overlap what
both pictures agreed on goes on smoothly and fades to nothing.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..field.fade import fading
from ..field.refined_depth import RefinedDepth
from ..raster.arrays import Plane
from ..raster.distance import distance_inside, outside
from ..raster.pull_push import carried_on
from .epipolar_lines import EpipolarLines, SparseMap
from .options import BEYOND


def build_refinement(
    lines: EpipolarLines, sparse: SparseMap, along: Plane, across: Plane, confidence: Plane, there: NDArray[np.bool_]
) -> RefinedDepth:
    """The relief of moves (h, w) px along and across the lines of the nodes; there (h, w): the overlap."""
    left, top, width, height = lines.box
    rows, columns = there.shape
    step = width / columns, height / rows
    near = np.abs(along[there])
    limit = BEYOND.max_fade * max(sparse.camera.size)
    wanted = BEYOND.fade_length * np.percentile(near, 98) if near.size else 0.0
    fade = float(np.clip(wanted, BEYOND.min_fade_px, max(limit, BEYOND.min_fade_px)))
    fade /= min(step)
    margin = int(np.ceil(fade)) + 1
    inside = np.pad(there, margin)
    share = fading(outside(inside).astype(np.float32), fade).astype(np.float32)

    def widened(values: Plane) -> Plane:
        return cv2.copyMakeBorder(np.where(there, values, np.float32(0)), *[margin] * 4, cv2.BORDER_CONSTANT)

    sure = widened(np.clip(confidence, 0, 1))
    weight = _trust(inside, sure, BEYOND.yielding_share * fade)
    to_side = across.any()
    along, across = (
        _beyond(widened(values), *weight) * share if values.any() else np.zeros(inside.shape, np.float32)
        for values in (along, across)
    )
    more = margin * step[0], margin * step[1]
    box = left - more[0], top - more[1], width + 2 * more[0], height + 2 * more[1]
    smooth = EpipolarLines.over(sparse, box, BEYOND.coarse_step * min(step))
    per_px, *direction = (
        np.nan_to_num(_resized(np.ascontiguousarray(v), inside.shape), copy=False)
        for v in (smooth.depth_per_px, smooth.direction[..., 0], smooth.direction[..., 1])[: 3 if to_side else 1]
    )
    shift = np.zeros((*inside.shape, 2), np.float32)
    if to_side:
        cv2.merge([-across * direction[1], across * direction[0]], shift)
    start = left + (step[0] - 1) / 2 - more[0], top + (step[1] - 1) / 2 - more[1]
    return RefinedDepth(start, step, along * per_px, shift, sure)


def _trust(inside: NDArray[np.bool_], sure: Plane, width: float) -> tuple[Plane, Plane]:
    """How much (h, w) 0..1 each node counts in what goes on beyond the overlap, and how far it gives way to that."""
    held = cv2.erode(sure, np.ones((BEYOND.confidence_erosion,) * 2, np.uint8))
    ignored, trusted = BEYOND.ignored_confidence, BEYOND.trusted_confidence
    weight = inside * np.clip((held - np.float32(ignored)) / np.float32(trusted - ignored), 0, 1)
    share = np.clip(1 - distance_inside(inside).astype(np.float32) / np.float32(width), 0, 1)
    return weight.astype(np.float32), np.where(inside, share, np.float32(1)).astype(np.float32)


def _beyond(moved: Plane, weight: Plane, share: Plane) -> Plane:
    """Moves (h, w) of the nodes inside, and beyond them what goes on of those that are sure; see `_trust`.

    A bare sky moves by whatever the search made of it: carried on it would bend the mast before it. The last
    nodes before the border are doubtful too: they were sought by half a window. Within some nodes of the border what
    is doubtful gives way to what goes on beyond, or the map would jump there.
    """
    gone_on = carried_on(moved, weight)
    gone_on -= moved
    gone_on *= share
    gone_on += moved
    return gone_on


def _resized(values: Plane, shape: tuple[int, ...]) -> Plane:
    """Values of cells over the same box, for so many (rows, columns), linear."""
    return cv2.resize(values, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
