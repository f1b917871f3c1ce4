"""The relief: what dense refinement adds to a field, on the nodes it was found at and a margin around them.

Inverse depth takes it up as it is, so that x' ~ H_inf p + d e' stays the whole warp. Beyond the overlap what both
pictures agreed on goes on smoothly and fades to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .displacement import fading, outside
from .epipolar import Array
from .line_map import Lines, Plane, SparseMap
from .overlap import distance_inside
from .warp import fetch

# Moves fade over so many times their own size (98 %) outside the overlap, as the field does, within this share of the
# picture's side.
FADE, LEAST_FADE, MOST_FADE = 5.0, 8.0, 0.15
COARSE = 8
# Confidence that counts for nothing and for all in what goes on beyond the overlap; it reaches so many nodes (a side)
# over the rim of what it is about.
DOUBTED, SURE, RIM = 0.2, 0.5, 9
# Share of the fade's width over which doubtful moves give way before the border: twice their own size.
GIVE_WAY = 2 / FADE


@dataclass(frozen=True)
class Relief:
    """Nodes over a part of the reference: the first (column, row) lies at raw px `start` (x, y), `step` (x, y) px lie
    from each to the next.

    inverse_depth (h, w) to be added to the field's, shift (h, w, 2) px to be added in the target, confidence (h, w)
    0..1 in it; all 0 at the rim, float32.
    """

    start: tuple[float, float]
    step: tuple[float, float]
    inverse_depth: Plane
    shift: Plane
    confidence: Plane

    def at(self, x: NDArray, y: NDArray) -> tuple[Plane, Plane, Plane]:
        """inverse_depth (…), shift (…, 2) and confidence (…) at reference px (rows, columns); exact on nodes, linear
        between them, 0 outside."""
        x, y = (
            np.asarray((v - s) / step, np.float32) for v, s, step in zip((x, y), self.start, self.step, strict=True)
        )
        parts = (self.inverse_depth[..., None], self.shift, self.confidence[..., None])
        inverse_depth, shift, confidence = (fetch(part, x, y, cv2.INTER_LINEAR) for part in parts)
        return inverse_depth[..., 0], shift, confidence[..., 0]

    def over(self, xs: Array, ys: Array) -> tuple[Plane, Plane, Plane]:
        """The same at every crossing of columns xs and lines ys, which are evenly spaced, rising reference px."""
        inverse_depth, shift, confidence = (self.part_over(part, xs, ys) for part in self.parts)
        return inverse_depth, shift, confidence

    def part_over(self, part: Plane, xs: Array, ys: Array) -> Plane:
        """The same of one of its `parts`."""
        rows, columns = self.inverse_depth.shape
        left, share, across = _between((xs - self.start[0]) / self.step[0], columns)
        top, share_down, down = _between((ys - self.start[1]) / self.step[1], rows)
        out = np.zeros((len(ys), len(xs), *part.shape[2:]), np.float32)
        if left.size and top.size:
            near = slice(int(top[0]), int(top[-1]) + 2)
            lines = _mixed(part[near], left, share, 1)
            out[down, across] = _mixed(lines, top - near.start, share_down, 0)
        return out

    @property
    def parts(self) -> tuple[Plane, Plane, Plane]:
        """inverse_depth, shift and confidence."""
        return self.inverse_depth, self.shift, self.confidence


def _between(places: Array, count: int) -> tuple[NDArray[np.intp], NDArray[np.float32], slice]:
    """Of places on nodes 0 … count − 1 those that lie on them (a slice), the node before each, and how far (0..1) the
    way to the next it is."""
    here = np.flatnonzero((places >= 0) & (places <= count - 1))
    if not here.size:
        return here, here.astype(np.float32), slice(0, 0)
    places = places[here]
    before = np.minimum(places.astype(np.intp), max(0, count - 2))
    return before, (places - before).astype(np.float32), slice(int(here[0]), int(here[-1]) + 1)


def _mixed(values: Plane, before: NDArray[np.intp], share: NDArray[np.float32], axis: int) -> Plane:
    first = np.take(values, before, axis=axis)
    if not share.any():  # nodes are pixels
        return first
    more = np.take(values, before + 1, axis=axis)
    more -= first
    more *= share.reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    first += more
    return first


def raised(
    lines: Lines, sparse: SparseMap, along: Plane, across: Plane, confidence: Plane, there: NDArray[np.bool_]
) -> Relief:
    """The relief of moves (h, w) px along and across the lines of the nodes; there (h, w): the overlap."""
    left, top, width, height = lines.box
    rows, columns = there.shape
    step = width / columns, height / rows
    near = np.abs(along[there])
    limit = MOST_FADE * max(sparse.camera.size)
    fade = float(np.clip(FADE * np.percentile(near, 98) if near.size else 0.0, LEAST_FADE, max(limit, LEAST_FADE)))
    fade /= min(step)
    margin = int(np.ceil(fade)) + 1
    inside = np.pad(there, margin)
    share = fading(outside(inside).astype(np.float32), fade).astype(np.float32)

    def widened(values: Plane) -> Plane:
        return cv2.copyMakeBorder(np.where(there, values, np.float32(0)), *[margin] * 4, cv2.BORDER_CONSTANT)

    sure = widened(np.clip(confidence, 0, 1))
    weight = _told(inside, sure, GIVE_WAY * fade)
    to_side = across.any()
    along, across = (
        _beyond(widened(values), *weight) * share if values.any() else np.zeros(inside.shape, np.float32)
        for values in (along, across)
    )
    more = margin * step[0], margin * step[1]
    smooth = Lines.over(
        sparse, (left - more[0], top - more[1], width + 2 * more[0], height + 2 * more[1]), COARSE * min(step)
    )
    per_px, *direction = (
        np.nan_to_num(_resized(np.ascontiguousarray(v), inside.shape), copy=False)
        for v in (smooth.moved, smooth.direction[..., 0], smooth.direction[..., 1])[: 3 if to_side else 1]
    )
    shift = np.zeros((*inside.shape, 2), np.float32)
    if to_side:
        cv2.merge([-across * direction[1], across * direction[0]], shift)
    start = left + (step[0] - 1) / 2 - more[0], top + (step[1] - 1) / 2 - more[1]
    return Relief(start, step, along * per_px, shift, sure)


def _told(inside: NDArray[np.bool_], sure: Plane, width: float) -> tuple[Plane, Plane]:
    """How much (h, w) 0..1 each node counts in what goes on beyond the overlap, and how far it gives way to that."""
    held = cv2.erode(sure, np.ones((RIM, RIM), np.uint8))
    weight = inside * np.clip((held - np.float32(DOUBTED)) / np.float32(SURE - DOUBTED), 0, 1)
    share = np.clip(1 - distance_inside(inside).astype(np.float32) / np.float32(width), 0, 1)
    return weight.astype(np.float32), np.where(inside, share, np.float32(1)).astype(np.float32)


def _beyond(moved: Plane, weight: Plane, share: Plane) -> Plane:
    """Moves (h, w) of the nodes inside, and beyond them what goes on of those that are sure; see `_told`.

    A bare sky moves by whatever the search made of it: carried on it would bend the mast before it. The last
    nodes before the border are doubtful too: they were sought by half a window. Within some nodes of the border what
    is doubtful gives way to what goes on beyond, or the map would jump there.
    """
    gone_on = carried_on(moved, weight)
    gone_on -= moved
    gone_on *= share
    gone_on += moved
    return gone_on


def carried_on(values: Plane, known: Plane) -> Plane:
    """values (h, w) where known (h, w) is 1; elsewhere what surrounds it, the smoother the further away.

    Pull-push over a pyramid (Gortler et al., "The Lumigraph", SIGGRAPH 1996).
    """
    if min(known.shape) < 2 or known.min() >= 1:
        return values.copy()
    weighed = values * known
    down, share = cv2.pyrDown(weighed), cv2.pyrDown(known)
    down /= np.maximum(share, np.float32(1e-6))
    coarse = carried_on(down, np.clip(share * 4, 0, 1))
    out = cv2.pyrUp(coarse, dstsize=(known.shape[1], known.shape[0]))
    out *= 1 - known
    out += weighed
    return out


def _resized(values: Plane, shape: tuple[int, ...]) -> Plane:
    """Values of cells over the same box, for so many (rows, columns), linear."""
    return cv2.resize(values, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
