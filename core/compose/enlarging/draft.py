"""A panorama that was decided at a fraction of its size: which picture each pixel comes from, and in which light.

A large set at its own size would take more memory than machines have. So its seams, its exposure and what is hidden are
decided on pictures that are shrunk by a whole number, like a smaller set's. What blending changes there is kept as a
change of tones, to be made to the full pictures: as if coarse bands were blended and the finest ones cut hard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...options import StitchOptions
from ...raster.arrays import bounds
from ...raster.lazy import AnyImage
from ...raster.log_encoding import log_encode
from ..options import BANDS
from .options import DRAFT

if TYPE_CHECKING:
    from ...panorama.warp import Warp
    from ..composition import Composition
    from ..tone.exposure import Exposure


@dataclass(frozen=True, eq=False)
class Draft:
    """A panorama of small pictures.

    Attributes
    ----------
    times : int
        How many px of the full panorama, and of the full pictures, lie along one of these.
    warp : Warp
        To the small pictures.
    exposures : tuple of Exposure
        What is done to the light of each.
    labels : (h, w) int16 array
        Which picture each pixel comes from, −1 for none.
    changes : (h, w, C) float32 array
        What blending adds to the tones of that picture, with its exposure matched.
    light : (h, w, C) image
        The panorama's.
    filled : (h, w) bool array
        What no picture shows and was filled.
    """

    times: int
    warp: Warp
    exposures: tuple[Exposure, ...]
    labels: NDArray[np.int16]
    changes: NDArray[np.float32]
    light: AnyImage
    filled: NDArray[np.bool_]

    @staticmethod
    def of(made: Composition, warp: Warp, times: int) -> Draft:
        """The draft of a composition with a seam, on the canvas of a warp."""
        if made.labels is None:
            raise ValueError("only what is cut along seams can be enlarged")
        light, changes = made.panorama.light, np.zeros(made.panorama.light.shape, np.float32)
        for number, layer in enumerate(made.exposed):
            chosen = made.labels == number
            part = bounds(chosen)
            if part is None:
                continue
            here = chosen[part]
            change = log_encode(light[part][here]) - log_encode(layer.light[part][here])
            change[np.abs(change) < BANDS.negligible_tone] = 0
            changes[part][here] = change
        exposures = tuple(one.exposure for one in made.decided)
        return Draft(times, warp, exposures, made.labels, changes, light, made.filled)


def draft_times(sizes: Sequence[tuple[int, int]], options: StitchOptions) -> int:
    """By how many times pictures of (W, H) px are shrunk to decide about their panorama: a power of two, which depends
    on nothing but them and the options; 1 where they fit, or where the outcome is no cut along seams."""
    if len(sizes) == 2 or options.blend != "multiband" or options.surface[0] == "reference":
        return 1
    times, total = 1, sum(width * height for width, height in sizes)
    while times < DRAFT.most_times and total > DRAFT.most_pixels * times**2:
        times *= 2
    return times
