"""What dense refinement adds to a field, on a grid of nodes over part of the reference."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Plane
from ..raster.sampling import fetch
from .options import REFINED


@dataclass(frozen=True)
class RefinedDepth:
    """Corrections on a regular grid of nodes in raw (distorted) reference pixels; all float32, all 0 at the border.

    start (x, y) px: the first node; step (x, y) px between nodes; inverse_depth (h, w): added to the field's d; shift
    (h, w, 2): px added to the field's in picture number `picture`; confidence (h, w), 0 to 1.
    """

    start: tuple[float, float]
    step: tuple[float, float]
    inverse_depth: Plane
    shift: Plane
    confidence: Plane
    picture: int = 1

    def at(self, x: NDArray[Any], y: NDArray[Any]) -> tuple[Plane, Plane, Plane]:
        """inverse_depth (…), shift (…, 2) and confidence (…) at raw reference pixels x, y (rows, columns).

        Bilinear between nodes, 0 outside the grid.
        """
        x, y = (
            np.asarray((v - s) / step, np.float32) for v, s, step in zip((x, y), self.start, self.step, strict=True)
        )
        if self.inverse_depth.size <= REFINED.together_nodes:
            values = fetch(self._together, x, y, cv2.INTER_LINEAR)
            return values[..., 0], values[..., 1:3], values[..., 3]
        parts = (self.inverse_depth[..., None], self.shift, self.confidence[..., None])
        inverse_depth, shift, confidence = (fetch(part, x, y, cv2.INTER_LINEAR) for part in parts)
        return inverse_depth[..., 0], shift, confidence[..., 0]

    @cached_property
    def _together(self) -> Plane:
        """inverse_depth, shift and confidence (h, w, 4): sampled at once, they take less than half the time."""
        return np.dstack([self.inverse_depth, self.shift, self.confidence])

    def over(self, xs: Array, ys: Array) -> tuple[Plane, Plane, Plane]:
        """The same as `at` where columns xs (W,) and rows ys (H,) cross: ascending, evenly spaced raw reference px."""
        inverse_depth, shift, confidence = (self.part_over(part, xs, ys) for part in self.parts)
        return inverse_depth, shift, confidence

    def part_over(self, part: Plane, xs: Array, ys: Array) -> Plane:
        """One of the `parts` on the same crossings (H, W[, 2])."""
        rows, columns = self.inverse_depth.shape
        left, weight_x, inside_x = _between((xs - self.start[0]) / self.step[0], columns)
        top, weight_y, inside_y = _between((ys - self.start[1]) / self.step[1], rows)
        out = np.zeros((len(ys), len(xs), *part.shape[2:]), np.float32)
        if left.size and top.size:
            needed = slice(int(top[0]), int(top[-1]) + 2)
            along_rows = _interpolated(part[needed], left, weight_x, 1)
            out[inside_y, inside_x] = _interpolated(along_rows, top - needed.start, weight_y, 0)
        return out

    @property
    def parts(self) -> tuple[Plane, Plane, Plane]:
        """inverse_depth, shift and confidence."""
        return self.inverse_depth, self.shift, self.confidence


def _between(places: Array, count: int) -> tuple[NDArray[np.intp], NDArray[np.float32], slice]:
    """For linear interpolation at ascending `places` (in node indices): the node before each place that lies within
    0 … count − 1, the weight (0 to 1) of the node after it, and the slice of those places."""
    inside = np.flatnonzero((places >= 0) & (places <= count - 1))
    if not inside.size:
        return inside, inside.astype(np.float32), slice(0, 0)
    places = places[inside]
    before = np.minimum(places.astype(np.intp), max(0, count - 2))
    return before, (places - before).astype(np.float32), slice(int(inside[0]), int(inside[-1]) + 1)


def _interpolated(values: Plane, before: NDArray[np.intp], weight: NDArray[np.float32], axis: int) -> Plane:
    """Values along an axis, between the nodes `before` and the next ones by `weight` (see `_between`)."""
    result = np.take(values, before, axis=axis)
    if not weight.any():  # every place lies on a node
        return result
    difference = np.take(values, before + 1, axis=axis)
    difference -= result
    difference *= weight.reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    result += difference
    return result
