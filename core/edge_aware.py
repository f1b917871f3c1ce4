"""Smoothing that stops at the edges of a guiding picture: the fast global smoother.

Min, Choi, Lu, Ham, Sohn and Do, "Fast global image smoothing based on weighted least squares", IEEE TIP 2014:
Σ (u − f)² + λ Σ w (∇u)² by tridiagonal systems along rows and columns in turn.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

# Attenuation of λ from pass to pass (the paper's eq. 11 for its three passes).
PASSES, ATTENUATION = 3, 4.0
# An edge of the guide is known to so many pixels.
NEAR = 7
MOST = 20.0


def edge_weights(guide: NDArray[np.float32], sigma: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """exp(−|difference| / σ) between neighbours along rows (H, W−1) and columns (H−1, W) of a guide (H, W[, C])."""
    guide = guide if guide.ndim == 3 else guide[..., None]
    across, down = (np.abs(np.diff(guide, axis=axis)).max(axis=2) for axis in (1, 0))
    return np.exp(across / np.float32(-sigma)), np.exp(down / np.float32(-sigma))


def broken(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], values: NDArray[np.float32], known: NDArray[np.bool_],
    step: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The weights, lowered where known values (H, W) of neighbours differ by more than about `step`, if the guide has
    an edge there too (within NEAR pixels): a jump in the middle of a plain surface is an error."""
    out = []
    for axis, weight in zip((1, 0), weights, strict=True):
        both = known.take(range(1, known.shape[axis]), axis) & known.take(range(known.shape[axis] - 1), axis)
        jump = np.square(np.abs(np.diff(values, axis=axis)) * both / np.float32(step))
        edge = 1 - cv2.erode(weight, np.ones((NEAR, NEAR), np.uint8))
        out.append(weight / (1 + jump * edge))
    return out[0], out[1]


def tied(
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], plain: NDArray[np.float32], strength: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The weights, stronger between neighbours that tell little: 1 + `strength` times at plain (H, W) = ½, up to MOST
    times that at 1."""
    odds = plain / (1 - plain + np.float32(1 / MOST))
    across, down = (odds[:, 1:] + odds[:, :-1]) / 2, (odds[1:] + odds[:-1]) / 2
    return weights[0] * (1 + np.float32(strength) * across), weights[1] * (1 + np.float32(strength) * down)


def smoothed(
    values: NDArray[np.float32], confidence: NDArray[np.float32],
    weights: tuple[NDArray[np.float32], NDArray[np.float32]], strength: float, floor: float = 1e-6,
) -> NDArray[np.float32]:
    """values (H, W) smoothed with λ = strength, each counting by its confidence (H, W); what there is none in is filled
    from its surroundings.

    floor: confidence that 0 has everywhere.
    """
    layers = np.stack([values * confidence, confidence], axis=0).astype(np.float32)
    share = 1.5 * ATTENUATION ** (PASSES - 1) / (ATTENUATION**PASSES - 1)
    across = np.ascontiguousarray(weights[0].T)
    for number in range(PASSES):
        lam = np.float32(strength * share / ATTENUATION**number)
        layers = _along_last(layers.transpose(0, 2, 1), lam * across).transpose(0, 2, 1)
        layers = _along_last(layers, lam * weights[1])
    return layers[0] / (layers[1] + np.float32(floor))


def _along_last(layers: NDArray[np.float32], weight: NDArray[np.float32]) -> NDArray[np.float32]:
    """Solves (1 + w₋ + w₊) u − w₋ u₋ − w₊ u₊ = f along axis 1 of layers (k, n, m), weight (n−1, m): Thomas's
    algorithm, all lines at once."""
    count = layers.shape[1]
    f = np.ascontiguousarray(layers.transpose(1, 0, 2))
    ratio = np.empty_like(weight)
    denominator = 1 + weight[0]
    f[0] /= denominator
    for i in range(1, count):
        ratio[i - 1] = weight[i - 1] / denominator
        denominator = 1 + weight[i - 1] - weight[i - 1] * ratio[i - 1]
        if i < count - 1:
            denominator += weight[i]
        f[i] += weight[i - 1] * f[i - 1]
        f[i] /= denominator
    for i in range(count - 2, -1, -1):
        f[i] += ratio[i] * f[i + 1]
    return f.transpose(1, 0, 2)
