"""From moves along and across epipolar lines to corrections of inverse depth and shift.

Moves along the lines become changes of d, so that x' ~ H_inf p + d e' stays the whole warp. Outside the overlap moves
of high confidence are continued smoothly and fade to 0.
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
from .rim_options import BEYOND


def build_refinement(
    lines: EpipolarLines, sparse: SparseMap, along: Plane, across: Plane, confidence: Plane, overlap: NDArray[np.bool_]
) -> RefinedDepth:
    """The refinement that moves the nodes by along (h, w) and across (h, w) px of their lines within the overlap.

    sparse: the field that the moves start from; confidence (h, w) of the moves; overlap (h, w): mask.
    """
    left, top, width, height = lines.box
    rows, columns = overlap.shape
    step = width / columns, height / rows
    lengths = np.abs(along[overlap])
    limit = BEYOND.max_fade * max(sparse.camera.size)
    wanted = BEYOND.fade_length * np.percentile(lengths, 98) if lengths.size else 0.0
    fade = float(np.clip(wanted, BEYOND.min_fade_px, max(limit, BEYOND.min_fade_px)))
    fade /= min(step)
    margin = int(np.ceil(fade)) + 1
    inside = np.pad(overlap, margin)
    alpha = fading(outside(inside).astype(np.float32), fade).astype(np.float32)

    def padded(values: Plane) -> Plane:
        result: Plane = cv2.copyMakeBorder(np.where(overlap, values, np.float32(0)), *[margin] * 4, cv2.BORDER_CONSTANT)
        return result

    confidence = padded(np.clip(confidence, 0, 1))
    weight, yielding = _trust(inside, confidence, BEYOND.yielding_share * fade)
    leaves_lines = across.any()
    along, across = (
        _continued(padded(values), weight, yielding) * alpha if values.any() else np.zeros(inside.shape, np.float32)
        for values in (along, across)
    )
    margin_px = margin * step[0], margin * step[1]
    box = left - margin_px[0], top - margin_px[1], width + 2 * margin_px[0], height + 2 * margin_px[1]
    coarse_lines = EpipolarLines.over(sparse, box, BEYOND.coarse_step * min(step))
    per_px, *direction = (
        np.nan_to_num(_resized(np.ascontiguousarray(v), inside.shape), copy=False)
        for v in (coarse_lines.depth_per_px, *np.moveaxis(coarse_lines.direction, -1, 0))[: 3 if leaves_lines else 1]
    )
    shift = np.zeros((*inside.shape, 2), np.float32)
    if leaves_lines:
        cv2.merge([-across * direction[1], across * direction[0]], shift)
    start = left + (step[0] - 1) / 2 - margin_px[0], top + (step[1] - 1) / 2 - margin_px[1]
    return RefinedDepth(start, step, along * per_px, shift, confidence)


def _trust(inside: NDArray[np.bool_], confidence: Plane, width: float) -> tuple[Plane, Plane]:
    """The weight (h, w) of each node in the continuation, and how far (h, w) it gives way to the continuation: 0 deeper
    than `width` nodes inside the overlap, 1 at its border and outside. Both 0 to 1."""
    eroded = cv2.erode(confidence, np.ones((BEYOND.confidence_erosion,) * 2, np.uint8))
    ignored, trusted = BEYOND.ignored_confidence, BEYOND.trusted_confidence
    weight = inside * np.clip((eroded - np.float32(ignored)) / np.float32(trusted - ignored), 0, 1)
    yielding = np.clip(1 - distance_inside(inside).astype(np.float32) / np.float32(width), 0, 1)
    return weight.astype(np.float32), np.where(inside, yielding, np.float32(1)).astype(np.float32)


def _continued(moves: Plane, weight: Plane, yielding: Plane) -> Plane:
    """Moves (h, w) inside the overlap, continued outside from the nodes with weight; weight, yielding: see `_trust`.

    A uniform sky gets arbitrary moves, which must not bend a mast in front of it beyond the border; the last nodes
    before the border are doubtful as well, since half of their window is missing. Close to the border doubtful moves
    give way to the continuation, so that the map does not jump there.
    """
    continued = carried_on(moves, weight)
    continued -= moves
    continued *= yielding
    continued += moves
    return continued


def _resized(values: Plane, shape: tuple[int, ...]) -> Plane:
    """Values (m, n) of cells resampled bilinearly to shape (rows, columns) cells over the same box."""
    result: Plane = cv2.resize(values, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return result
