"""What the target cannot see: of several canvas points that claim one of its pixels, the nearest to it owns the pixel.

A point p at inverse depth d lies x'₃ / d baselines in front of the target camera, x'₃ of H_inf p + d e' before the
division. So the depth order is in the warp already; a z-buffer over the target's pixels reads it out.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .two_view import TwoView
from .warp import Warp

# Cells of the z-buffer are 2^level px wide: as wide as the canvas samples the target there, within this margin.
COARSEST, MARGIN = 4, 1.1
# What lies between two points of one surface that share a cell is seen no further off than its diagonal (in cells).
LEAVES_CELL = 1.45
BETWEEN = (0.25, 0.5, 0.75)


def occluded(warp: Warp, two_view: TwoView, target_size: tuple[int, int]) -> NDArray[np.bool_]:
    """Where (H, W) the map falls on a target pixel that a nearer canvas point owns: what is seen there is not this.

    target_size: (W, H) px. d ≤ 0 is infinitely far; where there is no depth (d NaN, no baseline), nothing hides
    anything. A surface does not hide itself, however obliquely it is seen and however much the map magnifies. Linear in
    the pixels.
    """
    hidden = np.zeros(warp.map_x.shape, bool)
    with np.errstate(invalid="ignore"):
        near = inverse_depth_in_target(warp, two_view)
        points = np.flatnonzero(warp.inside(target_size) & np.isfinite(near))
    if not points.size or not (near.ravel()[points] > 0).any():
        return hidden
    near, x, y = (values.ravel()[points] for values in (near, warp.map_x, warp.map_y))
    levels = _levels(warp).ravel()[points]
    order = _ascending(near)
    found = np.zeros(points.size, bool)
    for level in np.unique(levels):
        owner = _owners(x, y, order[levels[order] == level], int(level), target_size)
        claimed = owner[_cells(x, y, int(level), target_size)]
        rivals = np.flatnonzero((claimed >= 0) & ~found)
        rivals = rivals[near[claimed[rivals]] > near[rivals]]
        found[rivals] = _apart(warp, points[rivals], points[claimed[rivals]], LEAVES_CELL * 2.0**level)
    hidden.ravel()[points[found]] = True
    # pixels between the samples of what hides them
    closed = cv2.morphologyEx(hidden.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    return closed & warp.inside(target_size)


def inverse_depth_in_target(warp: Warp, two_view: TwoView) -> NDArray[np.float32]:
    """baseline / depth in front of the target camera (H, W): d / x'₃, 0 at infinity and beyond; NaN without depth."""
    (infinite,) = warp.canvas.through(two_view.H_inf[2:], warp.canvas.xs, warp.canvas.ys)
    d = warp.inverse_depth
    third = d * np.float32(two_view.e_prime[2]) + infinite.astype(np.float32)
    return np.maximum(d, np.float32(0)) / third


def _levels(warp: Warp) -> NDArray[np.uint8]:
    """Which cells the canvas fills: log2 of the target px from one canvas pixel to the next, rounded up.

    Of the steps to either side the shorter counts: at the edge of an object the longer one leads off it.
    """
    step = np.zeros(warp.map_x.shape, np.float32)
    for axis in (0, 1):
        if warp.map_x.shape[axis] < 2:
            continue
        ahead = np.hypot(np.diff(warp.map_x, axis=axis), np.diff(warp.map_y, axis=axis))
        ahead = np.where(np.isfinite(ahead), ahead, np.float32(0))
        first, last = (np.take(ahead, [i], axis=axis) for i in (0, -1))
        shorter = np.minimum(np.concatenate([first, ahead], axis), np.concatenate([ahead, last], axis))
        np.maximum(step, shorter, out=step)
    levels = np.ceil(np.log2(np.maximum(step / np.float32(MARGIN), np.float32(1))))
    return np.minimum(levels, COARSEST).astype(np.uint8)


def _ascending(values: NDArray[np.float32]) -> NDArray[np.intp]:
    """argsort of values ≥ 0 in linear time: their bits order as they do, and NumPy sorts 16 bits by counting."""
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32)
    order = np.argsort((bits & 0xFFFF).astype(np.uint16), kind="stable")
    return order[np.argsort((bits[order] >> 16).astype(np.uint16), kind="stable")]


def _cells(
    x: NDArray[np.float32], y: NDArray[np.float32], level: int, target_size: tuple[int, int]
) -> NDArray[np.intp]:
    columns = (target_size[0] >> level) + 1
    return ((y + np.float32(0.5)).astype(np.intp) >> level) * columns + ((x + np.float32(0.5)).astype(np.intp) >> level)


def _owners(
    x: NDArray[np.float32], y: NDArray[np.float32], order: NDArray[np.intp], level: int, target_size: tuple[int, int]
) -> NDArray[np.intp]:
    """For each cell the last in order of those in it, -1 where there is none."""
    width, height = target_size
    owner = np.full(((width >> level) + 1) * ((height >> level) + 1), -1, np.intp)
    owner[_cells(x[order], y[order], level, target_size)] = order  # of equal indices NumPy keeps the last
    return owner


def _apart(warp: Warp, first: NDArray[np.intp], second: NDArray[np.intp], tolerance: float) -> NDArray[np.bool_]:
    """Whether the map moves more than `tolerance` px away between two canvas points (flat indices) that it brings
    together: then they lie on two surfaces, else on one that is seen obliquely."""
    width = warp.map_x.shape[1]
    begin, end = (np.stack(np.divmod(points, width), axis=-1).astype(np.float32) for points in (first, second))
    home = np.stack([warp.map_x.ravel()[first], warp.map_y.ravel()[first]], axis=-1)
    out = np.zeros(first.size, bool)
    for share in BETWEEN:
        at = begin + np.float32(share) * (end - begin)
        away = np.flatnonzero(~(_distance(home, warp, np.rint(at)) <= tolerance) & ~out)
        # rounded places lie beside the line between the two: those that matter are looked at again, exactly
        low = np.floor(at[away])
        u, v = np.moveaxis(at[away] - low, -1, 0)
        corners = ((0, 0, (1 - u) * (1 - v)), (0, 1, (1 - u) * v), (1, 0, u * (1 - v)), (1, 1, u * v))
        offset = np.sum([_offset(home[away], warp, low + (i, j), weight) for i, j, weight in corners], axis=0)
        out[away[~(np.hypot(*offset) <= tolerance)]] = True  # behind the camera is apart too
    return out


def _offset(
    home: NDArray[np.float32], warp: Warp, at: NDArray[np.float32], weight: NDArray[np.float32] | float = 1.0
) -> NDArray[np.float32]:
    """How far (2, N) the map at canvas places (N, 2: row, column) lies from target pixels (N, 2), times a weight."""
    height, width = warp.map_x.shape
    index = np.minimum(at[:, 0].astype(np.intp), height - 1) * width + np.minimum(at[:, 1].astype(np.intp), width - 1)
    maps = (warp.map_x, warp.map_y)
    return np.stack([weight * (values.ravel()[index] - home[:, k]) for k, values in enumerate(maps)])


def _distance(home: NDArray[np.float32], warp: Warp, at: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.hypot(*_offset(home, warp, at))
