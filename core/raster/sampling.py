"""Samples of a picture at the places of a map, in tiles."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..system.threads import each
from .arrays import copied_where
from .lazy import LazyImage
from .options import PARTS


def fetch(
    source: NDArray[Any] | LazyImage, map_x: NDArray[np.float32], map_y: NDArray[np.float32],
    interpolation: int = cv2.INTER_CUBIC,
) -> NDArray[Any]:
    """Sample a picture at the positions of a map, in tiles.

    Parameters
    ----------
    source : (h, w, C) array or LazyImage
        The picture.
    map_x, map_y : (H, W) float32
        px of the source for each sample, NaN for none.
    interpolation : int
        OpenCV's flag.

    Returns
    -------
    (H, W, C)
        Of the source's type; 0 where the map leaves the picture.
    """
    out = np.zeros((*map_x.shape, source.shape[2]), source.dtype)
    step = PARTS.tile_side
    tops, lefts = (range(0, side, step) for side in map_x.shape)
    each(
        lambda tile: _fetch_tile(source, map_x[tile], map_y[tile], out[tile], interpolation),
        [(slice(top, top + step), slice(left, left + step)) for top in tops for left in lefts],
    )
    return out


def _fetch_tile(
    source: NDArray[Any] | LazyImage, x: NDArray[np.float32], y: NDArray[np.float32], out: NDArray[Any],
    interpolation: int,
) -> None:
    height, width = source.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    whole_tile = bool(inside.all())
    if not whole_tile and not inside.any():
        return
    within = [values if whole_tile else values[inside] for values in (x, y)]
    (x0, x1), (y0, y1) = (
        (max(0, int(values.min()) - 2), min(side, int(values.max()) + 4))
        for values, side in zip(within, (width, height), strict=True)
    )
    # a tile that shrinks a huge picture is quartered
    if max(x1 - x0, y1 - y0) > PARTS.max_remap_side and max(out.shape[:2]) > 1:
        half = (max(1, out.shape[0] // 2), max(1, out.shape[1] // 2))
        for rows in (slice(None, half[0]), slice(half[0], None)):
            for columns in (slice(None, half[1]), slice(half[1], None)):
                if out[rows, columns].size:
                    _fetch_tile(source, x[rows, columns], y[rows, columns], out[rows, columns], interpolation)
        return
    part = np.ascontiguousarray(source[y0:y1, x0:x1])
    x, y = x - np.float32(x0), y - np.float32(y0)
    if not whole_tile:
        x[~inside] = y[~inside] = -9
    # one picture's own border repeated: bicubic needs a pixel beyond the last
    sampled = cv2.remap(part, x, y, interpolation, borderMode=cv2.BORDER_REPLICATE).reshape(out.shape)
    if whole_tile:
        out[:] = sampled
    else:
        copied_where(inside, sampled, out)
