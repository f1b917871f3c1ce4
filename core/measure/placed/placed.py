"""Pictures where a program has placed them on its panorama: what all programs' results are measured as."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...pictures.picture import Picture
from ...raster.arrays import Array, Part, bounds
from ...raster.picture_map import PictureMap
from .options import PLACED

# From places (N, 2) px of a panorama to unit rays (N, 3), in any frame.
RaysAt = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class PlacedPicture:
    """A picture on the canvas, before blending and exposure.

    Attributes
    ----------
    name : str
    colours : (h, w, 3) uint8 array
        What it shows in a box of the canvas, R, G, B.
    shows : (h, w) bool array
        Where.
    corner : (int, int)
        Canvas pixel (x, y) of the box's first.
    map : PictureMap or None
        Which px of the picture each pixel of the box shows; None where the program does not tell.
    """

    name: str
    colours: NDArray[np.uint8]
    shows: NDArray[np.bool_]
    corner: tuple[int, int]
    map: PictureMap | None = None

    @staticmethod
    def cut_out(
        name: str, colours: NDArray[np.uint8], shows: NDArray[np.bool_], found: PictureMap | None,
        corner: tuple[int, int] = (0, 0),
    ) -> PlacedPicture:  # fmt: skip
        """The box that holds all it shows, of a larger one at `corner`."""
        rows, columns = bounds(shows) or (slice(0, 0), slice(0, 0))
        box = (columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
        part = None if found is None else found.within(box)
        x, y = corner[0] + columns.start, corner[1] + rows.start
        return PlacedPicture(name, colours[rows, columns], shows[rows, columns], (x, y), part)

    def part_of(self, canvas: Part) -> Part:
        """Rows and columns of a part of the canvas, in its own box."""
        return tuple(  # type: ignore[return-value]
            slice(side.start - start, side.stop - start) for side, start in zip(canvas, self.corner[::-1], strict=True)
        )

    @property
    def box(self) -> Part:
        """Rows and columns of the canvas."""
        (x, y), (height, width) = self.corner, self.shows.shape
        return slice(y, y + height), slice(x, x + width)


@dataclass(frozen=True, eq=False)
class PlacedSet:
    """A program's panorama.

    Attributes
    ----------
    size : (W, H)
        px of the canvas.
    pictures : tuple of PlacedPicture
        Those that it uses.
    rays_at : callable or None
        From places (N, 2) px of the canvas to unit rays (N, 3); None where it is not known what surface it shows.
    alpha : (H, W) bool array
        Where the finished panorama shows something.
    px_per_radian : float
        In its middle; NaN where that is not known.
    """

    size: tuple[int, int]
    pictures: tuple[PlacedPicture, ...]
    rays_at: RaysAt | None
    alpha: NDArray[np.bool_]
    px_per_radian: float = float("nan")

    @cached_property
    def views_at(self) -> NDArray[np.int16]:
        """How many of the pictures show each pixel of the canvas (H, W)."""
        count = np.zeros(self.size[::-1], np.int16)
        for picture in self.pictures:
            count[picture.box] += picture.shows
        return count

    def used_of(self, pictures: Sequence[Picture]) -> list[Picture]:
        """Those of the pictures that were given that it uses, in its order."""
        by_name = {picture.name: picture for picture in pictures}
        return [by_name[one.name] for one in self.pictures]


def union(size: tuple[int, int], pictures: Sequence[PlacedPicture]) -> NDArray[np.bool_]:
    """Where (H, W) any of the pictures shows something."""
    shown = np.zeros(size[::-1], bool)
    for picture in pictures:
        shown[picture.box] |= picture.shows
    return shown


def shrinking(px_per_radian: float) -> float:
    """By how much a panorama is shrunk before it is measured: 1 where it is not finer than all are compared at."""
    return min(1.0, PLACED.px_per_radian / px_per_radian) if np.isfinite(px_per_radian) else 1.0


def shrunk(
    colours: NDArray[np.uint8], shows: NDArray[np.bool_], found: PictureMap | None, size: tuple[int, int]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], PictureMap | None]:
    """A picture on the canvas, all of it, at (W, H) px: it shows what it shows everywhere below a pixel."""
    if shows.shape == size[::-1]:
        return colours, shows, found
    small = np.asarray(cv2.resize(colours, size, interpolation=cv2.INTER_AREA), np.uint8)
    share = cv2.resize(shows.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    if found is not None:
        x, y = (cv2.resize(values, size, interpolation=cv2.INTER_LINEAR) for values in (found.x, found.y))
        found = PictureMap(np.asarray(x, np.float32), np.asarray(y, np.float32), found.size)
    return small, share > 1 - 1e-3, found
