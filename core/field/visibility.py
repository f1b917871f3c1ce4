"""What a picture cannot see: of several canvas points that fall on one of its pixels it shows only the nearest.

A point p at inverse depth d lies x'₃ / d baselines in front of the picture's camera, x'₃ of H_inf p + d e' before the
division. So map and depth already hold the depth order; a z-buffer over the picture's pixels reads it out.
Method: docs/method.md, 7.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import bounds, dilated, with_margin, without_specks
from ..raster.lazy import AnyImage, part_of
from ..raster.picture_map import PictureMap, falls_inside
from ..system.threads import each, in_order
from .options import VISIBILITY


def occluded(picture_map: PictureMap, nearness: AnyImage) -> NDArray[np.bool_]:
    """Where a map falls on a pixel of its picture that shows a nearer canvas point instead.

    A surface does not hide itself, however obliquely it is seen and however much the map magnifies. Time is linear in
    the pixels.

    Parameters
    ----------
    picture_map : PictureMap
    nearness : (H, W) image
        Baselines per distance from the picture's camera (see `nearness_of`): 0 infinitely far away, NaN without depth,
        where nothing hides anything.

    Returns
    -------
    (H, W) bool array
    """
    hidden = np.zeros(picture_map.x.shape, bool)
    contested = _contested(picture_map, nearness)
    if not (contested.near > 0).any():
        return hidden
    points, near = contested.points, contested.near
    found = np.zeros(points.size, bool)
    for level in np.flatnonzero(np.bincount(contested.levels)).tolist():
        owner = _owners(contested, level, picture_map.size)
        stray = VISIBILITY.surface_cells * 2.0**level

        def look(part: slice, owner: NDArray[np.int32] = owner, level: int = level, stray: float = stray) -> None:
            claimed = owner[contested.cells(part, level, picture_map.size)]
            # a cell without an owner has -1, which indexes the last point: it is left out
            rivals = np.flatnonzero((near[claimed] > near[part]) & (claimed >= 0) & ~found[part])
            first, second = points[part][rivals], points[claimed[rivals]]
            found[part][rivals] = _apart(picture_map, first, second, stray)

        each(look, contested.parts)
    hidden.ravel()[points[found]] = True
    # gaps between samples of a magnified surface that hides
    closed = cv2.morphologyEx(hidden.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) > 0
    found_hidden: NDArray[np.bool_] = closed & picture_map.inside()
    return found_hidden


def by_agreement(
    hidden: NDArray[np.bool_], picture_map: PictureMap, confidence: AnyImage | None, shown: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Correct what the depth order says by whether the pictures agree.

    What both agree on, both see. Beside what is hidden, what they do not agree on is hidden too: the rims in a map are
    a few px off, and a band of background that the picture cannot see has no depth of its own. Specks do not grow,
    since they are noise.

    Parameters
    ----------
    hidden : (H, W) bool array
        By the depth order (see `occluded`).
    picture_map : PictureMap
    confidence : (H, W) image or None
        Of dense refinement; without it `hidden` is returned.
    shown : (H, W) bool array
        Where the panorama before shows anything.

    Returns
    -------
    (H, W) bool array
    """
    extent = bounds(hidden)
    if confidence is None or extent is None:
        return hidden
    reach = max(1, round(VISIBILITY.max_growth * max(picture_map.size)))
    box = with_margin(extent, reach, hidden.shape)
    inside = falls_inside(picture_map.x[box], picture_map.y[box], picture_map.size)
    confidence_here = confidence[box] if isinstance(confidence, np.ndarray) else part_of(confidence, box)
    confirmed = hidden[box] & (confidence_here <= VISIBILITY.agreed_confidence)
    alone = (shown[box] & inside & (confidence_here < VISIBILITY.alone_confidence)) | confirmed
    reached = without_specks(confirmed)
    for _ in range(reach):
        reached = dilated(reached, 1) & alone
    out = hidden.copy()
    out[box] = confirmed | reached
    return out


@dataclass(frozen=True)
class Contested:
    """Canvas points (N,), as ascending flat indices, that may hide one another.

    rows, columns: pixels of the picture that the map sends them to; near: their nearness; levels: their cells (see
    `_levels`). There may be as many as the canvas has pixels, so that numbers are no larger than they have to be.
    """

    points: NDArray[np.int32]
    rows: NDArray[np.unsignedinteger[Any]]
    columns: NDArray[np.unsignedinteger[Any]]
    near: NDArray[np.float32]
    levels: NDArray[np.uint8]

    @property
    def parts(self) -> Iterator[slice]:
        """Some points after the other."""
        at_once = VISIBILITY.strip_pixels
        return (slice(first, first + at_once) for first in range(0, self.points.size, at_once))

    def cells(self, part: slice | NDArray[np.intp], level: int, size: tuple[int, int]) -> NDArray[np.int32]:
        """In which cell of a level some points fall; size (W, H): of the picture."""
        cells: NDArray[np.int32] = (self.rows[part] >> level).astype(np.int32)
        cells *= (size[0] >> level) + 1
        cells += self.columns[part] >> level
        return cells


def _contested(picture_map: PictureMap, nearness: AnyImage) -> Contested:
    """The points among which something may be hidden.

    Along an epipolar line the map is a function of one variable, and continuous between pixels. Where it takes a value
    twice it turns back in between, over that value. So what is hidden lies in the target where the map folds, and
    where it folds nowhere nothing is hidden.
    """
    blocks = _folded_blocks(picture_map)
    height, width = picture_map.x.shape
    kind = np.min_scalar_type(max(picture_map.size))
    rows = max(1, VISIBILITY.strip_pixels // width)

    def found_from(top: int) -> Contested:
        strip = slice(top, min(top + rows, height))
        part = PictureMap(picture_map.x[strip], picture_map.y[strip], picture_map.size)
        inside = np.flatnonzero(part.inside())
        row, column = ((values.ravel()[inside] + np.float32(0.5)).astype(kind) for values in (part.y, part.x))
        block = (row >> VISIBILITY.block_level).astype(np.int32)
        block *= blocks.shape[1]
        block += column >> VISIBILITY.block_level
        there = np.flatnonzero(blocks.ravel()[block])
        near = np.empty(0, np.float32)
        if there.size:
            with np.errstate(invalid="ignore", divide="ignore"):
                near = nearness[strip, 0:width].ravel()[inside[there]]
            known = np.isfinite(near)
            there, near = (there, near) if known.all() else (there[known], near[known])
        points = inside[there] + top * width
        levels = _levels(picture_map, top, part.shape[0], points)
        return Contested(points.astype(np.int32), row[there], column[there], near, levels)

    # one strip at least, whose parts have the right types
    found = in_order(found_from, range(0, height if blocks.any() else 1, rows))
    parts = [[one.points, one.rows, one.columns, one.near, one.levels] for one in found]
    # each part is dropped as soon as it is joined
    joined = [np.concatenate([values.pop(0) for values in parts]) for _ in range(5)]
    return Contested(*joined)


def _folded_blocks(picture_map: PictureMap) -> NDArray[np.bool_]:
    """The blocks of the target that folds of the map fall on, and their neighbours.

    A fold is a triangle between canvas pixels that the map turns over (or flattens); it counts as its bounding box.
    """
    (width, height), level = picture_map.size, VISIBILITY.block_level
    counts = np.zeros(((height >> level) + 2, (width >> level) + 2), np.int32)
    mirrored = _mirrored(picture_map)
    rows = max(1, VISIBILITY.strip_pixels // picture_map.x.shape[1])

    def corners_of(top: int) -> tuple[list[NDArray[np.intp]], list[NDArray[np.intp]]]:
        """First and last blocks, across and down, that the folds of some rows fall on."""
        x, y = (values[top : top + rows + 1] for values in (picture_map.x, picture_map.y))
        with np.errstate(invalid="ignore", over="ignore"):
            right, down = ([np.diff(v, axis=axis) for v in (x, y)] for axis in (1, 0))
            upper = right[0][:-1] * down[1][:, :-1] - right[1][:-1] * down[0][:, :-1]
            lower = right[0][1:] * down[1][:, 1:] - right[1][1:] * down[0][:, 1:]
            turned = (upper >= 0) | (lower >= 0) if mirrored else (upper <= 0) | (lower <= 0)
        row, column = np.nonzero(turned)
        corners = [np.stack([v[row + i, column + j] for i in (0, 1) for j in (0, 1)]) for v in (x, y)]
        low, high = ([np.nan_to_num(how(v, axis=0), nan=-9) for v in corners] for how in (np.nanmin, np.nanmax))
        there = (high[0] >= 0) & (high[1] >= 0) & (low[0] <= width - 1) & (low[1] <= height - 1)
        across, down = (
            [(np.clip(ends[axis][there], 0, size - 1) + 0.5).astype(np.intp) >> level for ends in (low, high)]
            for axis, size in enumerate(picture_map.size)
        )
        return across, down

    for (x0, x1), (y0, y1) in in_order(corners_of, range(0, picture_map.x.shape[0] - 1, rows)):
        for at, sign in (((y0, x0), 1), ((y0, x1 + 1), -1), ((y1 + 1, x0), -1), ((y1 + 1, x1 + 1), 1)):
            np.add.at(counts, at, sign)
    covered = counts.cumsum(axis=0).cumsum(axis=1)[:-1, :-1] > 0
    return dilated(covered, 1)


def _mirrored(picture_map: PictureMap) -> bool:
    """Whether most of the map turns the picture over."""
    step = max(1, min(picture_map.x.shape) // 64)
    x, y = (values[::step, ::step] for values in (picture_map.x, picture_map.y))
    with np.errstate(invalid="ignore", over="ignore"):
        right, down = ([np.diff(v, axis=axis) for v in (x, y)] for axis in (1, 0))
        turn = right[0][:-1] * down[1][:, :-1] - right[1][:-1] * down[0][:, :-1]
    return bool((turn < 0).sum() > (turn > 0).sum())


def nearness_of(inverse_depth: NDArray[Any], depth_in_view: NDArray[np.float32]) -> NDArray[np.float32]:
    """Baselines per distance in front of a picture's camera: d / x'₃, 0 at infinity and beyond; NaN without depth.

    depth_in_view: x'₃ of H_inf p + d e', before the division.
    """
    return np.maximum(inverse_depth, np.float32(0)) / depth_in_view


def _levels(picture_map: PictureMap, top: int, rows: int, points: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Which cells the canvas fills at points of some of its rows: log2 of the target px from one canvas pixel to the
    next, rounded up.

    Of the steps to either side the shorter counts: at the edge of an object the longer one leads off it.
    """
    if not points.size:
        return np.empty(0, np.uint8)
    low, high = max(0, top - 1), min(top + rows + 1, picture_map.x.shape[0])
    x, y = (values[low:high] for values in (picture_map.x, picture_map.y))
    longest = np.zeros(x.shape, np.float32)  # squared
    for axis in (0, 1):
        if x.shape[axis] < 2:
            continue
        with np.errstate(invalid="ignore", over="ignore"):
            step = np.square(np.diff(x, axis=axis))
            step += np.square(np.diff(y, axis=axis))
        step[~np.isfinite(step)] = 0
        # the first and the last pixel have a step to one side only
        first, last, middle = (_along(axis, part) for part in (slice(0, 1), slice(-1, None), slice(1, -1)))
        shorter = np.minimum(step[_along(axis, slice(1, None))], step[_along(axis, slice(None, -1))])
        for part, length in ((first, step[first]), (last, step[last]), (middle, shorter)):
            np.maximum(longest[part], length, out=longest[part])
    longer_than = np.float32(VISIBILITY.sampling_margin) ** 2 * 4.0 ** np.arange(VISIBILITY.coarsest_level)
    at_points = longest.ravel()[points - low * x.shape[1]]
    levels: NDArray[np.uint8] = np.searchsorted(longer_than, at_points).astype(np.uint8)
    return levels


def _along(axis: int, part: slice) -> tuple[slice, ...]:
    """A part along one axis of an array."""
    return (*[slice(None)] * axis, part)


def _owners(contested: Contested, level: int, size: tuple[int, int]) -> NDArray[np.int32]:
    """For each cell of a level the nearest of the points of that level (indices), -1 where none is in it; of equally
    near ones the last. size (W, H): of the picture."""
    columns, rows = ((side >> level) + 1 for side in size)
    owner, near = np.full(rows * columns, -1, np.int32), contested.near
    for part in contested.parts:
        points = part.start + np.flatnonzero(contested.levels[part] == level)
        there = contested.cells(points, level, size)
        before = owner[there]
        least = (before < 0) | (near[points] >= near[before])
        points, there = points[least], there[least]
        while points.size:
            owner[there] = points  # of equal indices NumPy keeps the last
            more = near[points] > near[owner[there]]
            points, there = points[more], there[more]
    return owner


def _apart(
    picture_map: PictureMap, first: NDArray[np.intp], second: NDArray[np.intp], tolerance: float
) -> NDArray[np.bool_]:
    """Whether the map moves more than `tolerance` px away between two canvas points (flat indices) that it brings
    together: then they lie on two surfaces, else on one that is seen obliquely."""
    width = picture_map.x.shape[1]
    begin, end = (np.stack(np.divmod(points, width), axis=-1).astype(np.float32) for points in (first, second))
    home = np.stack([picture_map.x.ravel()[first], picture_map.y.ravel()[first]], axis=-1)
    out = np.zeros(first.size, bool)
    for share in VISIBILITY.between:
        at = begin + np.float32(share) * (end - begin)
        away = np.flatnonzero(~(_distance(home, picture_map, np.rint(at)) <= tolerance) & ~out)
        # rounded places lie beside the line between the two: those that matter are looked at again, exactly
        low = np.floor(at[away])
        u, v = np.moveaxis(at[away] - low, -1, 0)
        corners = ((0, 0, (1 - u) * (1 - v)), (0, 1, (1 - u) * v), (1, 0, u * (1 - v)), (1, 1, u * v))
        offset = np.sum([_offset(home[away], picture_map, low + (i, j), weight) for i, j, weight in corners], axis=0)
        out[away[~(np.hypot(*offset) <= tolerance)]] = True  # behind the camera is apart too
    return out


def _offset(
    home: NDArray[np.float32], picture_map: PictureMap, at: NDArray[np.float32],
    weight: NDArray[np.float32] | float = 1.0,
) -> NDArray[np.float32]:  # fmt: skip
    """How far (2, N) the map at canvas places (N, 2: row, column) lies from target pixels (N, 2), times a weight."""
    height, width = picture_map.x.shape
    index = np.minimum(at[:, 0].astype(np.intp), height - 1) * width + np.minimum(at[:, 1].astype(np.intp), width - 1)
    maps = (picture_map.x, picture_map.y)
    return np.stack([weight * (values.ravel()[index] - home[:, k]) for k, values in enumerate(maps)])


def _distance(home: NDArray[np.float32], picture_map: PictureMap, at: NDArray[np.float32]) -> NDArray[np.float32]:
    distance: NDArray[np.float32] = np.hypot(*_offset(home, picture_map, at))
    return distance
