"""Smooth continuation of what is known in some pixels (pull-push: Gortler et al., SIGGRAPH 1996)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.threads import each
from .arrays import Plane, strips


def filled(values: NDArray[np.float32], known: NDArray[np.bool_] | NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (h, w, C) where known, or by how well (0..1), continued smoothly elsewhere (pull and push: means over ever
    larger cells fill what smaller ones leave open; Gortler et al., SIGGRAPH 1996, section 3.4)."""
    weights = _weights(known.astype(np.float32))
    channels = [_filled(values[..., k] * weights[0], weights) for k in range(values.shape[2])]
    return np.stack(channels, axis=-1)


def _weights(weight: Plane) -> list[Plane]:
    """How well cells are known, from pixels (h, w) up to where all are."""
    levels = [weight]
    while min(levels[-1].shape) > 2 and levels[-1].min() < 1:
        # weights grow on the way up: a cell with a quarter of it known is known
        levels.append(4 * _down(levels[-1]))
    return levels


def _filled(sums: Plane, weights: list[Plane]) -> Plane:
    """Sums (h, w) of cells over their weights, continued where these are small; the sums are written over."""
    weight, *coarser = weights
    if not coarser:
        whole = np.minimum(weight, 1)
        mean = np.float32(sums.sum() / max(float(weight.sum()), 1e-6))
        return sums / np.maximum(weight, np.float32(1e-6)) * whole + mean * (1 - whole)
    out = _up(_filled(4 * _down(sums), coarser), weight.shape)

    def put(rows: slice) -> None:
        whole = np.minimum(weight[rows], 1)
        out[rows] *= 1 - whole
        sums[rows] *= whole / np.maximum(weight[rows], np.float32(1e-6))
        out[rows] += sums[rows]

    each(put, strips(out.shape))
    return out


def _down(values: Plane) -> Plane:
    return cv2.pyrDown(values, borderType=cv2.BORDER_REFLECT_101)


def _up(values: Plane, shape: tuple[int, ...]) -> Plane:
    return cv2.pyrUp(values, dstsize=(shape[1], shape[0]))


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
