"""The last fraction of a pixel on the sphere: photometric alignment of all pictures that see a node, by Gauss-Newton.

As `polish` does for a pair, with one unknown at each node and a sum over the pictures. The picture that shows a node
best moves along its own line as well, where it was not taken from the viewpoint.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Plane
from ..edge_aware_smoothing import Smoother, Weights
from ..local_means import local_gain, mean, without_means
from ..options import POLISH
from .choice import Compared
from .hiding import hidden_from
from .patch import sampled


def polished(compared: Compared, along: Plane, known: Plane, weights: Weights) -> Plane:
    """Moves until the pictures look alike.

    Parameters
    ----------
    compared : Compared
    along : (h, w) float32
        Moves to start from, px.
    known : (h, w) float32
        0..1, how well they are known: guesses count less among their neighbours.
    weights : pair of float32 arrays
        Connections of neighbours (see `edge_weights`).

    Returns
    -------
    (h, w) float32
    """
    smoother, start = Smoother.of(weights, POLISH.smoothness), along
    hidden = hidden_from(compared, compared.at(along))
    grays = [cv2.cvtColor(levels[..., :3], cv2.COLOR_RGB2GRAY).astype(np.float32) for levels in compared.levels]
    for blur, count in POLISH.schedule:
        sloped = [_with_slopes(gray, levels, blur) for gray, levels in zip(grays, compared.levels, strict=True)]
        for _ in range(count):
            gradient, curvature = _equations(_Fetched.of(compared, sloped, along), compared, hidden)
            step = gradient + np.float32(POLISH.start_evidence) * (start - along)
            step /= curvature + np.float32(POLISH.start_evidence + POLISH.damping)
            moved: Plane = along + np.clip(step, -POLISH.max_step_px, POLISH.max_step_px)
            evidence = (curvature + np.float32(POLISH.min_evidence)) / (curvature + np.float32(POLISH.half_evidence))
            along = smoother.smoothed(moved, evidence * known, floor=POLISH.min_confidence)
    return along


def _with_slopes(gray: Plane, levels: NDArray[np.uint8], blur: float) -> Plane:
    """A blurred picture, its slopes across and down, and 1 where it shows something (h', w', 4)."""
    smooth = cv2.GaussianBlur(gray, (0, 0), blur)
    slopes = [cv2.Scharr(smooth, cv2.CV_32F, 1 - k, k, scale=1 / 32) for k in (0, 1)]
    together: Plane = cv2.merge([smooth, *slopes, (levels[..., 3] == 255).astype(np.float32)])
    return together


@dataclass(frozen=True)
class _Fetched:
    """Gray levels of each picture at the nodes (h, w), their slopes per px of a move, and where it shows something."""

    gray: list[Plane]
    slope: list[Plane]
    shown: list[NDArray[np.bool_]]

    @staticmethod
    def of(compared: Compared, sloped: list[Plane], along: Plane) -> _Fetched:
        """After moves (h, w) px."""
        d, gray, slope, shown = compared.at(along), [], [], []
        for seen, picture in zip(compared.seen, sloped, strict=True):
            level, across, down, alpha = cv2.split(sampled(picture, *seen.places(d)))
            x, y = seen.slopes(d)
            gray.append(level)
            slope.append((across * x + down * y) * compared.per_px)
            shown.append(alpha > 0.999)
        return _Fetched(gray, slope, shown)


def _equations(fetched: _Fetched, compared: Compared, hidden: list[NDArray[np.bool_]]) -> tuple[Plane, Plane]:
    """The normal equations (h, w) of the moves: gradient and curvature over windows."""
    best, best_slope, best_shown = (
        compared.best(values) for values in
        (fetched.gray, fetched.slope, [shown.astype(np.uint8) for shown in fetched.shown])
    )  # fmt: skip
    gradient, curvature = np.zeros((2, *best.shape), np.float32)
    for number, mask in enumerate(compared.masks):
        both = (best_shown > 0) & fetched.shown[number] & ~hidden[number] & (mask == 0)
        if not both.any():
            continue
        a, b, share = without_means(best, fetched.gray[number], both)
        gain = local_gain(a, b, share)
        residual = a - gain * b
        slope = gain * fetched.slope[number] - best_slope
        typical = float(np.median(np.abs(residual[both][::16])))
        half = np.float32(max(POLISH.min_half_residual, POLISH.half_residual_factor * typical))
        trust = both / (1 + np.square(residual / half))
        gradient += trust * slope * residual
        curvature += trust * slope * slope
    return mean(gradient, POLISH.window_px), mean(curvature, POLISH.window_px)
