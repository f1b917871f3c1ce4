"""What dense refinement adds to a field, on nodes over a part of the reference."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Plane
from ..raster.sampling import fetch


@dataclass(frozen=True)
class RefinedDepth:
    """Nodes over a part of the reference: the first (column, row) lies at raw px `start` (x, y), `step` (x, y) px lie
    from each to the next.

    inverse_depth (h, w) to be added to the field's, shift (h, w, 2) px to be added in picture number `picture`,
    confidence (h, w) 0..1 in it; all 0 at the rim, float32.
    """

    start: tuple[float, float]
    step: tuple[float, float]
    inverse_depth: Plane
    shift: Plane
    confidence: Plane
    picture: int = 1

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
