"""Which part of the panorama is kept: all of it, what is full everywhere, the reference's frame, or a given box.

"auto" keeps what is full everywhere if that is most of what is shown, else the smallest box of all that is shown.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..choices import CROPS, Crop
from ..raster.arrays import Box, box_of
from ..raster.rectangle import largest_rectangle
from ..system.errors import BadRequest
from .options import CROP


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


def crop_box(
    kind: Crop, whole: Box, shows: NDArray[np.bool_], reference_box: Box | None, pictures: int = 2
) -> Box:
    """The part of the panorama that is kept.

    Parameters
    ----------
    kind : Crop
        One of CROPS, or (x, y, width, height) in px of the whole panorama.
    whole : Box
        The whole panorama in canvas px (see `Canvas.whole`).
    shows : (H, W) bool array
        Where the canvas shows something.
    reference_box : Box or None
        Where the reference lies, canvas px; None if it lies beside the canvas.
    pictures : int
        How many there are.

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
        if reference_box is None:
            raise BadRequest("the reference lies outside the frame: leave centre and fov out, or choose another crop")
        return reference_box
    if kind in ("auto", "inscribed"):
        if not shows.any():
            raise BadRequest("the panorama shows nothing that a crop could keep")
        box = largest_rectangle(shows)
        least = CROP.least_kept if pictures == 2 else CROP.least_kept_of_many
        keeps = kind == "inscribed" or box[2] * box[3] >= least * np.count_nonzero(shows)
        return box if keeps else box_of(shows)
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
