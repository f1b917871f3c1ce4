"""How much of developed camera RAW is clipped, and where that is to be said."""

from __future__ import annotations

import numpy as np

from ..raster.arrays import in_any_channel, strips
from .options import DECODING
from .picture import Picture


def clipped_share(picture: Picture) -> float:
    """Share of the pixels of camera RAW that are clipped in any channel; 0 of a picture that does not clip."""
    if not picture.is_raw:
        return 0.0
    height, width = picture.light.shape[:2]
    limit = np.float32(DECODING.raw_clipped * picture.clips_at)
    rows = strips(picture.light.shape)
    return sum(int(in_any_channel(picture.light[part, 0:width] >= limit).sum()) for part in rows) / (height * width)


def clipping_warnings(picture: Picture) -> tuple[str, ...]:
    """That camera RAW is over-exposed which was exposed longer than the one that it was developed like."""
    stops = -float(np.log2(picture.clips_at))
    if stops <= DECODING.longer_stops:  # of pictures that do not clip it is minus infinity
        return ()
    share = clipped_share(picture)
    if share <= DECODING.much_clipped:
        return ()
    return (
        f"{share:.0%} of it is over-exposed, and it was exposed {stops:.1f} stops more than the first camera RAW "
        "picture: there it shows less light than there was",
    )
