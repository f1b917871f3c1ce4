"""What the header of an EXR says of its colours and the shape of its pixels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.primaries import REC709, rgb_to_xyz, to_rec709
from .options import READING


def in_rec709(pixels: NDArray[Any], header: Mapping[str, Any]) -> NDArray[Any]:
    """Colours (H, W, 3) float32 of the header's `chromaticities` in Rec. 709; without such, and gray, as they are."""
    stated = header.get("chromaticities")
    if stated is None or pixels.shape[2] != 3 or np.allclose(stated, REC709, atol=1e-3):
        return pixels
    try:
        matrix = to_rec709(tuple(stated))
    except ValueError:  # zeros, mostly
        return pixels
    converted: NDArray[Any] = cv2.transform(pixels, matrix.astype(np.float32))
    return converted


def from_luminance_chroma(found: Mapping[str, NDArray[Any]], header: Mapping[str, Any]) -> list[NDArray[Any]]:
    """Planes R, G, B of Y, RY and BY, whose chroma may have half the rows and columns; none where they do not fit."""
    luminance, chroma = found["Y"].astype(np.float32), [found[name].astype(np.float32) for name in ("RY", "BY")]
    halves = tuple(side // 2 for side in luminance.shape)
    if any(one.shape not in (halves, luminance.shape) or not one.size for one in chroma):
        return []
    try:
        weights = rgb_to_xyz(tuple(header.get("chromaticities", REC709)))[1]
    except ValueError:
        weights = rgb_to_xyz(REC709)[1]
    red, blue = ((_spread(one, luminance.shape) + 1) * luminance for one in chroma)
    green = (luminance - np.float32(weights[0]) * red - np.float32(weights[2]) * blue) / np.float32(weights[1])
    return [red, green, blue]


def _spread(chroma: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Chroma at every pixel, straight between those of every second row and column that have some."""
    if chroma.shape == shape:
        return chroma
    # the chroma of pixel 2 i is sample i
    row, column = (np.arange(side, dtype=np.float32) / 2 for side in shape)
    columns, rows = np.meshgrid(column, row)
    spread: NDArray[Any] = cv2.remap(chroma, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return spread


def with_square_pixels(
    pixels: NDArray[Any], alpha: NDArray[Any] | None, header: Mapping[str, Any]
) -> tuple[NDArray[Any], NDArray[Any] | None, str]:
    """A picture whose pixels are wider than high (pixelAspectRatio above 1) stretched to the shape it was seen in,
    another in its height; and a warning, "" if there was nothing to do."""
    ratio = float(header.get("pixelAspectRatio", 1.0))
    height, width = pixels.shape[:2]
    size = (round(width * ratio), height) if ratio >= 1 else (width, round(height / max(ratio, 1e-3)))
    least, most = 1 / READING.max_pixel_aspect, READING.max_pixel_aspect
    if not least <= ratio <= most or size == (width, height) or size[0] * size[1] > READING.max_pixels:
        return pixels, alpha, ""

    def stretched(plane: NDArray[Any]) -> NDArray[Any]:
        found: NDArray[Any] = cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)
        return found.reshape(size[1], size[0], *plane.shape[2:])

    warning = f"its pixels are {ratio:g} times as wide as high: it was stretched to {size[0]}×{size[1]} square ones"
    return stretched(pixels), None if alpha is None else stretched(alpha), warning
