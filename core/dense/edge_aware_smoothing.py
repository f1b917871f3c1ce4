"""Smoothing that stops at the edges of a guiding picture: the fast global smoother.

Min, Choi, Lu, Ham, Sohn and Do, "Fast global image smoothing based on weighted least squares", IEEE TIP 2014:
Σ (u − f)² + λ Σ w (∇u)² by tridiagonal systems along rows and columns in turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .options import SMOOTHING


def edge_weights(guide: NDArray[np.float32], sigma: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """exp(−|difference| / σ) between neighbours along rows (H, W−1) and columns (H−1, W) of a guide (H, W[, C])."""
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
    """The weights, lowered where known values (H, W) of neighbours differ by more than about `step`, if the guide has
    an edge there too (within a few pixels): a jump in the middle of a plain surface is an error."""
    out = []
    for axis, weight in zip((1, 0), weights, strict=True):
        both = known.take(range(1, known.shape[axis]), axis) & known.take(range(known.shape[axis] - 1), axis)
        jump = np.square(np.abs(np.diff(values, axis=axis)) * both / np.float32(step))
        edge = 1 - cv2.erode(weight, np.ones((SMOOTHING.edge_reach_px,) * 2, np.uint8))
        out.append(weight / (1 + jump * edge))
    return out[0], out[1]


def strengthen(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], plain: NDArray[np.float32], strength: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The weights, stronger between neighbours with little texture: 1 + `strength` times at plain (H, W) = ½, and
    more, to a bound, at 1."""
    odds = plain / (1 - plain + np.float32(1 / SMOOTHING.max_plain_odds))
    across, down = (odds[:, 1:] + odds[:, :-1]) / 2, (odds[1:] + odds[:-1]) / 2
    return weights[0] * (1 + np.float32(strength) * across), weights[1] * (1 + np.float32(strength) * down)


@dataclass(frozen=True)
class Smoother:
    """Smoothing with λ = strength by the same weights, again and again: what the systems need of them."""

    passes: tuple[tuple[_Systems, _Systems], ...]

    @staticmethod
    def of(weights: tuple[NDArray[np.float32], NDArray[np.float32]], strength: float) -> Smoother:
        """weights: see `edge_weights`."""
        share = 1.5 * SMOOTHING.attenuation ** (SMOOTHING.passes - 1) / (SMOOTHING.attenuation**SMOOTHING.passes - 1)
        across = cv2.transpose(weights[0])
        lam = [np.float32(strength * share / SMOOTHING.attenuation**number) for number in range(SMOOTHING.passes)]
        return Smoother(tuple((_Systems.of(each * across), _Systems.of(each * weights[1])) for each in lam))

    def smoothed(
        self, values: NDArray[np.float32], confidence: NDArray[np.float32], floor: float = 1e-6
    ) -> NDArray[np.float32]:
        """values (H, W), each counting by its confidence (H, W); what there is none in is filled from its surroundings.

        floor: confidence that 0 has everywhere.
        """
        upright = values * confidence, confidence
        for rows, columns in self.passes:
            height, width = values.shape
            turned = np.empty((width, 2, height), np.float32)
            for k in (0, 1):
                turned[:, k] = cv2.transpose(upright[k])
            rows.solve(turned)
            layers = np.empty((height, 2, width), np.float32)
            for k in (0, 1):
                layers[:, k] = cv2.transpose(turned[:, k])
            columns.solve(layers)
            upright = layers[:, 0], layers[:, 1]
        return upright[0] / (upright[1] + np.float32(floor))


@dataclass(frozen=True)
class _Systems:
    """(1 + w₋ + w₊) u − w₋ u₋ − w₊ u₊ = f along the first axis, for weights (n−1, m): Thomas's algorithm, all m lines
    at once. ratio (n−1, m), inverse (n, m): of the factors L D Lᵀ."""

    ratio: NDArray[np.float32]
    inverse: NDArray[np.float32]

    @staticmethod
    def of(weight: NDArray[np.float32]) -> _Systems:
        count = weight.shape[0] + 1
        ratio, inverse = np.empty_like(weight), np.empty((count, weight.shape[1]), np.float32)
        left = np.ones(weight.shape[1], np.float32)  # of a pixel's own share what the one before has not taken
        for i in range(count - 1):
            np.add(left, weight[i], out=inverse[i])
            np.divide(1, inverse[i], out=inverse[i])
            np.multiply(weight[i], inverse[i], out=ratio[i])
            # 1 + w − w²/D as 1 + w (1 − w/D): no difference of large numbers
            np.multiply(left, ratio[i], out=left)
            left += 1
        np.divide(1, left, out=inverse[-1])
        return _Systems(ratio, inverse)

    def solve(self, f: NDArray[np.float32]) -> None:
        """Of layers f (n, k, m), in place."""
        before = np.empty(f.shape[1:], np.float32)
        lines, ratio, inverse = list(f), list(self.ratio), list(self.inverse)
        for i in range(1, len(lines)):
            np.multiply(lines[i - 1], ratio[i - 1], out=before)
            np.add(lines[i], before, out=lines[i])
        np.multiply(lines[-1], inverse[-1], out=lines[-1])
        for i in range(len(lines) - 2, -1, -1):
            np.multiply(lines[i], inverse[i], out=lines[i])
            np.multiply(lines[i + 1], ratio[i], out=before)
            np.add(lines[i], before, out=lines[i])
