"""What is smooth is worked out at a few places, and interpolated between them."""

from __future__ import annotations

import cv2
import numpy as np

from .arrays import Array, Plane

COARSE_STEP = 2
"""Rows and columns between such places, unless another step is asked for."""


def coarse_places(shape: tuple[int, ...], step: int = COARSE_STEP) -> tuple[Array, Array]:
    """x and y of the centres of cells of `step` px a side, over a picture of `shape` (rows, columns) and one cell
    around it, in its pixels."""
    rows, columns = ((np.arange(-1, -(-count // step) + 1) + 0.5) * step - 0.5 for count in shape[:2])
    return columns, rows


def in_between(shape: tuple[int, ...], coarse: Array, step: int = COARSE_STEP) -> list[Plane]:
    """k planes (rows, columns), bilinear between the values (m, n, k) of a smooth function at `coarse_places`.

    NaN spreads by one cell.
    """
    size = step * coarse.shape[1], step * coarse.shape[0]
    part = slice(step, step + shape[0]), slice(step, step + shape[1])
    return [
        cv2.resize(coarse[..., k].astype(np.float32), size, interpolation=cv2.INTER_LINEAR)[part]
        for k in range(coarse.shape[-1])
    ]
