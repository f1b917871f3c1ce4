"""Things that moved between the pictures, people above all, and from which picture each is to be shown.

A place where something moved looks different in both pictures, though they agree all around it, and is wider than what
parallax could hide there. Each such place is shown from the picture whose own part of the panorama lies nearer. So
nobody is cut in two, and nobody is seen twice unless he walked past the middle of the overlap.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...panorama.layers import Layer
from ...raster.arrays import dilated
from ...raster.distance import distance_inside, distance_to_border
from ...raster.picture_map import PictureMap
from ..options import MOVING_THINGS
from .min_cut import FIRST, SECOND
from .overlap import Overlap


def moving_labels(
    overlap: Overlap, picture_map: PictureMap, before: Layer, layer: Layer, hidden: NDArray[np.bool_]
) -> NDArray[np.int8]:
    """From which picture what moved is to be shown.

    Parameters
    ----------
    overlap : Overlap
        Of `before` and `layer`.
    picture_map : PictureMap
        Of the added picture, over the whole canvas.
    before, layer : Layer
        The panorama before, and the added picture's layer.
    hidden : (H, W) bool array
        What the added picture cannot see.

    Returns
    -------
    (h, w) int8 array
        In the overlap's box: FIRST from the panorama before, SECOND from the added picture, FREE where nothing moved.
    """
    rows, columns = overlap.box
    step = -(-max(overlap.both.shape) // MOVING_THINGS.side_cells)
    size = tuple(-(-side // step) for side in overlap.both.shape[::-1])
    # a cell has a property that holds for most of its pixels
    both, unseen = (
        cv2.resize(np.ascontiguousarray(part).view(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
        for part in (overlap.both, hidden[overlap.box])
    )
    visible = both & ~dilated(unseen, 1)
    difference = cv2.resize(overlap.difference, size, interpolation=cv2.INTER_AREA).reshape(*size[::-1], -1)
    largest = np.abs(cv2.blur(difference, (3, 3)).reshape(difference.shape)).max(axis=2)
    same = both & (largest < MOVING_THINGS.max_same_difference)
    apart = (visible & (largest > MOVING_THINGS.min_difference)).astype(np.uint8)
    thin, around = MOVING_THINGS.min_width_cells, MOVING_THINGS.surroundings_cells
    things = cv2.morphologyEx(apart, cv2.MORPH_OPEN, np.ones((thin, thin), np.uint8))
    # parts of one thing are joined, such as head and legs of somebody of whom both pictures seem to show the belt
    joined = cv2.morphologyEx(things, cv2.MORPH_CLOSE, np.ones((MOVING_THINGS.joined_rows, around), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    here = np.s_[rows.start : rows.stop : step, columns.start : columns.stop : step]
    moves = [values[here] for values in (picture_map.x, picture_map.y)]
    shows_before, shows = before.alpha[::step, ::step] > 0, layer.alpha[::step, ::step] > 0
    distances = [distance_inside(~alone) for alone in (shows_before & ~shows, shows & ~shows_before)]
    distances = [_in_box(values, (rows.start // step, columns.start // step), size) for values in distances]

    out = np.zeros(labels.shape, np.int8)
    for label in range(1, count):
        left, top, width, height, area = stats[label]
        if area > MOVING_THINGS.max_area * both.sum():
            continue
        part = np.s_[max(0, top - around) : top + height + around, max(0, left - around) : left + width + around]
        thing = labels[part] == label
        if _has_moved(thing, both[part], same[part], [values[part] for values in moves], step):
            whole = dilated(thing, 1)
            # where a picture shows nothing alone, its distances are too large to be added in float32
            far_before, far = (float(np.median(values[part][thing].astype(np.float64))) for values in distances)
            out[part][whole & both[part]] = SECOND if far < far_before else FIRST
    full: NDArray[np.int8] = cv2.resize(out, overlap.both.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return full * overlap.both


def _has_moved(
    thing: NDArray[np.bool_], both: NDArray[np.bool_], same: NDArray[np.bool_], moves: list[NDArray[np.float32]],
    step: int,
) -> bool:
    """Whether the pictures agree all around a thing (h, w), with little parallax there: then it moved.

    moves: x and y (h, w) px of the added picture at each cell; step: canvas px of a cell's side.
    """
    around = MOVING_THINGS.surroundings_cells
    ring = dilated(thing, around) & ~thing & both
    agrees = ring & same
    if agrees.sum() < max(MOVING_THINGS.min_agreeing * ring.sum(), 3 * around):
        return False
    places = np.column_stack([*np.nonzero(agrees), np.ones(int(agrees.sum()))])
    targets = np.column_stack([values[agrees] for values in moves])
    if not np.isfinite(targets).all():
        return False
    residuals = targets - places @ np.linalg.lstsq(places, targets, rcond=None)[0]
    parallax = np.hypot(*np.ptp(residuals, axis=0)) / step
    width = 2 * float(distance_to_border(thing).max())
    return bool(width > MOVING_THINGS.min_widths_of_parallax * parallax)


def _in_box(values: NDArray[np.float32], corner: tuple[int, int], size: tuple[int, ...]) -> NDArray[np.float32]:
    """Cells of a canvas in a box with this first (row, column) and size (w, h), repeated beyond the canvas's end."""
    part = values[corner[0] : corner[0] + size[1], corner[1] : corner[1] + size[0]]
    return np.pad(part, [(0, size[1] - part.shape[0]), (0, size[0] - part.shape[1])], mode="edge")
