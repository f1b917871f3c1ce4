"""Pictures of a field for the page: its panorama, and the overlap of both pictures, their average and difference."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..measure.metrics import overlap_views
from ..measure.placed.placed import PlacedSet
from ..pipeline import StitchResult
from ..raster.arrays import bounds
from ..raster.colour import encode
from .options import COMPARISON

Rgb = NDArray[np.uint8]


def field_pictures(result: StitchResult) -> dict[str, bytes]:
    """JPEG files by kind: panorama; average and difference (amplified) of reference and warped target in the overlap;
    reference and warped, cut to the overlap, which the page shows in turn."""
    view, fetched, inside = overlap_views(result.pictures, result.warp)
    view, fetched = _rgb(view), _rgb(fetched)
    box = _bounds(inside)
    reference, warped, both = view[box], fetched[box], inside[box][..., None]
    difference = np.minimum(COMPARISON.difference_gain * np.abs(reference.astype(int) - warped), 255)
    pictures = {
        "panorama": _on_gray(result),
        "average": np.where(both, (reference.astype(np.uint16) + warped + 1) // 2, 0),
        "difference": np.where(both, difference, 0), "warped": np.where(both, warped, 0),
        "reference": np.where(both, reference, 0),  # the overlap differs from field to field
    }  # fmt: skip
    return {
        kind: _jpeg(picture.astype(np.uint8), COMPARISON.panorama_side_px if kind == "panorama" else None)
        for kind, picture in pictures.items()
    }  # fmt: skip


def origin_of(result: StitchResult) -> tuple[float, float, float]:
    """Where the reference's first px lies in the picture of its flat panorama, px, and px of that for one of the
    reference: by these the loupe shows one place in all panoramas."""
    scale = _scale((result.canvas.height, result.canvas.width), COMPARISON.panorama_side_px)
    x, y = ((offset + 0.5) * scale for offset in result.canvas.offset)
    return x, y, scale


def placed_pictures(panorama: PlacedSet) -> dict[str, bytes]:
    """JPEG files by kind: panorama, the average of all that is shown at a place, so that what is off shows twice;
    difference (amplified), between the least and the most that is shown there."""
    shape = panorama.size[::-1]
    total = np.zeros((*shape, 3), np.float32)
    least, most = np.full((*shape, 3), 255, np.uint8), np.zeros((*shape, 3), np.uint8)
    for one in panorama.pictures:
        shows = one.shows[..., None]
        total[one.box] += one.colours * shows
        least[one.box] = np.where(shows, np.minimum(least[one.box], one.colours), least[one.box])
        most[one.box] = np.where(shows, np.maximum(most[one.box], one.colours), most[one.box])
    views = panorama.views_at[..., None]
    average = np.where(views > 0, total / np.maximum(views, 1), 96)
    spread = np.where(views > 1, np.minimum(COMPARISON.difference_gain * (most.astype(int) - least), 255), 0)
    part = bounds(panorama.views_at > 0) or (slice(0, 1), slice(0, 1))
    return {
        "panorama": _jpeg(np.rint(average[part]).astype(np.uint8), COMPARISON.panorama_side_px),
        "difference": _jpeg(np.abs(spread[part]).astype(np.uint8)),
    }  # fmt: skip


def _on_gray(result: StitchResult) -> Rgb:
    """The panorama over a gray background."""
    alpha = result.alpha[..., None]
    shown: Rgb = np.rint(_rgb(encode(result.pixels, 8)) * alpha + 96 * (1 - alpha)).astype(np.uint8)
    return shown


def _rgb(picture: NDArray[Any]) -> Rgb:
    return np.repeat(picture, 3, axis=2) if picture.shape[2] == 1 else picture


def _bounds(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return slice(0, 1), slice(0, 1)
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def _scale(shape: tuple[int, ...], side: int) -> float:
    """By how much a picture (H, W) is shrunk so that its longer side has so many px at most."""
    return min(1.0, side / max(shape[:2]))


def _jpeg(picture: Rgb, side: int | None = None) -> bytes:
    scale = _scale(picture.shape, COMPARISON.max_side_px if side is None else side)
    if scale < 1:
        picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    quality = [cv2.IMWRITE_JPEG_QUALITY, COMPARISON.jpeg_quality]
    coded = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), quality)
    result: bytes = coded[1].tobytes()
    return result
