"""What is burnt into a picture is left out where another picture shows the place, and shown where none does: a date
is better than a hole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture
from ..raster.picture_map import CanvasMap


def shown_where_alone(pictures: Sequence[Picture], maps: Sequence[CanvasMap]) -> tuple[Picture, ...]:
    """The pictures with what is burnt in opaque again where no other one shows the place.

    Parameters
    ----------
    pictures : sequence of Picture
        Transparent where something is burnt in.
    maps : sequence of CanvasMap
        Where each is seen on the canvas.

    Returns
    -------
    tuple of Picture
        Those of which nothing is left out as they are.
    """
    if all(picture.burnt_in is None for picture in pictures):
        return tuple(pictures)
    shown = [part_on_canvas(one, _opaque(picture)) for picture, one in zip(pictures, maps, strict=True)]
    found = []
    for picture, one in zip(pictures, maps, strict=True):
        if picture.burnt_in is None or picture.alpha is None:
            found.append(picture)
            continue
        alone = part_on_canvas(one, picture.burnt_in) & ~np.logical_or.reduce(shown)
        again = _in_picture(alone, one, picture.burnt_in)
        found.append(replace(picture, alpha=np.where(again, np.float32(1), picture.alpha)))
    return tuple(found)


def _opaque(picture: Picture) -> NDArray[np.bool_] | None:
    return None if picture.alpha is None else picture.alpha > 0


def part_on_canvas(one: CanvasMap, mask: NDArray[np.bool_] | None) -> NDArray[np.bool_]:
    """Where (H, W) the canvas shows a part of a picture; None: all of it."""
    inside = one.inside()
    if mask is None:
        return inside
    row, column = _places(one, inside)
    part = inside.copy()
    part[inside] = mask[row, column]
    return part


def _places(one: CanvasMap, where: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (N,) of the picture's pixels that some pixels of the canvas show."""
    arrays, (width, height) = one.arrays(), one.size
    row = np.clip(np.rint(arrays.y[where]), 0, height - 1).astype(np.intp)
    return row, np.clip(np.rint(arrays.x[where]), 0, width - 1).astype(np.intp)


def _in_picture(alone: NDArray[np.bool_], one: CanvasMap, burnt_in: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same in the picture (h, w), closed where its pixels lie between those of the canvas."""
    marked = np.zeros(burnt_in.shape, np.uint8)
    marked[_places(one, alone)] = 1
    closed = cv2.dilate(marked, np.ones((3, 3), np.uint8), iterations=2) > 0
    again: NDArray[np.bool_] = closed & burnt_in
    return again
