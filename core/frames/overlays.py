"""What is burnt into pictures, a date or a logo: the same pixels at the same place, while the scene behind them moves.

Such a thing has outlines that all pictures share to the pixel. Outlines of the scene do not, unless nothing moves: then
nothing is taken for an overlay. Even skies, dark corners and clipped light have no outlines, however much they agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture
from ..system.threads import ask
from .frame import size_of
from .options import OVERLAYS


def overlays_in(pictures: Sequence[Picture]) -> list[NDArray[np.bool_] | None]:
    """Where something is burnt in, in pictures of one size all at the same place.

    Parameters
    ----------
    pictures : sequence of Picture
        Those of equal size are compared with each other.

    Returns
    -------
    list of (H, W) bool arrays or None
        Of each picture; None where nothing is.
    """
    found: list[NDArray[np.bool_] | None] = [None] * len(pictures)
    sizes = [size_of(picture) for picture in pictures]
    for size in dict.fromkeys(sizes):
        numbers = [number for number, one in enumerate(sizes) if one == size]
        if len(numbers) > 1:
            mask = _burnt_into([pictures[number] for number in numbers])
            for number in numbers:
                found[number] = mask
    return found


@dataclass(frozen=True, eq=False)
class _Compared:
    """What pictures have in common, at (H, W) px: shared outlines, and those of any."""

    pictures: Sequence[Picture]
    reach: int
    shared: NDArray[np.bool_]
    any: NDArray[np.bool_]

    @cached_property
    def products_and_squares(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Of how pixels (H, W) differ from what is around them the mean over all products of two pictures, and over all
        squares; only outlines that may be burnt in, one of them large enough, ask for it."""
        total, squares = np.zeros((*self.any.shape, 3), np.float32), np.zeros(self.any.shape, np.float32)
        for picture in self.pictures:
            levels = _shrunk(picture, self.any.shape).astype(np.float32)
            levels -= cv2.blur(levels, (2 * self.reach + 1,) * 2)
            total += levels
            squares += _over_channels(np.square(levels))
        count = len(self.pictures)
        return (_over_channels(np.square(total)) - squares) / (count * (count - 1)), squares / count


def _burnt_into(pictures: Sequence[Picture]) -> NDArray[np.bool_] | None:
    width, height = size_of(pictures[0])
    if min(width, height) < OVERLAYS.least_side:
        return None
    share = min(1.0, OVERLAYS.side / max(width, height))
    shape = max(1, round(height * share)), max(1, round(width * share))
    reach = max(3, round(OVERLAYS.reach * max(shape)))
    compared = _compared(pictures, shape, reach)
    ask()
    count = compared.shared.sum()
    if count < OVERLAYS.least_outline or count > OVERLAYS.most_agree * compared.any.sum():
        return None
    joined = cv2.morphologyEx(compared.shared.astype(np.uint8), cv2.MORPH_CLOSE, _disc(reach))
    ask()
    contours = cv2.findContours(joined, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    dense = OVERLAYS.dense_of_two if len(pictures) == 2 else OVERLAYS.dense
    outlines = [_burnt_in_outline(contour, compared, reach, dense) for contour in contours]
    mask = np.zeros(shape, np.uint8)
    if max(outlines) >= OVERLAYS.least_outline:  # where one is, smaller ones are of its kind
        some = [(contour, outline) for contour, outline in zip(contours, outlines, strict=True)
                if outline >= OVERLAYS.least_further and _is_alike(contour, compared, reach)]  # fmt: skip
        if max((outline for _, outline in some), default=0) >= OVERLAYS.least_outline:
            cv2.drawContours(mask, [contour for contour, _ in some], -1, 1, cv2.FILLED)
    if not mask.any() or mask.mean() > OVERLAYS.most_share:
        return None
    grown = cv2.dilate(mask, _disc(max(2, round(OVERLAYS.margin * max(shape)))))
    full: NDArray[np.uint8] = cv2.resize(grown, (width, height), interpolation=cv2.INTER_NEAREST)
    return full > 0


def _compared(pictures: Sequence[Picture], shape: tuple[int, int], reach: int) -> _Compared:
    """Pictures of one size compared pixel by pixel, at (H, W) px."""
    often, some = np.zeros(shape, np.int32), np.zeros(shape, bool)
    sums, squared = (np.zeros((*shape, 3), np.float32) for _ in range(2))
    beside = np.ones((3, 3), np.uint8)
    for picture in pictures:
        ask()
        view = _shrunk(picture, shape)
        slopes = [_over_channels(np.square(cv2.Sobel(view, cv2.CV_32F, *way))) for way in ((1, 0), (0, 1))]
        strong = np.sqrt(slopes[0] + slopes[1]) > OVERLAYS.steep
        if picture.alpha is not None:
            strong &= cv2.resize(picture.alpha, shape[::-1], interpolation=cv2.INTER_AREA) > 0.99
        often += cv2.dilate(strong.astype(np.uint8), beside)
        some |= strong
        levels = view.astype(np.float32)
        sums += levels
        squared += np.square(levels, out=levels)
    ask()
    count, rim = len(pictures), OVERLAYS.rim
    differ = np.maximum.reduce(cv2.split(squared / count - np.square(sums / count)))
    shared = (often >= max(2, OVERLAYS.outlined * count)) & (differ <= OVERLAYS.same_level**2)
    shared[:rim] = shared[-rim:] = shared[:, :rim] = shared[:, -rim:] = False
    return _Compared(pictures, reach, shared, some)


def _shrunk(picture: Picture, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """A picture's view with three channels, at (H, W) px."""
    view = cv2.resize(picture.view, shape[::-1], interpolation=cv2.INTER_AREA).reshape(*shape, -1)
    return np.repeat(view, 3, axis=2) if view.shape[2] == 1 else view


def _over_channels(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums (H, W) over three channels (H, W, 3), one after the other: NumPy takes several times as long along them."""
    first, second, third = cv2.split(values)
    total: NDArray[np.float32] = first + second + third
    return total


def _burnt_in_outline(contour: NDArray[np.int32], compared: _Compared, reach: int, dense: float) -> int:
    """px beside outlines that are the same in all pictures in a contour, 0 unless it may be burnt in: densely filled
    with them, and unlike what is around it."""
    width, height = cv2.boundingRect(contour)[2:]
    if min(width, height) < OVERLAYS.least_width or width * height > OVERLAYS.most_share * compared.any.size:
        return 0
    around, inside = _surroundings(contour, compared, reach)
    shared, strong = compared.shared[around], compared.any[around]
    near, beside = inside > 0, cv2.dilate(inside, _disc(2 * reach)) == 0
    own = int((near & shared).sum())
    moving = float((beside & shared).sum()) / max(1, int((beside & strong).sum()))
    return 0 if own < dense * near.sum() or moving > OVERLAYS.most_agree else own


def _is_alike(contour: NDArray[np.int32], compared: _Compared, reach: int) -> bool:
    """Whether what a contour holds is the same in all pictures."""
    around, inside = _surroundings(contour, compared, reach)
    products, squares = (values[around][inside > 0].sum() for values in compared.products_and_squares)
    return bool(products / max(1e-6, float(squares)) >= OVERLAYS.least_alike)


def _surroundings(
    contour: NDArray[np.int32], compared: _Compared, reach: int
) -> tuple[tuple[slice, slice], NDArray[np.uint8]]:
    """The part of the pictures around a contour, and its inside there, filled with 1."""
    left, top, width, height = cv2.boundingRect(contour)
    around = (slice(max(0, top - 4 * reach), top + height + 4 * reach),
              slice(max(0, left - 4 * reach), left + width + 4 * reach))  # fmt: skip
    empty, offset = np.zeros(compared.any[around].shape, np.uint8), (-around[1].start, -around[0].start)
    return around, cv2.drawContours(empty, [contour], 0, 1, cv2.FILLED, offset=offset)


def _disc(radius: int) -> NDArray[np.uint8]:
    kernel: NDArray[np.uint8] = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2)
    return kernel
