"""Exposures of one view become one picture of floats (docs/method.md, 1).

Light is what a display-encoded level stands for, L, and an exposure e times as bright as the middle one shows L = e R
of the radiance R. With weights u that fall to 0 where an exposure clips and where it is too dark,

    R = sum u L / sum u e

weighs each exposure's R by u e: by its time, as its noise is worth. What moved between them is taken from one. Camera
RAW is merged as its sensor took it, and brought back to the scale that all of its set were developed to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture, picture_from_array
from ..raster.arrays import Array, strips
from ..raster.colour import decode
from ..system.threads import each
from .brackets import Bracket
from .exposures import SmallCopy, light_as_exposed, rows_as_exposed
from .options import BRACKETS, MERGE

Plane = NDArray[np.float32]


@dataclass(frozen=True)
class MergedBracket:
    """What became of the exposures of one view.

    Attributes
    ----------
    names : tuple of str
        Of the pictures, the darkest first.
    stops : tuple of float
        By how many each is brighter than the middle one, whose light is kept.
    clipped, moved : float
        Shares of the picture that are white even in the darkest exposure, and that are taken from one since something
        moved there.
    shift : float
        How far a corner moves between two of them, as a share of the diagonal; 0 where nothing was aligned.
    """

    names: tuple[str, ...]
    stops: tuple[float, ...]
    clipped: float
    moved: float
    shift: float


@dataclass(frozen=True, eq=False)
class _Exposure:
    """One of them at the working size, as the middle one lies: how bright its brightest channel is (h, w), display-
    encoded; where (h, w) it shows anything; and how much brighter it is than the middle one."""

    level: NDArray[np.uint8]
    inside: NDArray[np.bool_]
    gain: float

    @property
    def well_exposed(self) -> NDArray[np.bool_]:
        """Where (h, w) it counts fully."""
        low, high = 255 * MERGE.darkness[1], 255 * MERGE.clipping[0]
        return self.inside & (self.level >= low) & (self.level <= high)

    def radiance(self) -> Plane:
        """What it shows (h, w) in the light of the middle one."""
        light: Plane = decode(self.level[..., None])[..., 0]
        return np.maximum(light, np.float32(_DARKEST)) / np.float32(self.gain)


# light of half the first level of 255
_DARKEST = 0.5 / 255 / 12.92


def merged(pictures: Sequence[Picture], bracket: Bracket) -> tuple[Picture, MergedBracket]:
    """The picture of a bracket: floats in the light of the middle exposure, with its name, EXIF and profile."""
    taken = [pictures[number] for number in bracket.numbers]
    gains = [2.0**stops for stops in bracket.stops]
    small = [_at_working_size(*one) for one in zip(taken, bracket.homographies, gains, strict=True)]
    chosen = _chosen_where_moved(small, bracket.middle)
    middle = taken[bracket.middle]
    light = np.zeros(middle.light.shape, np.float32)
    weights = np.zeros(light.shape[:2], np.float32)
    for place, (one, homography, gain) in enumerate(zip(taken, bracket.homographies, gains, strict=True)):
        counts = (chosen < 0) | (chosen == place)
        share = None if counts.all() else cv2.GaussianBlur(counts.astype(np.float32), (0, 0), MERGE.moved_edge_px)
        ends = place == 0, place == len(taken) - 1
        _add(light, weights, one, homography, gain, ends, share)
    # where none counts, the middle one does
    _add(light, weights, middle, np.eye(3), 1.0, (True, True), np.full((1, 1), MERGE.last_resort, np.float32))
    to_scale = np.float32(middle.clips_at if middle.is_raw else 1)
    each(lambda rows: np.multiply(light[rows], (to_scale / weights[rows])[..., None], out=light[rows]),
         strips(light.shape))  # fmt: skip
    warnings = tuple(dict.fromkeys(warning for one in taken for warning in one.warnings))
    # the middle one best shows what it is, where no file says it
    part, circle = (
        next((found for one in (middle, *taken) if (found := getattr(one, name)) is not None), None)
        for name in ("part", "circle")
    )
    made = replace(
        picture_from_array(light, middle.name), exif=middle.exif, icc=middle.icc, warnings=warnings, part=part,
        circle=circle,
    )  # fmt: skip
    if middle.is_raw:
        made = replace(made, clips_at=middle.clips_at / gains[0])
    is_still = all(_is_still(homography) for homography in bracket.homographies)
    return made, MergedBracket(
        tuple(one.name for one in taken), bracket.stops,
        float((small[0].inside & (small[0].level >= 255 * MERGE.clipped)).mean()), float((chosen >= 0).mean()),
        0.0 if is_still else bracket.shift,
    )  # fmt: skip


def _is_still(homography: Array) -> bool:
    return bool(np.array_equal(homography, np.eye(3)))


def _at_working_size(picture: Picture, homography: Array, gain: float) -> _Exposure:
    """An exposure at the working size; homography: from px of the full middle one to its own."""
    copy = SmallCopy.of(picture, BRACKETS.working_px)
    level = copy.levels.max(axis=2)
    if _is_still(homography):
        return _Exposure(level, np.ones(level.shape, bool), gain)
    small = np.diag([copy.scale, copy.scale, 1.0])
    moved = small @ homography @ np.linalg.inv(small)
    inside = _warped(np.ones(level.shape, np.float32), moved) > 0.999
    return _Exposure(_warped(level, moved), inside, gain)


def _warped(values: NDArray[Any], homography: Array, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """Values (h, w[, C]) of an exposure where the middle one's px lie; 0 beyond its border. size: (W, H) px of what
    is asked for, that of the values by default."""
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped: NDArray[Any] = cv2.warpPerspective(values, homography, size or values.shape[1::-1], flags=flags)
    return warped


def _add(
    light: Plane, weights: Plane, picture: Picture, homography: Array, gain: float, ends: tuple[bool, bool],
    share: Plane | None,
) -> None:  # fmt: skip
    """Adds an exposure's u L to light (H, W, C) and its u e to weights (H, W).

    ends: whether it is the darkest, which counts however bright, and the brightest, which counts however dark; share:
    of its weight (h, w) that is left, at any size.
    """
    height, width = weights.shape

    def of_rows(rows: slice) -> tuple[Plane, Plane]:
        level = rows_as_exposed(picture, rows).max(axis=2).astype(np.float32) / np.float32(255)
        weight = np.ones_like(level)
        if not ends[0]:
            weight *= 1 - _step(level, *MERGE.clipping)
        if not ends[1]:
            weight *= _step(level, *MERGE.darkness)
        return light_as_exposed(picture, rows) * weight[..., None], weight

    is_still = _is_still(homography)
    left = None if share is None else cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR)

    def put(rows: slice) -> None:
        shown, weight = of_rows(rows) if is_still else _resampled(of_rows, rows, homography, light.shape)
        if left is not None:
            shown, weight = shown * left[rows][..., None], weight * left[rows]
        light[rows] += shown
        weights[rows] += np.float32(gain) * weight

    each(put, strips(light.shape))


def _resampled(
    of_rows: Callable[[slice], tuple[Plane, Plane]], rows: slice, homography: Array, shape: tuple[int, ...]
) -> tuple[Plane, Plane]:  # fmt: skip
    """What `of_rows` gives (h, W, C) and (h, W) of an exposure, where rows of the middle one (H, W, C) lie in it; no
    more of its rows are asked for than these show."""
    height, width, channels = shape
    corners = np.array([[x, y] for y in (rows.start, rows.stop - 1) for x in (0, width - 1)], np.float64)
    there = cv2.perspectiveTransform(corners[:, None], homography)[:, 0, 1]
    # bilinear: a row more on either side, and one for what is rounded
    top, bottom = (int(np.clip(y, 0, height)) for y in (np.floor(there.min()) - 2, np.ceil(there.max()) + 3))
    if top >= bottom:
        return np.zeros((rows.stop - rows.start, width, channels), np.float32), np.zeros(
            (rows.stop - rows.start, width), np.float32)  # fmt: skip
    shown, weight = of_rows(slice(top, bottom))
    from_top, to_rows = np.eye(3), np.eye(3)
    from_top[1, 2], to_rows[1, 2] = -top, rows.start
    size = width, rows.stop - rows.start
    both = _warped(np.dstack([shown, weight]), from_top @ homography @ to_rows, size)
    return both[..., :channels], both[..., channels]


def _step(values: Plane, low: float, high: float) -> Plane:
    """0 up to low, 1 from high on, smooth between."""
    part = np.clip((values - np.float32(low)) / np.float32(high - low), 0, 1)
    return part * part * (3 - 2 * part)


def _chosen_where_moved(exposures: Sequence[_Exposure], middle: int) -> NDArray[np.int8]:
    """Which exposure (h, w), by its place, each pixel is taken from since something moved there; −1 where nothing
    did."""
    moved = np.logical_or.reduce([_differ(darker, brighter) for darker, brighter in pairwise(exposures)])
    small = cv2.morphologyEx(moved.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(small)
    large = stats[:, cv2.CC_STAT_AREA] >= MERGE.least_moved * small.size
    large[0] = False
    margin = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * MERGE.moved_margin_px + 1,) * 2)
    count, things = cv2.connectedComponents(cv2.dilate(large[labels].astype(np.uint8), margin))
    area = np.bincount(things.ravel(), minlength=count)
    shows = np.stack([np.bincount(things.ravel(), one.well_exposed.ravel(), count) / np.maximum(area, 1)
                      for one in exposures])  # fmt: skip
    best = np.where(shows[middle] >= MERGE.well_exposed, middle, shows.argmax(axis=0)).astype(np.int8)
    best[0] = -1
    chosen: NDArray[np.int8] = best[things]
    return chosen


def _differ(darker: _Exposure, brighter: _Exposure) -> NDArray[np.bool_]:
    """Where (h, w) two exposures show what one thing cannot be, whatever lies around it within a pixel."""
    one, other = np.log2(darker.radiance()), np.log2(brighter.radiance())
    well = darker.well_exposed & brighter.well_exposed
    one = one + _usual_difference(darker.level[well], (other - one)[well])[darker.level]
    # what is dark in the darker one says how bright it is at most, what is bright in the brighter one at least
    is_black = darker.level < 255 * MERGE.darkness[1]
    is_white = brighter.level > 255 * MERGE.clipping[0]
    least = np.log2(decode(np.array([[[255 * MERGE.darkness[1]]]]).astype(np.uint8))[0, 0, 0] / darker.gain)
    one = np.where(is_black, np.float32(least), one)
    around, most = np.ones((3, 3), np.uint8), np.float32(MERGE.moved_stops)
    is_too_bright = other - cv2.dilate(one, around) > most
    is_too_dark = cv2.erode(one, around) - other > most
    said = (darker.well_exposed | is_black) & (brighter.well_exposed | is_white)
    differ: NDArray[np.bool_] = darker.inside & brighter.inside & ((is_too_bright & said) | (is_too_dark & well))
    return differ


def _usual_difference(levels: NDArray[np.uint8], stops: Plane) -> Plane:
    """What two exposures usually differ by, stops, for each level (256,) of the first, by the camera's curve: a
    parabola, which nothing that moved bends."""
    steps = MERGE.compared_levels
    step_of = levels.astype(int) * steps // 256
    found = [(step, stops[step_of == step]) for step in range(steps)]
    known = [(step, np.median(values), len(values)) for step, values in found if len(values) >= MERGE.least_compared]
    if len(known) < 3:
        return np.zeros(256, np.float32)
    at, medians, counts = np.array(known, np.float64).T
    basis = np.vander((at + 0.5) / steps, 3)
    fitted = np.full(len(at), np.median(stops))
    for _ in range(MERGE.curve_rounds):
        weight = np.sqrt(counts / (1 + ((medians - fitted) / MERGE.curve_stops) ** 2))
        parabola = np.linalg.lstsq(basis * weight[:, None], medians * weight, rcond=None)[0]
        fitted = basis @ parabola
    reach = np.clip(np.arange(256) / 256, (at[0] + 0.5) / steps, (at[-1] + 0.5) / steps)
    return np.asarray(np.vander(reach, 3) @ parabola, np.float32)
