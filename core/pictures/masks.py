"""Masks of what is to be ignored in a picture: from a file or an array, and into the picture's alpha.

Features, metrics, warp and blend leave out what alpha hides, so nothing else has to know of masks.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.lazy import extent
from ..system.errors import BadRequest
from .options import MASKS, READING
from .picture import Picture, load_picture, picture_from_array


def read_mask(source: str | Path | NDArray[Any], size: tuple[int, int], name: str) -> NDArray[np.bool_]:
    """Read an ignore mask.

    Parameters
    ----------
    source : str, Path or array
        Any picture file that can be read, or an array as for `picture_from_array`, or of bool. White (brighter than
        half) is ignored. If there is alpha and what it shows has one colour, alpha decides; otherwise colour times
        alpha does.
    size : (int, int)
        (W, H) px of the picture. A mask of another size but the same shape to within a pixel is stretched (nearest).
    name : str
        Of the picture in messages, like "the reference".

    Returns
    -------
    (H, W) bool
        True where the picture is to be ignored.

    Raises
    ------
    UnreadableImage
        The file cannot be read.
    BadRequest
        The mask has another shape, holds labels instead of white, or leaves nothing.
    """
    label = f"the mask of {name}" if isinstance(source, np.ndarray) else f"{source}: the mask of {name}"
    mask = _drawn(source, size, label)
    left = 1 - float(mask.mean())
    if left < MASKS.least_left:
        raise BadRequest(
            f"{label} leaves {left:.1%} of the picture, at least {MASKS.least_left:.0%} is needed: white is ignored, "
            "black is kept; invert the mask if it was painted the other way round"
        )
    return mask


def read_wanted(source: str | Path | NDArray[Any], size: tuple[int, int], name: str) -> NDArray[np.bool_]:
    """Read a mask of what is wanted of a picture: as `read_mask`, but all of it may be white."""
    label = "the mask of what is to be shown of"
    return _drawn(source, size, f"{label} {name}" if isinstance(source, np.ndarray) else f"{source}: {label} {name}")


def read_painted(source: str | Path | NDArray[Any]) -> NDArray[np.int8]:
    """Read what an artist painted over a panorama, at its own size.

    Parameters
    ----------
    source : str, Path or array
        Any picture file that can be read, or an array as for `picture_from_array`.

    Returns
    -------
    (h, w) int8
        -1 where it is black: from the reference; 1 where it is white: from the target; 0 where it is gray or
        transparent: the seam decides.

    Raises
    ------
    UnreadableImage
        The file cannot be read.
    """
    picture = _picture(source, "the mask of the seam")
    values = _gray(picture)
    painted = np.zeros(values.shape, np.int8)
    painted[values < MASKS.painted], painted[values > 1 - MASKS.painted] = -1, 1
    if picture.alpha is not None:
        painted[picture.alpha <= 0.5] = 0
    return painted


def painted_over(painted: NDArray[np.int8], size: tuple[int, int]) -> NDArray[np.int8]:
    """The same on a panorama of `size` (W, H) px. Raises BadRequest where its shape is another one."""
    return _stretched(painted, size, "the mask of the seam", "the whole panorama")


def has_shape(mask: NDArray[Any], size: tuple[int, int]) -> bool:
    """Whether a mask (H, W) has the shape of `size` (W, H), to within a pixel of the smaller of the two, and about the
    same aspect."""
    own = mask.shape[1], mask.shape[0]
    across = own[0] * size[1], own[1] * size[0]
    if max(across) > MASKS.same_aspect * min(across):
        return False
    (w, h), (small_w, small_h) = sorted([own, size], reverse=True, key=lambda s: s[0] * s[1])
    # some scale brings both sides together
    return max((small_w - 1) / w, (small_h - 1) / h) <= min((small_w + 1) / w, (small_h + 1) / h)


def without(picture: Picture, mask: NDArray[np.bool_]) -> Picture:
    """The picture with alpha 0 where the mask (H, W) is True; the same picture where it is True nowhere."""
    if not mask.any():
        return picture
    alpha = np.ones(mask.shape, np.float32) if picture.alpha is None else picture.alpha
    return replace(picture, alpha=np.where(mask, np.float32(0), alpha))


def _drawn(source: str | Path | NDArray[Any], size: tuple[int, int], label: str) -> NDArray[np.bool_]:
    """Where (H, W) a mask is white, at the size of its picture."""
    picture = _picture(source, label)
    _refuse_labels(picture, label)
    drawn: NDArray[np.bool_] = _stretched(_white(picture), size, label)
    return drawn


def _picture(source: str | Path | NDArray[Any], label: str) -> Picture:
    if not isinstance(source, np.ndarray):
        return load_picture(source, READING.drawing_pixels_per_byte)
    return picture_from_array(source.astype(np.uint8) * 255 if source.dtype == bool else source, label)


def _refuse_labels(picture: Picture, label: str) -> None:
    """Masks of 0 and 1 look black and would ignore nothing, without a word."""
    if picture.bits < 32 and picture.alpha is None and picture.view.max() <= 1 and extent(picture.light)[1] > 0:
        raise BadRequest(f"{label} holds nothing but black and almost black; save what is to be ignored as white (255)")


def _white(picture: Picture) -> NDArray[np.bool_]:
    """Where the mask says ignore (h, w), at its own size."""
    gray = _gray(picture)
    if picture.alpha is None:
        return gray > 0.5
    shown = _values(picture)[picture.alpha > 0.5]
    one_colour = not len(shown) or np.ptp(shown, axis=0).max() <= MASKS.one_colour
    return (picture.alpha if one_colour else gray * picture.alpha) > 0.5


def _values(picture: Picture) -> NDArray[np.float32]:
    """A float picture's view is exposed for the eye; its values themselves are the mask."""
    return picture.pixels if picture.bits == 32 else picture.view.astype(np.float32) / 255


def _gray(picture: Picture) -> NDArray[np.float32]:
    values = _values(picture)
    return values[..., 0] if values.shape[2] == 1 else cv2.cvtColor(values, cv2.COLOR_RGB2GRAY)


def _stretched(mask: NDArray[Any], size: tuple[int, int], label: str, what: str = "the picture") -> NDArray[Any]:
    width, height = size
    own_height, own_width = mask.shape
    if (own_width, own_height) == size:
        return mask
    if not has_shape(mask, size):
        raise BadRequest(
            f"{label} has {own_width}×{own_height} pixels, {what} has {width}×{height}: a mask needs "
            f"{what}'s size, or its shape at another size, upright"
        )
    rows = (2 * np.arange(height) + 1) * own_height // (2 * height)
    columns = (2 * np.arange(width) + 1) * own_width // (2 * width)
    stretched: NDArray[Any] = mask[np.ix_(rows, columns)]
    return stretched
