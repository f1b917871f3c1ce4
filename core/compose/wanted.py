"""What an artist wants to see of a picture comes from it, wherever it shows that."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture
from ..raster.picture_map import CanvasMap
from .burnt_in import part_on_canvas


def wanted_on(pictures: Sequence[Picture], maps: Sequence[CanvasMap]) -> NDArray[np.int16] | None:
    """Which picture is wanted at each pixel of a canvas.

    Parameters
    ----------
    pictures : sequence of Picture
    maps : sequence of CanvasMap
        Where each is seen on the canvas.

    Returns
    -------
    (H, W) int16 array or None
        The number of the last of the pictures whose `wanted` lies there, −1 where none's does; None where no picture
        has any.
    """
    found: NDArray[np.int16] | None = None
    for number, (picture, one) in enumerate(zip(pictures, maps, strict=True)):
        if picture.wanted is None:
            continue
        here = part_on_canvas(one, picture.wanted)
        found = np.full(here.shape, -1, np.int16) if found is None else found
        found[here] = number
    return found
