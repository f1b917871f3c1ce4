"""Edge-aware smoothing by a guide picture: the fast global smoother.

Minimises Σ (u − f)² + λ Σ w (∇u)² approximately, by tridiagonal systems along rows and columns in turn: Min, Choi, Lu,
Ham, Sohn and Do, "Fast global image smoothing based on weighted least squares", IEEE TIP 2014.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .options import SMOOTHING

Weights = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Connections of neighbours along rows (H, W−1) and columns (H−1, W)."""


def edge_weights(guide: NDArray[np.float32], sigma: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Weights exp(−|difference| / σ) between neighbours along rows (H, W−1) and along columns (H−1, W) of a guide
    (H, W[, C]); the difference is the largest of the channels', sigma in the guide's levels."""
    across, down = 0.0, 0.0
    for plane in cv2.split(guide):
        across = np.maximum(across, cv2.absdiff(plane[:, 1:], plane[:, :-1]))
        down = np.maximum(down, cv2.absdiff(plane[1:], plane[:-1]))
    return np.exp(across / np.float32(-sigma)), np.exp(down / np.float32(-sigma))


def cut_edges(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]],
    values: NDArray[np.float32],
    known: NDArray[np.bool_],
    step: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The weights, lowered where values (H, W), known (H, W) on both sides, jump by `step` or more, if the guide has an
    edge within a few pixels as well: a jump in the middle of a uniform surface is an error of the values."""
    out = []
    for axis, weight in zip((1, 0), weights, strict=True):
        both_known = known.take(range(1, known.shape[axis]), axis) & known.take(range(known.shape[axis] - 1), axis)
        jump = np.square(np.abs(np.diff(values, axis=axis)) * both_known / np.float32(step))
        edge = 1 - cv2.erode(weight, np.ones((SMOOTHING.edge_reach_px,) * 2, np.uint8))
        out.append(weight / (1 + jump * edge))
    return out[0], out[1]


def strengthen(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], plain: NDArray[np.float32], strength: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The weights, raised between neighbours without texture: about 1 + `strength` times where plain (H, W) is ½, more
    (to a bound) where it is 1, unchanged where it is 0."""
    odds = plain / (1 - plain + np.float32(1 / SMOOTHING.max_plain_odds))
    across, down = (odds[:, 1:] + odds[:, :-1]) / 2, (odds[1:] + odds[:-1]) / 2
    return weights[0] * (1 + np.float32(strength) * across), weights[1] * (1 + np.float32(strength) * down)


@dataclass(frozen=True)
class Smoother:
    """Smoothing with fixed weights and λ, factored once to be used several times: rows and columns of each pass."""

    passes: tuple[tuple[_Systems, _Systems], ...]

    @staticmethod
    def of(
        weights: tuple[NDArray[np.float32], NDArray[np.float32]], strength: float, passes: int = SMOOTHING.passes
    ) -> Smoother:
        """weights: see `edge_weights`; strength: λ; passes: times that rows and columns are smoothed."""
        share = 1.5 * SMOOTHING.attenuation ** (passes - 1) / (SMOOTHING.attenuation**passes - 1)
        across = cv2.transpose(weights[0])
        lam = [np.float32(strength * share / SMOOTHING.attenuation**number) for number in range(passes)]
        return Smoother(tuple((_Systems.of(each * across), _Systems.of(each * weights[1])) for each in lam))

    def smoothed(
        self, values: NDArray[np.float32], confidence: NDArray[np.float32], floor: float = 1e-6
    ) -> NDArray[np.float32]:
        """Smoothed values (H, W), each weighted by its confidence (H, W); gaps (confidence 0) are filled from around.

        Weighted values and confidences are smoothed alike and divided; floor: confidence of the value 0 everywhere.
        """
        sums, total = self.averaged((values * confidence, confidence))
        return sums / (total + np.float32(floor))

    def averaged(self, planes: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
        """Planes (H, W), all values of which count alike, smoothed at once."""
        for rows, columns in self.passes:
            height, width = planes[0].shape
            transposed = np.empty((width, len(planes), height), np.float32)
            for k, plane in enumerate(planes):
                transposed[:, k] = cv2.transpose(plane)
            rows.solve(transposed)
            layers = np.empty((height, len(planes), width), np.float32)
            for k in range(len(planes)):
                layers[:, k] = cv2.transpose(transposed[:, k])
            columns.solve(layers)
            planes = list(np.moveaxis(layers, 1, 0))
        return list(planes)


@dataclass(frozen=True)
class _Systems:
    """m tridiagonal systems (1 + w₋ + w₊) u − w₋ u₋ − w₊ u₊ = f along the first axis, by Thomas's algorithm.

    Factors L D Lᵀ: ratio (n−1, m), minus the subdiagonal of L; inverse (n, m), of D.
    """

    ratio: NDArray[np.float32]
    inverse: NDArray[np.float32]

    @staticmethod
    def of(weight: NDArray[np.float32]) -> _Systems:
        """The systems of weights w (n−1, m)."""
        count = weight.shape[0] + 1
        ratio, inverse = np.empty_like(weight), np.empty((count, weight.shape[1]), np.float32)
        rest = np.ones(weight.shape[1], np.float32)  # D without the weight to the next pixel
        for i in range(count - 1):
            np.add(rest, weight[i], out=inverse[i])
            np.divide(1, inverse[i], out=inverse[i])
            np.multiply(weight[i], inverse[i], out=ratio[i])
            # 1 + w − w²/D, written as 1 + rest · w/D: no difference of large numbers
            np.multiply(rest, ratio[i], out=rest)
            rest += 1
        np.divide(1, rest, out=inverse[-1])
        return _Systems(ratio, inverse)

    def solve(self, f: NDArray[np.float32]) -> None:
        """Replaces right-hand sides f (n, k, m), k for each system, by the solutions."""
        product = np.empty(f.shape[1:], np.float32)
        lines, ratio, inverse = list(f), list(self.ratio), list(self.inverse)
        for i in range(1, len(lines)):
            np.multiply(lines[i - 1], ratio[i - 1], out=product)
            np.add(lines[i], product, out=lines[i])
        np.multiply(lines[-1], inverse[-1], out=lines[-1])
        for i in range(len(lines) - 2, -1, -1):
            np.multiply(lines[i], inverse[i], out=lines[i])
            np.multiply(lines[i + 1], ratio[i], out=product)
            np.add(lines[i], product, out=lines[i])
