"""The full panorama of a draft: each part is worked out of the full pictures where it is read.

Where a draft's pixels show one picture, so do the full ones between them. Beside a seam both are mixed within a pixel
or two, by shares that fall from one draft's pixel to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.canvas import Canvas
from ...panorama.layers import Fetched, Layer
from ...pictures.picture import Picture
from ...raster.arrays import Part, Plane, bounds, for_each_channel, in_any_channel, within
from ...raster.enlarging import Enlargement, repeated
from ...raster.lazy import LazyImage, extent
from ...raster.picture_map import BoxedMap, CanvasMap, MapPart, PictureMap
from ...system.threads import ask, each
from ..blend import changed
from .draft import Draft
from .options import DRAFT


@dataclass(frozen=True, eq=False)
class _Piece:
    """A picture in a part of the panorama: its number; share (h, w): how much of it is shown there, 0 where it shows
    nothing; alpha (h, w); and where it is seen."""

    number: int
    share: Plane
    alpha: Plane
    picture_map: PictureMap


@dataclass(frozen=True, eq=False)
class EnlargedPanorama(LazyImage):
    """The light (H, W, C) of the whole canvas of a draft, at its full size.

    Attributes
    ----------
    draft : Draft
    canvas : Canvas
        The draft's, enlarged.
    pictures : sequence of Picture
        In full.
    limits : tuple of (float, float)
        The least and the most of each one's light.
    """

    draft: Draft
    canvas: Canvas
    pictures: Sequence[Picture]
    limits: tuple[tuple[float, float], ...]

    @staticmethod
    def of(draft: Draft, canvas: Canvas, pictures: Sequence[Picture]) -> EnlargedPanorama:
        """The panorama of full pictures, in the order of the draft's; canvas: the draft's, enlarged."""
        return EnlargedPanorama(draft, canvas, pictures, tuple(extent(one.light) for one in pictures))

    @property
    def shape(self) -> tuple[int, int, int]:
        """(H, W, C)."""
        height, width = self.draft.labels.shape
        return self.draft.times * height, self.draft.times * width, self.draft.changes.shape[2]

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        rows, columns = within(part, self.shape)
        out = np.empty((rows.stop - rows.start, columns.stop - columns.start, self.shape[2]), np.float32)

        def put(there: Part) -> None:
            here = (slice(a.start - b.start, a.stop - b.start) for a, b in zip(there, (rows, columns), strict=True))
            out[tuple(here)] = self._made(there)

        each(put, _tiles(rows, columns, DRAFT.tile_rows, DRAFT.tile_columns))
        return out

    def alpha(self) -> NDArray[np.float32] | NDArray[np.bool_]:
        """Alpha (H, W) of the panorama: bool where no picture is translucent."""
        draft, opaque = self.draft, all(one.alpha is None for one in self.pictures)
        shown = (draft.labels >= 0) | draft.filled
        inner = cv2.erode(shown.astype(np.uint8), np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT) > 0
        alpha = repeated(inner, draft.times)
        if not opaque:
            alpha = alpha.astype(np.float32)
        side = DRAFT.outline_px

        def put(block: Part) -> None:
            there = tuple(slice(draft.times * one.start, draft.times * one.stop) for one in block)
            alpha[there] = np.maximum(alpha[there], self._alpha((there[0], there[1])))

        height, width = draft.labels.shape
        near = cv2.dilate(shown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        blocks = _tiles(slice(0, height), slice(0, width), side, side)
        each(put, [one for one in blocks if near[one].any() and not (opaque and inner[one].all())])
        return alpha

    def labels(self) -> NDArray[np.int16]:
        """Which picture (H, W) most of each pixel comes from, −1 where none shows it."""
        out = np.full(self.shape[:2], -1, np.int16)

        def put(there: Part) -> None:
            most = np.zeros(out[there].shape, np.float32)
            for one in self._shown(there):
                larger = one.share > most
                out[there][larger] = one.number
                np.maximum(most, one.share, out=most)

        height, width = out.shape
        each(put, _tiles(slice(0, height), slice(0, width), DRAFT.tile_rows, DRAFT.tile_columns))
        return out

    def _made(self, part: Part) -> NDArray[np.float32]:
        """The light (h, w, C) of one part."""
        ask()
        here, channels = self._enlargement(part), self.shape[2]
        shape = part[0].stop - part[0].start, part[1].stop - part[1].start
        total, light = np.zeros(shape, np.float32), np.zeros((*shape, channels), np.float32)
        for one in self._shown(part):
            weight = one.share * one.alpha
            box = bounds(weight > 0)
            if box is None:
                continue
            weight = weight[box]
            light[box] += self._of_picture(one, part, box) * for_each_channel(weight, channels)
            total[box] += weight
        light /= for_each_channel(np.where(total > 0, total, np.float32(1)), channels)
        drafted: NDArray[np.bool_] = self._drafted(here) & (total == 0)
        if drafted.any():
            light[drafted] = self._of_draft(here)[drafted]
        return light

    def _alpha(self, part: Part) -> Plane:
        """Alpha (h, w) of one part."""
        here = self._enlargement(part)
        total: Plane = np.zeros((part[0].stop - part[0].start, part[1].stop - part[1].start), np.float32)
        alpha = np.zeros_like(total)
        for one in self._shown(part):
            total += one.share
            alpha += one.share * one.alpha
        alpha /= np.where(total > 0, total, np.float32(1))
        alpha[self._drafted(here) & (total == 0)] = 1
        return alpha

    def _shown(self, part: Part) -> Iterator[_Piece]:
        """What each picture shows of one part, of those that show anything."""
        here = self._enlargement(part)
        labels = self.draft.labels[here.cells]
        for number in np.unique(labels[labels >= 0]).tolist():
            picture, share = self.pictures[number], here.of((labels == number).astype(np.float32))
            picture_map = self._map(number, here)
            inside = picture_map.inside()
            _, alpha = Fetched.of(picture, picture_map.x, picture_map.y, inside, True, self.limits[number])
            # to the fourth: the ramp between two px of the draft is then about two of four wide, and fine detail is not
            # seen twice
            yield _Piece(number, np.square(np.square(share)) * inside, alpha.astype(np.float32), picture_map)

    def _map(self, number: int, here: Enlargement) -> PictureMap:
        """Where a picture is seen in a part."""
        rows, columns = here.cells
        box = columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start
        height, width = self.pictures[number].light.shape[:2]
        return _enlarged(self.draft.warp.maps[number].within(box).arrays(), here, (width, height))

    def _of_picture(self, one: _Piece, part: Part, box: Part) -> NDArray[np.float32]:
        """The light (h, w, C) of a picture in a box of a part, as it is shown there."""
        draft, number, places = self.draft, one.number, one.picture_map
        x, y = places.x[box], places.y[box]
        own = PictureMap(x, y, places.size)
        fetched, alpha = Fetched.of(self.pictures[number], x, y, own.inside(), True, self.limits[number])
        exposure = draft.exposures[number]
        if exposure.clipped is not None:
            corner = part[0].start + box[0].start, part[1].start + box[1].start
            exposure = replace(exposure, clipped=replace(exposure.clipped, times=draft.times, corner=corner))
        everything = slice(0, x.shape[0]), slice(0, x.shape[1])
        light: NDArray[np.float32] = exposure.applied(Layer(fetched, alpha), own).light[everything]
        here = self._enlargement(part)
        changes = draft.changes[here.cells]
        if not changes.any():
            return light
        chosen = (draft.labels[here.cells] == number).astype(np.float32)
        share = here.of(chosen)[box]
        change = here.of(changes * for_each_channel(chosen, changes.shape[2]))[box]
        change /= for_each_channel(np.where(share > 0, share, np.float32(1)), changes.shape[2])
        touched = in_any_channel(change != 0)
        light = light.copy()
        light[touched] = changed(light[touched], change[touched])
        return light

    def _drafted(self, here: Enlargement) -> NDArray[np.bool_]:
        """Where (h, w) the draft's own light is shown if no picture shows anything: in what was filled, and where a
        picture ends less than a pixel of the draft before the next begins."""
        filled = self.draft.filled[here.cells]
        closed: NDArray[np.bool_] = here.of(((self.draft.labels[here.cells] >= 0) | filled).astype(np.float32)) == 1
        if filled.any():
            closed |= here.of(filled.astype(np.float32)) > 0.5
        return closed

    def _of_draft(self, here: Enlargement) -> NDArray[np.float32]:
        """The draft's own light (h, w, C)."""
        shown = ((self.draft.labels[here.cells] >= 0) | self.draft.filled[here.cells]).astype(np.float32)
        channels = self.shape[2]
        light = here.of(self.draft.light[here.cells] * for_each_channel(shown, channels))
        light /= for_each_channel(np.maximum(here.of(shown), np.float32(1e-6)), channels)
        return light

    def _enlargement(self, part: Part) -> Enlargement:
        height, width = self.draft.labels.shape
        return Enlargement(part, self.draft.times, (height, width))


def enlarged_map(one: CanvasMap, times: int, size: tuple[int, int]) -> BoxedMap:
    """A draft's map to a small picture as one of the enlarged canvas to the full picture of (W, H) px, as arrays."""
    assert isinstance(one, BoxedMap)
    parts = []
    for part in one.parts:
        height, width = part.inner.shape
        if not part.inner.x.size:
            parts.append(MapPart(PictureMap(part.inner.x, part.inner.y, size), (0, 0)))
            continue
        everything = slice(0, times * height), slice(0, times * width)
        inner = _enlarged(part.inner, Enlargement(everything, times, (height, width)), size)
        parts.append(MapPart(inner, (times * part.corner[0], times * part.corner[1])))
    return BoxedMap(tuple(parts), (times * one.shape[0], times * one.shape[1]))


def _enlarged(small: PictureMap, here: Enlargement, size: tuple[int, int]) -> PictureMap:
    """A map in the cells of a part to a small picture, as one of the part to the full picture of (W, H) px."""
    found = []
    for values, side, full in zip((small.x, small.y), small.size, size, strict=True):
        factor = full / side
        pixels = here.of(values, goes_on=True)
        pixels *= np.float32(factor)
        pixels += np.float32((factor - 1) / 2)
        found.append(pixels)
    return PictureMap(found[0], found[1], size)


def _tiles(rows: slice, columns: slice, height: int, width: int) -> list[Part]:
    """Rows and columns in parts of at most so many."""
    return [
        (slice(top, min(rows.stop, top + height)), slice(left, min(columns.stop, left + width)))
        for top in range(rows.start, rows.stop, height) for left in range(columns.start, columns.stop, width)
    ]
