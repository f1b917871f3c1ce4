"""What no picture shows of a whole sphere, filled smoothly: for light, not to be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import Array, Part, for_each_channel, within
from ..raster.distance import distance_to
from ..raster.lazy import AnyImage, LazyImage
from ..raster.pull_push import filled
from .options import SPHERE_FILL


def filled_sphere(panorama: Layer) -> Layer:
    """A whole equirectangular sphere without holes.

    Light goes on from the rim by pull and push, across ±180° too. Beyond it, it is averaged along rows over as many
    degrees as the rim is away, so that all meridians end in one colour at a pole.

    Parameters
    ----------
    panorama : Layer
        (H, W); what is shown stays as it is.

    Returns
    -------
    Layer
        Opaque, worked out where it is read.
    """
    step = max(1, round(panorama.alpha.shape[1] / SPHERE_FILL.columns))
    values, known = _coarse(panorama, step)
    columns = known.shape[1]
    turned = [np.concatenate([one[:, columns // 2 :], one, one[:, : columns // 2]], axis=1) for one in (values, known)]
    middle = slice(columns - columns // 2, 2 * columns - columns // 2)
    out = filled(turned[0], turned[1])[:, middle]
    away = distance_to(turned[1] > 0)[:, middle] if known.any() else np.zeros(known.shape)
    return Layer(_Filled(panorama, _along_rows(out, away), step), np.ones(panorama.alpha.shape, bool))


def _coarse(panorama: Layer, step: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Means (h, w, C) over cells of step × step px of what is shown, and how much of each cell (h, w) is."""
    height, width = panorama.alpha.shape
    rows, columns = -(-height // step), -(-width // step)
    values = np.zeros((rows, columns, panorama.light.shape[2]), np.float32)
    known = np.zeros((rows, columns), np.float32)
    starts = np.arange(0, width, step)
    for row in range(rows):
        part = slice(row * step, min(height, (row + 1) * step)), slice(0, width)
        alpha = panorama.alpha[part].astype(np.float32)
        light = panorama.light[part] * for_each_channel(alpha, values.shape[2])
        sums = np.add.reduceat(alpha.sum(axis=0), starts)
        known[row] = sums / step**2
        light_sums = np.add.reduceat(light.sum(axis=0), starts, axis=0)
        values[row] = light_sums / np.maximum(sums, SPHERE_FILL.least_shown)[:, None]
    return values, np.minimum(known, 1)


def _along_rows(values: NDArray[np.float32], away: Array) -> NDArray[np.float32]:
    """Values (h, w, C) averaged along their rows, over as far on the sphere to both sides as the rim is `away` (h, w),
    in cells."""
    rows, columns = away.shape
    shrinks = np.sin(np.pi * (np.arange(rows) + 0.5) / rows)
    out, here = values.copy(), np.arange(columns)
    for row in np.flatnonzero(away.any(axis=1)):
        half = np.minimum(away[row] / shrinks[row], (columns - 1) // 2).astype(np.intp)
        sums = np.cumsum(np.concatenate([values[row]] * 3), axis=0, dtype=np.float64)
        last, before = columns + here + half, columns + here - half - 1
        out[row] = (sums[last] - sums[before]) / (2 * half + 1)[:, None]
    return out


@dataclass(frozen=True, eq=False)
class _Filled(LazyImage):
    """The light of a panorama, and where it is transparent that of cells (h, w, C) of step × step px."""

    panorama: Layer
    cells: NDArray[np.float32]
    step: int

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        light: AnyImage = self.panorama.light
        return light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        light, alpha = self.panorama.light[rows, columns], self.panorama.alpha[rows, columns].astype(np.float32)
        if alpha.min() >= 1:
            return light
        closed = np.pad(self.cells, ((0, 0), (1, 1), (0, 0)), mode="wrap")
        bordered = np.pad(closed, ((1, 1), (0, 0), (0, 0)), mode="edge")
        x, y = (
            ((np.arange(one.start, one.stop) + 0.5) / self.step + 0.5).astype(np.float32) for one in (columns, rows)
        )
        fill = cv2.remap(bordered, *np.meshgrid(x, y), cv2.INTER_LINEAR).reshape(light.shape)
        weight = for_each_channel(alpha, light.shape[2])
        out: NDArray[np.float32] = light * weight + fill * (1 - weight)
        return out
