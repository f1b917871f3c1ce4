"""Filling what neither camera saw, where that is asked for: smoothly, from what lies behind; no detail is made up."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .blend import copied_where
from .light import AnyLight, Light, Part, around, bounds, meet
from .multiband import filled
from .tone import to_light, to_tones
from .warp import Layer

HOLES = ("transparent", "inpaint")
# Pixels around a hole that it is filled from, and what the near ones among them count beside the far ones.
REACH, NEAR = 12, 1e-3


def inpainted(panorama: Layer, holes: NDArray[np.bool_], inverse_depth: AnyLight) -> Layer:
    """A layer that shows something in its holes (H, W), too: a smooth continuation of what lies around them, opaque.

    inverse_depth (H, W): a hole is what something near hid, so it is filled from what is further away than halfway to
    that. Everywhere else every pixel stays what it was.
    """
    extent = bounds(holes)
    if extent is None:
        return panorama
    box = around(extent, REACH, holes.shape)
    missing = holes[box]
    rim = cv2.dilate(missing.astype(np.uint8), np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)) > 0
    beside = rim & ~missing & (panorama.alpha[box] > 0)
    weight = beside * np.where(_far(np.asarray(inverse_depth[box]), missing, beside), np.float32(1), np.float32(NEAR))
    tones = filled(to_tones(panorama.light[box]), weight)
    at = box[0].start, box[1].start
    alpha = panorama.alpha.copy()
    alpha[box][missing] = 1
    return Layer(Patched(panorama.light, at, to_light(tones), missing), alpha)


def _far(inverse_depth: NDArray, missing: NDArray[np.bool_], beside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) it is further away than halfway from what is missing to the nearest that lies beside it."""
    depth = np.nan_to_num(inverse_depth).astype(np.float32)
    behind = filled(depth[..., None], missing.astype(np.float32))[..., 0]
    size = np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)
    nearest = cv2.dilate(np.where(beside, depth, depth.min()).astype(np.float32), size)
    return depth <= (behind + np.maximum(nearest, behind)) / 2


@dataclass(frozen=True, eq=False)
class Patched(Light):
    """Light with other pixels (h, w, C) from `at` (row, column) on, where a mask (h, w) says so."""

    light: AnyLight
    at: tuple[int, int]
    patch: NDArray[np.float32]
    mask: NDArray[np.bool_]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        out = self.light[part]
        meeting = meet(part, self.shape, self.at, self.patch.shape)
        if meeting is None or not self.mask[meeting[1]].any():
            return out
        out = out.copy()
        here, there = meeting
        inner = np.ascontiguousarray(out[here])
        copied_where(self.mask[there], np.ascontiguousarray(self.patch[there]), inner)
        out[here] = inner
        return out
