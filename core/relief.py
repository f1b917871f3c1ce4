"""The relief: what dense refinement adds to a field, on the reference's own pixels and a margin around them.

Inverse depth takes it up as it is, so that x' ~ H_inf p + d e' stays the whole warp. Beyond the overlap it goes on
smoothly and fades to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .canvas import Box
from .displacement import fade_outside
from .line_map import Lines, Plane, SparseMap
from .warp import fetch

# Moves fade over so many times their own size (98 %) outside the overlap, as the field does, within this share of the
# picture's side.
FADE, LEAST_FADE, MOST_FADE = 5.0, 8.0, 0.15
COARSE = 8


@dataclass(frozen=True)
class Relief:
    """A box of raw reference pixels from `start` (x, y): inverse_depth (h, w) to be added to the field's, shift
    (h, w, 2) px to be added in the target, confidence (h, w) 0..1 in it; all 0 at its rim, float32."""

    start: tuple[int, int]
    inverse_depth: Plane
    shift: Plane
    confidence: Plane

    def at(self, x: NDArray, y: NDArray) -> tuple[Plane, Plane, Plane]:
        """inverse_depth (…), shift (…, 2) and confidence (…) at reference px (rows, columns); exact on pixels, linear
        between them, 0 outside."""
        x, y = (np.asarray(v - s, np.float32) for v, s in zip((x, y), self.start, strict=True))
        parts = (self.inverse_depth[..., None], self.shift, self.confidence[..., None])
        inverse_depth, shift, confidence = (fetch(part, x, y, cv2.INTER_LINEAR) for part in parts)
        return inverse_depth[..., 0], shift, confidence[..., 0]


def raised(
    lines: Lines, sparse: SparseMap, along: Plane, across: Plane, confidence: Plane, there: NDArray[np.bool_]
) -> Relief:
    """The relief of moves (h, w) px along and across the lines of the nodes; there (h, w): the overlap."""
    left, top, width, height = lines.box
    inside = _resized(there.astype(np.float32), lines.box) > 0.5
    moved = np.stack([_resized(np.where(there, v, np.float32(0)), lines.box) for v in (along, across)], axis=-1)
    near = np.abs(along[there])
    limit = MOST_FADE * max(sparse.camera.size)
    fade = float(np.clip(FADE * np.percentile(near, 98) if near.size else 0.0, LEAST_FADE, max(limit, LEAST_FADE)))
    margin = int(np.ceil(fade)) + 1
    moved = cv2.copyMakeBorder(moved, *[margin] * 4, cv2.BORDER_CONSTANT)
    inside = np.pad(inside, margin)
    box = (left - margin, top - margin, width + 2 * margin, height + 2 * margin)
    share = fade_outside(inside, fade).astype(np.float32) if inside.any() else np.zeros(inside.shape, np.float32)
    moved = carried_on(moved, inside.astype(np.float32)) * share[..., None]
    smooth = Lines.over(sparse, box, COARSE)
    per_px, *direction = (
        np.nan_to_num(_resized(np.ascontiguousarray(v), box))
        for v in (smooth.moved, smooth.direction[..., 0], smooth.direction[..., 1])
    )
    shift = np.stack([-moved[..., 1] * direction[1], moved[..., 1] * direction[0]], axis=-1)
    sure = np.pad(_resized(np.where(there, confidence, np.float32(0)), lines.box), margin)
    return Relief(box[:2], moved[..., 0] * per_px, shift, np.clip(sure, 0, 1))


def carried_on(values: NDArray[np.float32], known: Plane) -> NDArray[np.float32]:
    """values (h, w, k) where known (h, w) is 1; elsewhere what surrounds it, the smoother the further away.

    Pull-push over a pyramid (Gortler et al., "The Lumigraph", SIGGRAPH 1996).
    """
    if min(known.shape) < 2 or known.min() >= 1:
        return values
    weight = known[..., None]
    down = cv2.pyrDown(np.concatenate([values * weight, weight], axis=-1))
    share = np.clip(down[..., -1], 0, 1)
    coarse = carried_on(
        down[..., :-1] / np.maximum(down[..., -1:], np.float32(1e-6)), np.minimum(1, share * 4).astype(np.float32)
    )
    up = cv2.pyrUp(coarse, dstsize=(known.shape[1], known.shape[0])).reshape(values.shape)
    return values * weight + up * (1 - weight)


def _resized(values: Plane, box: Box) -> Plane:
    """Node values as pixels of their box, linear."""
    size = box[2], box[3]
    return values if values.shape[::-1] == size else cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
