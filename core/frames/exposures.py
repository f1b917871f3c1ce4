"""Two exposures of one view: how much brighter one of them is, and where its pixels lie in the other.

Finished pictures show by how much. Camera RAW was developed to one scale for all pictures and looks alike however it
was exposed: its light divided by that at which it clips is what the sensor took, and that is compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..pictures.picture import Picture
from ..raster.arrays import Array, strips
from ..raster.colour import decode, encode
from ..system.threads import each
from .options import BRACKETS


@dataclass(frozen=True, eq=False)
class SmallCopy:
    """A picture at the size that exposures are compared at.

    Attributes
    ----------
    levels : ndarray (h, w, C) uint8
        Display-encoded.
    scale : float
        Of its sides.
    """

    levels: NDArray[np.uint8]
    scale: float

    @staticmethod
    def of(picture: Picture, longest_px: int) -> SmallCopy:
        """The copy of a picture as it was exposed, at most so many px along its longer side."""
        view = view_as_exposed(picture)
        height, width = view.shape[:2]
        scale = min(1.0, longest_px / max(width, height))
        size = max(1, round(width * scale)), max(1, round(height * scale))
        small = view if scale == 1 else cv2.resize(view, size, interpolation=cv2.INTER_AREA)
        return SmallCopy(small.reshape(size[1], size[0], -1), scale)

    @cached_property
    def brightest(self) -> NDArray[np.float32]:
        """Share of white (h, w), display-encoded, of the brightest channel."""
        brightest: NDArray[np.float32] = self.levels.max(axis=2).astype(np.float32) / np.float32(255)
        return brightest

    @cached_property
    def gray(self) -> NDArray[np.float32]:
        """Light (h, w) of all channels together."""
        light: NDArray[np.float32] = decode(self.levels).mean(axis=2, dtype=np.float32)
        return light

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Where (h, w) it is neither too dark nor too bright to say how bright things are."""
        low, high = BRACKETS.usable
        usable: NDArray[np.bool_] = (self.levels.min(axis=2) >= low * 255) & (self.brightest <= high)
        return usable


@dataclass(frozen=True, eq=False)
class Relation:
    """How two exposures of one view lie to each other.

    Attributes
    ----------
    stops : float
        By how many the second is brighter.
    homography : (3, 3) array
        From px of the first to px of the second, of the full pictures; the identity where nothing moved.
    shift : float
        How far a corner moves at most, as a share of the diagonal.
    """

    stops: float
    homography: Array
    shift: float


def light_as_exposed(picture: Picture, rows: slice) -> NDArray[np.float32]:
    """Light (h, W, C) of rows of a picture as its sensor took it: white is 1."""
    light: NDArray[np.float32] = picture.light[rows, 0 : picture.light.shape[1]]
    return light * np.float32(1 / picture.clips_at) if picture.is_raw else light


def rows_as_exposed(picture: Picture, rows: slice) -> NDArray[np.uint8]:
    """Display-encoded levels (h, W, C) of the same."""
    levels: NDArray[np.uint8] = encode(light_as_exposed(picture, rows), 8) if picture.is_raw else picture.view[rows]
    return levels


def view_as_exposed(picture: Picture) -> NDArray[np.uint8]:
    """All of them (H, W, C)."""
    if not picture.is_raw:
        return picture.view
    levels = np.empty(picture.light.shape, np.uint8)

    def put(rows: slice) -> None:
        levels[rows] = rows_as_exposed(picture, rows)

    each(put, strips(levels.shape))
    return levels


def stops_told(picture: Picture) -> float | None:
    """How much light an exposure takes in by its EXIF, in stops from one second at f/1 and ISO 100; None where it does
    not say. Of camera RAW, in stops from the picture that all were developed like."""
    if picture.is_raw:
        return -float(np.log2(picture.clips_at))
    seconds, stop, speed = (picture.exif.number(tag) for tag in (33434, 33437, 34855))
    if not seconds > 0:
        return None
    stop, speed = stop if stop > 0 else 1.0, speed if speed > 0 else 100.0
    return float(np.log2(seconds / stop**2 * speed / 100))


def relation_of(
    first: SmallCopy, second: SmallCopy, told: float | None, given: bool = False
) -> tuple[Relation | None, str]:
    """How two exposures lie to each other; or None, and why they are not two of one view.

    told: by how many stops the second is brighter by what both say of themselves; given: the user says that they show
    one view.
    """
    if first.levels.shape != second.levels.shape:
        return None, "their sizes differ"
    seen = _stops_seen(first, second)
    stops = seen if seen is not None else told
    if stops is None:
        return None, "no part of the view is well exposed in both"
    homography, share = _homography(first, second, stops)
    aligned = None if homography is None else _stops_seen(first, second, homography)
    if aligned is not None and abs(aligned - stops) > BRACKETS.same_stops:
        # what is compared where it does not lie is not equally bright, and white begins elsewhere
        stops = aligned
        homography, share = _homography(first, second, stops)
        aligned = None if homography is None else _stops_seen(first, second, homography)
    if homography is None:
        return None, "too few points are seen in both to tell whether they show one view"
    if share < (BRACKETS.least_inliers_given if given else BRACKETS.least_inliers):
        return None, "they were not taken from one place, or most of what they show moved"
    moved = _corner_shift(homography, first)
    diagonal = float(np.hypot(first.levels.shape[0], first.levels.shape[1]))
    most = BRACKETS.most_shift_given if given else BRACKETS.most_shift
    if moved > most * diagonal:
        return None, f"the camera turned between them by {moved / diagonal:.0%} of the picture"
    seen = stops if aligned is None else aligned
    stops = told if told is not None and abs(seen - told) > BRACKETS.exif_agrees else seen
    full = np.diag([first.scale, first.scale, 1.0])
    return Relation(stops, np.linalg.inv(full) @ homography @ full, moved / diagonal), ""


def _stops_seen(first: SmallCopy, second: SmallCopy, homography: Array | None = None) -> float | None:
    """By how many stops the second is brighter, as seen where both are well exposed; None where hardly any is.

    homography: from the first's px to the second's; None, or the identity: it has not moved.
    """
    brighter, usable = second.gray, second.usable
    if homography is not None and not np.array_equal(homography, np.eye(3)):
        size = first.gray.shape[::-1]
        brighter, there = (
            cv2.warpPerspective(one, homography, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
            for one in (second.gray, second.usable.astype(np.float32))
        )
        usable = there > 0.999
    both = first.usable & usable
    if both.mean() < BRACKETS.least_usable:
        return None
    # means of light are the same whether one picture is a little softer or lies a little beside the other
    window = (BRACKETS.mean_px, BRACKETS.mean_px)
    share, one, other = (cv2.blur(values * both, window) for values in (np.float32(1), first.gray, brighter))
    shown = share >= BRACKETS.mean_share
    if shown.mean() < BRACKETS.least_usable:
        shown, one, other = both, first.gray, brighter
    return float(np.median(np.log2(other[shown] / one[shown])))


def _homography(first: SmallCopy, second: SmallCopy, stops: float) -> tuple[Array | None, float]:
    """From px of the first to px of the second at their own size, by points that are followed from one to the other,
    and the share of these that it explains; None where there are too few. stops: by how many the second is brighter."""
    # the light of each as in an exposure half-way between both, and what is white in the brighter one as white in
    # both, so that the same thing looks the same
    gain = 2.0 ** (stops / 2)
    white = np.float32(min(gain, 1 / gain))
    one, other = (encode(np.minimum(copy.gray[..., None] * np.float32(by), white), 8)[..., 0]
                  for copy, by in ((first, gain), (second, 1 / gain)))  # fmt: skip
    points = cv2.goodFeaturesToTrack(one, BRACKETS.most_points, BRACKETS.point_quality, BRACKETS.point_distance_px)
    if points is not None and len(points) >= BRACKETS.least_points:
        there, back = _followed(one, other, points)
        kept = back < BRACKETS.back_px
        if kept.sum() >= BRACKETS.least_points:
            return _explained(points[kept], there[kept])
    median, high = BRACKETS.blank_levels
    both = first.usable & second.usable
    if both.mean() >= BRACKETS.least_usable:
        apart = np.abs(one.astype(np.int16) - other)[both]
        if np.median(apart) <= median and np.percentile(apart, 90) <= high:
            return np.eye(3), 1.0
    return None, 0.0


def _followed(one: NDArray[np.uint8], other: NDArray[np.uint8], points: Array) -> tuple[Array, Array]:
    """Where points (N, 1, 2) of one picture lie in the other, and how far from themselves (N,) they come back."""
    window = {"winSize": (BRACKETS.window_px, BRACKETS.window_px), "maxLevel": BRACKETS.levels}
    there, found, _ = cv2.calcOpticalFlowPyrLK(one, other, points, None, **window)
    again, found_again, _ = cv2.calcOpticalFlowPyrLK(other, one, there, None, **window)
    missed = np.linalg.norm((again - points)[:, 0], axis=1)
    return there, np.where((found & found_again)[:, 0] > 0, missed, np.inf)


def _explained(points: Array, there: Array) -> tuple[Array | None, float]:
    """The homography between points (N, 1, 2), the identity where half of them stand still, and the share that it
    explains."""
    moved = np.linalg.norm((there - points)[:, 0], axis=1)
    if np.median(moved) < BRACKETS.still_px:
        return np.eye(3), float((moved < BRACKETS.inlier_px).mean())
    homography, _ = cv2.findHomography(points, there, cv2.RANSAC, BRACKETS.inlier_px)
    if homography is None:
        return None, 0.0
    # the inliers that are told belong to a sample, before the homography was fitted to all of them
    off = np.linalg.norm((cv2.perspectiveTransform(points, homography) - there)[:, 0], axis=1)
    return homography, float((off < BRACKETS.inlier_px).mean())


def _corner_shift(homography: Array, copy: SmallCopy) -> float:
    """px by which a corner of the picture moves at most."""
    height, width = copy.levels.shape[:2]
    corners = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], np.float64)[:, None]
    moved = cv2.perspectiveTransform(corners, homography) - corners
    return float(np.linalg.norm(moved, axis=2).max())
