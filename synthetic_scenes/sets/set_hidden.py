"""Whether what a stitch says is hidden from its pictures is hidden, by each camera's own depth."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import Array
from ...core.raster.sampling import fetch
from ..ground_truth import SAME_DEPTH
from .set_measures import Found
from .sphere_truth import seen_by


def hidden_figures(found: Found) -> dict[str, float]:
    """hidden_precision: share of what is said to be hidden that is; hidden_recall: share of what is hidden, and what
    another picture sees, that is said to be; hidden_recall_all: the same of what no other picture sees too, which a
    stitch goes on to show, for there is nothing else to show there. All of what `certain` tells, where maps show
    something; NaN of nothing."""
    rendered, views = found.truth.rendered, found.truth.views_at(found.numbers).ravel()
    at = found.on_maps().reshape(-1, 2)
    right = said_all = of_others = among = hidden_all = 0
    for order, number in enumerate(found.numbers):
        camera, index = rendered.cameras[number], found.truth.seen[number].index
        directions, distance = found.truth.directions.reshape(-1, 3)[index], rendered.distance.ravel()[index]
        pixels, there = seen_by(camera, rendered.sphere, directions, distance)
        hidden, visible = certain(pixels, there, rendered.depths[number])
        x, y = at[index].astype(np.float32).T[:, None]
        said = fetch(found.result.occluded[order].astype(np.uint8)[..., None], x, y, cv2.INTER_NEAREST)[0, :, 0] > 0
        shown = np.isfinite(found.result.warp.maps[order].arrays().between(at[index])).all(axis=1)
        hidden, visible = hidden & shown, visible & shown
        elsewhere = hidden & (views[index] > 0)
        right, said_all = right + int((said & hidden).sum()), said_all + int((said & (hidden | visible)).sum())
        of_others, among = of_others + int((said & elsewhere).sum()), among + int(elsewhere.sum())
        hidden_all += int(hidden.sum())
    return {
        "hidden_precision": right / said_all if said_all else math.nan,
        "hidden_recall": of_others / among if among else math.nan,
        "hidden_recall_all": right / hidden_all if hidden_all else math.nan,
    }


def certain(pixels: Array, there: Array, depth: NDArray[np.float32]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which points (N,) are hidden from a camera, and which are seen by it, as far as its depth (H, W) tells.

    Depth is known at the middles of its pixels only: where the four around a point do not agree, the outline of
    something near passes between them, and the point counts as neither. pixels (N, 2), there (N,): where the camera
    would see the points, within its frame, and how deep.
    """
    inverse = (1.0 / depth).astype(np.float32)
    square, anchor = np.ones((2, 2), np.uint8), (0, 0)
    farthest, nearest = (how(inverse, square, anchor=anchor) for how in (cv2.erode, cv2.dilate))
    column, row = np.floor(pixels).astype(np.intp).T
    with np.errstate(divide="ignore"):
        own = 1.0 / there
    hidden: NDArray[np.bool_] = own < (1 - SAME_DEPTH) * farthest[row, column] - 1e-9
    seen: NDArray[np.bool_] = own >= (1 - SAME_DEPTH) * nearest[row, column] - 1e-9
    return hidden, seen
