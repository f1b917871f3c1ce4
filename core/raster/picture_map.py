"""Where the pixels of a canvas are seen in one picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .arrays import Box, cut, cut_in_place


class CanvasMap(Protocol):
    """The map of a canvas to one picture, as arrays or worked out where it is asked for."""

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) px of the picture."""
        ...

    def arrays(self) -> PictureMap:
        """The map as arrays."""
        ...

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the map falls inside the picture."""
        ...

    def within(self, box: Box, in_place: bool = False) -> CanvasMap:
        """The part in a box (left, top, width, height) of the canvas, see `PictureMap.within`."""
        ...


@dataclass(frozen=True)
class PictureMap:
    """x, y (H, W) float32: raw pixel of a picture that each canvas pixel shows, also where it falls outside; NaN behind
    its camera. size (W, H): px of the picture."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    size: tuple[int, int]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W) of the canvas."""
        return self.x.shape

    def arrays(self) -> PictureMap:
        """The map as arrays: this one."""
        return self

    def inside(self) -> NDArray[np.bool_]:
        """Where (H, W) the map falls inside the picture."""
        return falls_inside(self.x, self.y, self.size)

    def within(self, box: Box, in_place: bool = False) -> PictureMap:
        """The part in a box (left, top, width, height) of the canvas; NaN where that reaches over its edges.

        in_place: the box lies on the canvas, and the whole, whose memory the part takes, is lost.
        """
        x, y = (cut_in_place(values, box) if in_place else cut(values, box, np.nan) for values in (self.x, self.y))
        return PictureMap(x, y, self.size)


def falls_inside(x: NDArray[Any], y: NDArray[Any], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Where pixels x, y (…) lie inside a picture of (W, H) px; NaN lies outside."""
    with np.errstate(invalid="ignore"):
        return (x >= 0) & (y >= 0) & (x <= size[0] - 1) & (y <= size[1] - 1)
