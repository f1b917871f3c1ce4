"""Filling holes that no camera saw: smoothly, from what lies behind. No detail is invented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..panorama.layers import Layer
from ..raster.arrays import Box, Part, dilated, meet, strips
from ..raster.lazy import AnyImage, LazyImage
from ..raster.log_encoding import log_decode, log_encode
from ..raster.pull_push import filled
from .options import INPAINT


def holes_of(hidden: NDArray[np.bool_], before: Layer, layer: Layer) -> NDArray[np.bool_]:
    """Where (H, W) no camera saw anything: hidden (H, W) from the added picture, not shown by the panorama before."""
    holes: NDArray[np.bool_] = hidden & (before.alpha == 0) & (layer.alpha > 0)
    return holes


def closed_holes(
    shows: NDArray[np.bool_], small: bool | None, goes_round: bool = False
) -> tuple[NDArray[np.bool_], list[Box]]:
    """Holes of a panorama that do not reach its border.

    Parameters
    ----------
    shows : (H, W) bool array
        What the panorama shows.
    small : bool or None
        Only those of at most `InpaintOptions.small_share` of it, or only those that are larger; None: all.
    goes_round : bool
        Whether the last column lies beside the first, so that neither is a border.

    Returns
    -------
    holes : (H, W) bool array
    boxes : list of Box
        That hold each of them, px, the largest hole first; one that lies across the ends has a box at either.
    """
    height = len(shows)
    count, number, about, _ = cv2.connectedComponentsWithStats((~shows).view(np.uint8), connectivity=4)
    left, top, across, down, area = about.T
    within = (top > 0) & (top + down < height)
    if goes_round:
        ends = number[:, 0], number[:, -1]
        both = (ends[0] > 0) & (ends[1] > 0)
        # int32 is what SciPy's graphs take
        pairs = tuple(one[both].astype(np.int32) for one in ends)
        joined = connected_components(coo_array((np.ones(both.sum()), pairs), (count, count)), directed=False)[1]
        within = ~np.isin(joined, joined[~within & (np.arange(count) > 0)])
        area = np.bincount(joined, area)[joined].astype(int)
    else:
        within &= (left > 0) & (left + across < shows.shape[1])
    picked = within if small is None else within & ((area <= INPAINT.small_share * shows.size) == small)
    picked[0] = False  # what is shown
    largest_first = about[picked][np.argsort(-area[picked], kind="stable")].tolist()
    boxes = [(x, y, w, h) for x, y, w, h, _ in largest_first]
    holes = np.zeros_like(shows)
    if picked.any():
        for rows in strips(holes.shape):  # NumPy makes eight bytes of each number
            holes[rows] = picked[number[rows]]
    return holes, boxes


def fillable_holes(panorama: Layer, goes_round: bool) -> NDArray[np.bool_]:
    """Closed holes (H, W) that are hardly seen once filled: small ones, and larger ones in plain surroundings, as a sky
    has; goes_round: see `closed_holes`."""
    shows = panorama.alpha > 0
    holes, large = (closed_holes(shows, small, goes_round)[0] for small in (True, False))
    count, number, about, _ = cv2.connectedComponentsWithStats(large.view(np.uint8), connectivity=4)
    reach = INPAINT.reach_px
    for one in range(1, count):
        left, top, width, height, area = about[one].tolist()
        if area > INPAINT.plain_share * shows.size:
            continue
        box = slice(max(0, top - reach), top + height + reach), slice(max(0, left - reach), left + width + reach)
        missing = number[box] == one
        if _plain(panorama.light[box], dilated(missing, reach) & shows[box]):
            holes[box] |= missing
    return holes


def _plain(light: NDArray[np.float32], beside: NDArray[np.bool_]) -> bool:
    """Whether the tones of light (h, w, C) rise and fall as a plane does where `beside` (h, w) is true."""
    places = np.argwhere(beside)
    plane = np.column_stack([places - places.mean(axis=0), np.ones(len(places))])
    tones = log_encode(light[beside]).astype(np.float64)
    left_over = np.abs(tones - plane @ np.linalg.lstsq(plane, tones, rcond=None)[0])
    return bool(np.percentile(left_over, INPAINT.plain_percentile) <= INPAINT.plain_tones)


def inpainted(panorama: Layer, holes: NDArray[np.bool_], inverse_depth: AnyImage) -> Layer:
    """Fill holes with a smooth continuation of what lies around them, opaque; all other pixels keep their bits.

    Parameters
    ----------
    panorama : Layer
    holes : (H, W) bool array
        What is filled.
    inverse_depth : (H, W) image
        Of the canvas, 1 / baseline. Something near hid the hole, so it is filled from what lies further away than
        halfway to that.

    Returns
    -------
    Layer
    """
    if not holes.any():
        return panorama
    # holes near each other are filled together, from what lies around them all
    count, number, about, _ = cv2.connectedComponentsWithStats(dilated(holes, INPAINT.reach_px).view(np.uint8))
    alpha, patches = panorama.alpha.copy(), []
    for one in range(1, count):
        left, top, width, height = about[one][:4]
        box = slice(top, top + height), slice(left, left + width)
        missing = holes[box] & (number[box] == one)
        beside = dilated(missing, INPAINT.reach_px) & ~missing & (panorama.alpha[box] > 0)
        far = _far(inverse_depth[box], missing, beside)
        weight = beside * np.where(far, np.float32(1), np.float32(INPAINT.near_weight))
        tones = filled(log_encode(panorama.light[box]), weight)
        alpha[box][missing] = 1
        patches.append(Patch((int(top), int(left)), missing, log_decode(tones)))
    return Layer(Patched(panorama.light, tuple(patches)), alpha)


def _far(inverse_depth: NDArray[Any], missing: NDArray[np.bool_], beside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where (h, w) depth lies beyond the middle between the hole's own and the nearest that lies `beside` it."""
    depth = np.nan_to_num(inverse_depth).astype(np.float32)
    behind = filled(depth[..., None], missing.astype(np.float32))[..., 0]
    side = 2 * INPAINT.reach_px + 1
    nearest = cv2.dilate(np.where(beside, depth, depth.min()).astype(np.float32), np.ones((side, side), np.uint8))
    far: NDArray[np.bool_] = depth <= (behind + np.maximum(nearest, behind)) / 2
    return far


@dataclass(frozen=True, eq=False)
class Patch:
    """Light (h, w, C) for the pixels that are touched (h, w), from `at` (row, column) on."""

    at: tuple[int, int]
    touched: NDArray[np.bool_]
    light: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Patched(LazyImage):
    """Light with patches, none of which touches another's pixels."""

    light: AnyImage
    patches: tuple[Patch, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W, C)."""
        return self.light.shape

    def __getitem__(self, part: Part) -> NDArray[np.float32]:
        before = out = self.light[part]
        for patch in self.patches:
            meeting = meet(part, self.shape, patch.at, patch.touched.shape)
            if meeting is None:
                continue
            here, there = meeting
            if out is before:
                out = before.copy()
            touched = patch.touched[there]
            out[here][touched] = patch.light[there][touched]
        return out
