"""By how much a picture is expected to be misplaced on the canvas, and in which order pictures are added.

Where inverse range d is wrong by δ, what a camera at c sees comes to lie

    f |c − b (b · c)| δ   px of the canvas

from its place, with f px of the canvas per radian, b the direction from c to the point, and c counted from where the
canvas is seen from. A picture that was taken there is never misplaced; one from further away is last choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..cameras.projective import inverse_intrinsics
from ..cameras.view import View
from ..panorama.layers import Layer
from ..raster.arrays import Array, Part, Plane
from ..raster.lazy import AnyImage
from .options import PLACING
from .window import Window

if TYPE_CHECKING:
    from ..panorama.warp import Warp


@dataclass(frozen=True)
class Placing:
    """Says how far pictures are misplaced; with a deviation of 1 where the warp knows none, which tells the order."""

    warp: Warp
    views: Sequence[View]

    def at(self, number: int, part: Part, step: int = 1) -> Plane:
        """Expected misplacement (h, w) of a picture in rows and columns of the canvas, every so many px, in px."""
        canvas, warp = self.warp.canvas, self.warp
        off = self._off(number, canvas.xs[part[1]][::step], canvas.ys[part[0]][::step], _every(step, warp.depth, part))
        return off if warp.deviation is None else off * _every(step, warp.deviation, part)

    def _off(self, number: int, xs: Array, ys: Array, d: Plane) -> Plane:
        """The same at columns xs and lines ys, px of the plane, where inverse range (h, w) is wrong by 1."""
        canvas, view = self.warp.canvas, self.views[number]
        focal = self.views[0].K[0, 0] if canvas.projection is None else canvas.projection.focal
        rays = np.stack(
            canvas.project_rows(inverse_intrinsics(self.views[0].K), xs, ys, self.views[0].camera), axis=-1
        ).astype(np.float32)
        beside = (-view.R.T @ view.t).astype(np.float32) * np.ones_like(rays)
        if self.warp.viewpoint is not None:
            beside -= self.warp.viewpoint.place(rays)
        towards = rays - np.nan_to_num(d)[..., None] * beside
        towards /= np.maximum(np.linalg.norm(towards, axis=-1, keepdims=True), np.float32(1e-6))
        across = beside - towards * (towards * beside).sum(axis=-1, keepdims=True)
        off: Plane = np.linalg.norm(across, axis=-1) * np.float32(focal)
        return off

    def mean(self, number: int, layer: Layer, window: Window) -> float:
        """Mean over what a picture shows, which lies in a window."""
        step = max(1, int(np.sqrt(window.shape[0] * window.shape[1] / PLACING.samples)))
        off, shown = (
            np.concatenate([values.ravel() for values in some])
            for some in zip(
                *((self.at(number, there, step), layer.alpha[there][::step, ::step] > 0) for there, _ in window.parts),
                strict=True,
            )
        )
        return float(off[shown].mean()) if shown.any() else 0.0


def adding_order(placing: Placing, layers: Sequence[Layer], windows: Sequence[Window | None]) -> list[int]:
    """Numbers of the pictures that show something in windows, the one that is placed best first; of equal ones the one
    that comes first."""
    means = {
        number: placing.mean(number, layer, window)
        for number, (layer, window) in enumerate(zip(layers, windows, strict=True)) if window is not None
    }
    return sorted(means, key=lambda number: (means[number], number))


def _every(step: int, values: AnyImage, part: Part) -> Plane:
    """Values of rows and columns, every so many px; lines in between are not read, unless there are so few that all of
    them take less time than one after the other."""
    rows, columns = part
    if (rows.stop - rows.start) * (columns.stop - columns.start) <= PLACING.whole_px:
        return np.asarray(values[rows, columns])[::step, ::step]
    return np.concatenate([np.asarray(values[row : row + 1, columns]) for row in range(rows.start, rows.stop, step)])[
        :, ::step
    ]
