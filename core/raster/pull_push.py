"""Smooth continuation of what is known in some pixels, by pull and push over a pyramid.

Pull: means over ever larger cells, weighted by how well their pixels are known. Push: where a pixel is not known, the
mean of the smallest cell around it that is. Gortler, Grzeszczuk, Szeliski and Cohen, The Lumigraph, SIGGRAPH 1996,
section 3.4.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.threads import each
from .arrays import Plane, strips

# Weights below this are rounding: nothing is divided by less.
LEAST_WEIGHT = np.float32(1e-6)


def filled(values: NDArray[np.float32], known: NDArray[np.bool_] | NDArray[np.float32]) -> NDArray[np.float32]:
    """Continue values into pixels where they are not known; every known pixel of a cell counts alike in its mean.

    Parameters
    ----------
    values : (h, w, C) float32
        Anything finite where nothing is known.
    known : (h, w) bool, or float32 in [0, 1]
        Where the values are known, or how well.

    Returns
    -------
    (h, w, C) float32
        The values where they are wholly known, a smooth continuation elsewhere; zeros if nothing is known.
    """
    weights = pulled_weights(known.astype(np.float32))
    return np.stack([push(pulled(values[..., k] * weights[0], weights), weights) for k in range(values.shape[2])], -1)


def carried_on(values: Plane, known: Plane) -> Plane:
    """Continue values into pixels where they are not known; a cell counts at most as much as one known throughout.

    So a few pixels at a rim are carried outwards as much as what lies far inside, which is how Gortler et al. have it.

    Parameters
    ----------
    values : (h, w) float32
        Anything finite where nothing is known.
    known : (h, w) float32 in [0, 1]
        How well the values are known.

    Returns
    -------
    (h, w) float32
        The values where they are wholly known, a smooth continuation elsewhere.
    """
    sums, weights = [values * known], [known]
    while _has_gaps(weights[-1]):
        weight, mean = reduced(weights[-1]), reduced(sums[-1])
        mean /= np.maximum(weight, LEAST_WEIGHT)
        weights.append(np.clip(4 * weight, 0, 1))
        sums.append(mean * weights[-1])
    return push(sums, weights)


def pulled_weights(known: Plane) -> list[Plane]:
    """How well cells are known, from pixels (h, w) up to where all are; above 1 where more than a pixel's worth is."""
    levels = [known]
    while _has_gaps(levels[-1]):
        # the sum over the four pixels of a cell: one known pixel makes it known
        levels.append(4 * reduced(levels[-1]))
    return levels


def pulled(sums: Plane, weights: list[Plane]) -> list[Plane]:
    """Sums (h, w) of values times weight, for the cells of every level of `pulled_weights`."""
    levels = [sums]
    while len(levels) < len(weights):
        levels.append(4 * reduced(levels[-1]))
    return levels


def push(sums: list[Plane], weights: list[Plane]) -> Plane:
    """Means (h, w) of pixels, continued from coarser cells where the weight is below 1; both from fine to coarse.

    The sums are written over and their list is emptied, so that large planes are freed as soon as they are used.
    """
    total, weight = sums.pop(), weights[len(sums)]
    whole = np.minimum(weight, 1)
    mean = np.float32(total.sum() / max(float(weight.sum()), float(LEAST_WEIGHT)))
    out: Plane = total / np.maximum(weight, LEAST_WEIGHT) * whole + mean * (1 - whole)
    while sums:
        total, weight = sums.pop(), weights[len(sums)]
        out = expanded(out, weight.shape)

        def put(rows: slice, out: Plane = out, total: Plane = total, weight: Plane = weight) -> None:
            out[rows] *= 1 - np.minimum(weight[rows], 1)
            total[rows] *= 1 / np.maximum(weight[rows], 1)
            out[rows] += total[rows]

        each(put, strips(out.shape))
    return out


def reduced(values: Plane) -> Plane:
    """Half as many rows and columns (rounded up), smoothed by a Gaussian of 5 × 5."""
    smaller: Plane = cv2.pyrDown(values, borderType=cv2.BORDER_REFLECT_101)
    return smaller


def expanded(values: Plane, shape: tuple[int, ...]) -> Plane:
    """Twice as many rows and columns, to `shape` (h, w), smoothed alike."""
    larger: Plane = cv2.pyrUp(values, dstsize=(shape[1], shape[0]))
    return larger


def _has_gaps(weight: Plane) -> bool:
    return min(weight.shape) > 2 and bool(weight.min() < 1)
