"""Parts, boxes and masks of arrays, without any camera."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from .options import MASKS, PARTS

Array = NDArray[np.float64]
Plane = NDArray[np.float32]
# Rows and columns, with bounds that lie in the picture.
Part: TypeAlias = tuple[slice, slice]
# left, top, width, height in px
Box = tuple[int, int, int, int]
# Pixels of (H, W, …) and those beside them: to the right, then below.
NEIGHBOURS = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])


def angle_of(y: NDArray[Any], x: NDArray[Any]) -> NDArray[Any]:
    """The angle (…) of (x, y), −π to π, of their precision.

    NumPy's arctan2 has other last bits now and then, from call to call, for values with gaps between them in memory.
    """
    angles: NDArray[Any] = np.arctan2(np.asarray(y, order="C"), np.asarray(x, order="C"))
    return angles


def common(box: Box, other: Box) -> Box:
    """What two boxes that meet have in common."""
    left, top = max(box[0], other[0]), max(box[1], other[1])
    right, bottom = min(box[0] + box[2], other[0] + other[2]), min(box[1] + box[3], other[1] + other[3])
    return left, top, right - left, bottom - top


def strips(shape: tuple[int, ...]) -> Iterator[slice]:
    """The rows of a picture (H, W, …), some at a time."""
    rows = max(1, PARTS.strip_pixels // max(1, shape[1]))
    for top in range(0, shape[0], rows):
        yield slice(top, min(shape[0], top + rows))


def small_strips(shape: tuple[int, ...]) -> Iterator[slice]:
    """Rows of a picture (H, W), so few at a time that what is worked out of them stays in the processor's cache."""
    return strips((shape[0], PARTS.smaller_strips * shape[1]))


def beside(rows: slice, margin: int, height: int) -> tuple[slice, slice]:
    """Some rows of `height` with so many more on either side, as far as there are; and which of those they are."""
    near = slice(max(0, rows.start - margin), min(height, rows.stop + margin))
    return near, slice(rows.start - near.start, rows.stop - near.start)


def bounds(mask: NDArray[np.bool_]) -> Part | None:
    """Rows and columns of the smallest box that holds all of a mask (H, W); None where it is empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return None
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def box_of(mask: NDArray[np.bool_]) -> Box:
    """The smallest box that holds all of a mask (H, W), which is not empty."""
    part = bounds(mask)
    if part is None:
        raise ValueError("a mask that holds nothing has no box")
    rows, columns = part
    return columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start


def within(part: Part, shape: tuple[int, ...]) -> Part:
    """The same rows and columns of a picture (H, W, …), none beyond its edges."""
    rows, columns = (slice(*one.indices(side)[:2]) for one, side in zip(part, shape, strict=False))
    return rows, columns


def with_margin(part: Part, margin: int, shape: tuple[int, ...]) -> Part:
    """The same rows and columns and a margin around them, none beyond the edges of a picture (H, W, …)."""
    rows, columns = (slice(max(0, one.start - margin), one.stop + margin) for one in part)
    return within((rows, columns), shape)


def meet(
    part: Part, shape: tuple[int, ...], at: tuple[int, int], inner: tuple[int, ...]
) -> tuple[Part, Part] | None:
    """Where a part of a picture (H, W, …) meets another (h, w, …) whose first pixel lies `at` (row, column) of it: rows
    and columns of what the part gives, and of the other; None where they do not meet."""
    part = within(part, shape)
    ends = [(max(p.start, a), min(p.stop, a + side)) for p, a, side in zip(part, at, inner, strict=False)]
    if any(low >= high for low, high in ends):
        return None
    (rows, columns), (rows_there, columns_there) = (
        [slice(low - start, high - start) for (low, high), start in zip(ends, starts, strict=True)]
        for starts in ((part[0].start, part[1].start), at)
    )
    return (rows, columns), (rows_there, columns_there)


def shown_only(pixels: NDArray[np.float32], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Pixels (H, W, C) where a mask (H, W) says so, 0 elsewhere; NumPy's products of the two take twice as long."""
    shown: NDArray[np.float32] = cv2.copyTo(pixels, np.ascontiguousarray(mask).view(np.uint8)).reshape(pixels.shape)
    return shown


def for_each_channel(values: NDArray[Any], channels: int) -> NDArray[np.float32]:
    """Values (H, W) once for each channel (H, W, C): what NumPy spreads by itself takes four times as long."""
    spread: NDArray[np.float32] = cv2.merge([values] * channels).reshape(*values.shape, channels)
    return spread


def in_any_channel(holds: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (H, W) something holds in any channel (H, W, C); NumPy's own `any` takes several times as long over so few.
    """
    anywhere: NDArray[np.bool_] = np.logical_or.reduce([holds[..., k] for k in range(holds.shape[2])])
    return anywhere


def without_specks(hidden: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of what the target cannot see (H, W) that which is more than a speck."""
    square = np.ones((MASKS.speck_side,) * 2, np.uint8)
    opened: NDArray[np.uint8] = cv2.morphologyEx(hidden.astype(np.uint8), cv2.MORPH_OPEN, square)
    return opened > 0


def larger_parts(mask: NDArray[np.bool_], least: int = MASKS.speck_side**2) -> NDArray[np.bool_]:
    """The connected parts of a mask (H, W) that have at least so many px, by default as many as the smallest part that
    is no speck: strips too, however narrow."""
    marked = np.ascontiguousarray(mask).view(np.uint8)
    _, number, about, _ = cv2.connectedComponentsWithStats(marked)
    large = about[:, cv2.CC_STAT_AREA] >= least
    large[0] = False
    parts: NDArray[np.bool_] = large[number]
    return parts


def cut(array: NDArray[Any], box: Box, beyond: float = 0.0) -> NDArray[Any]:
    """The part of an array (H, W, …) in a box (left, top, width, height); `beyond` where that reaches over its edges.

    Where it does not, that is a view of the array: parts of what is as large as a canvas take no memory of their own.
    """
    left, top, width, height = box
    right, bottom = left + width, top + height
    if left >= 0 and top >= 0 and right <= array.shape[1] and bottom <= array.shape[0]:
        return array[top:bottom, left:right]
    out = np.zeros((height, width, *array.shape[2:]), array.dtype)  # a sphere is mostly empty: memory untouched is free
    if beyond:
        out[:] = beyond
    part = array[max(0, top) : bottom, max(0, left) : right]
    y, x = max(0, -top), max(0, -left)
    out[y : y + part.shape[0], x : x + part.shape[1]] = part
    return out


def dilated(mask: NDArray[np.bool_], margin: int) -> NDArray[np.bool_]:
    """A mask (H, W) with so many px more on every side, in a square window."""
    side = 2 * margin + 1
    larger: NDArray[np.bool_] = cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    return larger


def eroded(mask: NDArray[np.bool_], margin: int) -> NDArray[np.bool_]:
    """A mask (H, W) with so many px less on every side, in a square window; beyond the edges there is nothing of it."""
    window = np.ones((2 * margin + 1,) * 2, np.uint8)
    inner = cv2.erode(mask.astype(np.uint8), window, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    smaller: NDArray[np.bool_] = inner > 0
    return smaller


def cut_in_place(array: NDArray[np.float32], box: Box) -> NDArray[np.float32]:
    """The part of an array (H, W) in a box (left, top, width, height) of it, moved to the front of its memory."""
    left, top, width, height = box
    flat = array.reshape(-1)
    for row in range(height):
        start = (top + row) * array.shape[1] + left
        flat[row * width : (row + 1) * width] = flat[start : start + width]
    return flat[: width * height].reshape(height, width)


def copied_where(mask: NDArray[np.bool_], source: NDArray[Any], out: NDArray[Any]) -> None:
    """Puts the pixels (H, W, C) of a source where a mask (H, W) says so; `np.copyto` takes several times as long."""
    cv2.copyTo(source, np.ascontiguousarray(mask).view(np.uint8), out)
