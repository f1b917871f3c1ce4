"""Which part of the panorama is kept: all of it, what is full everywhere, the reference's frame, or a given box."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..choices import CROPS, Crop
from ..raster.arrays import Box
from ..system.errors import BadRequest


def parse_crop(text: str) -> Crop:
    """One of CROPS, or (X, Y, W, H), from the command line's word. Raises BadRequest."""
    if text in CROPS:
        return text
    try:
        left, top, width, height = (int(part) for part in text.split(","))
    except ValueError:
        raise BadRequest(
            f"the crop {text!r} is not known; choose from: {', '.join(CROPS)}, or give X,Y,W,H in whole pixels"
        ) from None
    if width < 1 or height < 1:
        raise BadRequest(f"the crop {text} is empty: width and height, its last two numbers, must be 1 or more")
    return left, top, width, height


def crop_box(kind: Crop, whole: Box, shows: NDArray[np.bool_], reference_box: Box) -> Box:
    """The part of the panorama that is kept.

    Parameters
    ----------
    kind : Crop
        One of CROPS, or (x, y, width, height) in px of the whole panorama.
    whole : Box
        The whole panorama in canvas px (see `Canvas.whole`).
    shows : (H, W) bool array
        Where the canvas shows something.
    reference_box : Box
        Where the reference lies, canvas px.

    Returns
    -------
    Box
        left, top, width, height in canvas px.

    Raises
    ------
    BadRequest
        The kind is not known, the panorama shows nothing, or a box reaches outside it or lies beside both pictures.
    """
    left, top, width, height = whole
    if kind == "full":
        return whole
    if kind == "reference":
        return reference_box
    if kind == "inscribed":
        return largest_rectangle(shows)
    if isinstance(kind, str) or len(kind) != 4:
        raise BadRequest(f"the crop {kind!r} is not known; choose from: {', '.join(CROPS)}, or give X, Y, W, H in px")
    x, y, w, h = kind
    if w < 1 or h < 1 or x < 0 or y < 0 or x + w > width or y + h > height:
        raise BadRequest(
            f"the crop {x},{y},{w},{h} (X,Y,W,H) is not a part of the panorama, which has {width}×{height} pixels: X "
            f"and Y from 0, X + W at most {width}, Y + H at most {height}"
        )
    x, y = x + left, y + top
    if not shows[max(0, y) : max(0, y + h), max(0, x) : max(0, x + w)].size:
        raise BadRequest(f"the crop {x - left},{y - top},{w},{h} (X,Y,W,H) lies beside both pictures")
    return x, y, w, h


def largest_rectangle(shows: NDArray[np.bool_]) -> Box:
    """The largest axis-parallel rectangle (left, top, width, height) of True pixels of a mask (H, W).

    Exact; of equals the one that ends first, from the top, then from the left. Raises BadRequest where nothing is True.
    """
    height, width = shows.shape
    column = np.arange(width, dtype=np.int64)
    # For each pixel of a row: how far its column is True upwards, and how far a rectangle of that height can be
    # widened. The largest rectangle is found from some pixel of its last row; each step works on a whole row at once.
    up, left, right = np.zeros(width, np.int64), np.zeros(width, np.int64), np.full(width, width, np.int64)
    best, box = 0, (0, 0, 0, 0)
    for row, here in enumerate(shows):
        row_left = np.maximum.accumulate(np.where(here, 0, column + 1))
        row_right = np.minimum.accumulate(np.where(here, width, column)[::-1])[::-1]
        up = np.where(here, up + 1, 0)
        left = np.where(here, np.maximum(left, row_left), 0)
        right = np.where(here, np.minimum(right, row_right), width)
        area = up * (right - left)
        at = int(area.argmax())
        if area[at] > best:
            best = int(area[at])
            box = (int(left[at]), row + 1 - int(up[at]), int(right[at] - left[at]), int(up[at]))
    if not best:
        raise BadRequest("the panorama shows nothing that a crop could keep")
    return box
