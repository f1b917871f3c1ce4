"""How right the radiance is that exposures of one view were merged to, picture by picture, against Blender's light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.pictures.picture import load_picture
from .set_measures import Found

# Stops below the brightest that the median is taken over: the project's aim.
RANGE_STOPS = 12.0
# A stop counts as held where half of its values are right to within this share, and where there are so many.
HELD, LEAST = 0.1, 100


def radiance_figures(found: Found) -> dict[str, float]:
    """radiance_percent: by how much the values of merged pictures are off, median over what lies within RANGE_STOPS of
    the brightest; radiance_stops: from the darkest stop to the brightest that are held. None where nothing was
    merged."""
    rendered = found.truth.rendered
    if not rendered.brackets:
        return {}
    ours, true = (np.concatenate(parts) for parts in zip(*(
        (picture.pixels.ravel(), load_picture(rendered.pictures[number].with_suffix(".exr")).pixels.ravel())
        for picture, number in zip(found.result.pictures, found.numbers, strict=True)
    ), strict=True))  # fmt: skip
    return radiance_error(ours, true)


def radiance_error(ours: NDArray[np.float32], true: NDArray[np.float32]) -> dict[str, float]:
    """The same of values (N,)."""
    lit = true > 0
    off, stop = np.abs(ours[lit] / true[lit] - 1), np.log2(true[lit])
    counted = stop > stop.max() - RANGE_STOPS
    number = np.floor(stop).astype(int)
    held = [n for n in range(number.min(), number.max() + 1)
            if (number == n).sum() >= LEAST and np.median(off[number == n]) <= HELD]  # fmt: skip
    return {
        "radiance_percent": 100 * float(np.median(off[counted])),
        "radiance_stops": float(held[-1] - held[0] + 1) if held else 0.0,
    }
