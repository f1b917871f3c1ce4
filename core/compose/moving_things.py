"""What moved between the two pictures, people above all, and at whose time it is to be seen.

Things that moved look different though all round them the pictures agree, and are wider than what parallax could hide
there. A panorama shows the time of one picture on one side and of the other on the other. Nearer to what the added
picture alone shows a thing belongs to its time, and else to that of the panorama before: so nobody is cut in two, nor
seen twice by walking over the seam, unless he walked past the middle of the overlap.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..panorama.layers import Layer
from ..raster.arrays import dilated
from ..raster.distance import distance_inside, distance_to_border
from ..raster.picture_map import PictureMap
from .options import MOVING_THINGS
from .overlap import Overlap


def times(
    overlap: Overlap, picture_map: PictureMap, before: Layer, layer: Layer, hidden: NDArray[np.bool_]
) -> NDArray[np.int8]:
    """Of what moved, at whose time it is to be seen (h, w), in the overlap's box: -1 at that of the panorama before, 1
    at that of the picture that is added; 0 where nothing moved. picture_map: the added picture's; hidden (H, W): what
    it cannot see."""
    rows, columns = overlap.box
    step = -(-max(overlap.both.shape) // MOVING_THINGS.side_cells)
    size = tuple(-(-side // step) for side in overlap.both.shape[::-1])
    # of a cell what is true of most of it
    both, unseen = (
        cv2.resize(np.ascontiguousarray(part).view(np.uint8), size, interpolation=cv2.INTER_AREA) > 0
        for part in (overlap.both, hidden[overlap.box])
    )
    seen = both & ~dilated(unseen, 1)
    difference = cv2.resize(overlap.difference, size, interpolation=cv2.INTER_AREA).reshape(*size[::-1], -1)
    away = np.abs(cv2.blur(difference, (3, 3)).reshape(difference.shape)).max(axis=2)
    same = both & (away < MOVING_THINGS.max_same_difference)
    apart = (seen & (away > MOVING_THINGS.min_difference)).astype(np.uint8)
    thin, around = MOVING_THINGS.min_width_cells, MOVING_THINGS.surroundings_cells
    things = cv2.morphologyEx(apart, cv2.MORPH_OPEN, np.ones((thin, thin), np.uint8))
    # head and legs of one are one
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        cv2.morphologyEx(things, cv2.MORPH_CLOSE, np.ones((around, around), np.uint8)), connectivity=8
    )
    here = np.s_[rows.start : rows.stop : step, columns.start : columns.stop : step]
    moves = [values[here] for values in (picture_map.x, picture_map.y)]
    shows_before, shows = before.alpha[::step, ::step] > 0, layer.alpha[::step, ::step] > 0
    reach = [distance_inside(~alone) for alone in (shows_before & ~shows, shows & ~shows_before)]
    near = [_in_box(values, (rows.start // step, columns.start // step), size) for values in reach]

    out = np.zeros(labels.shape, np.int8)
    for label in range(1, count):
        left, top, width, height, area = stats[label]
        if area > MOVING_THINGS.max_area * both.sum():
            continue
        part = np.s_[max(0, top - around) : top + height + around, max(0, left - around) : left + width + around]
        thing = labels[part] == label
        if _moving(thing, both[part], same[part], [values[part] for values in moves], step):
            whole = dilated(thing, 1)
            far_before, far = (float(np.median(values[part][thing])) for values in near)
            out[part][whole & both[part]] = 1 if far < far_before else -1
    full: NDArray[np.int8] = cv2.resize(out, overlap.both.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return full * overlap.both


def _moving(
    thing: NDArray[np.bool_], both: NDArray[np.bool_], same: NDArray[np.bool_], moves: list[NDArray[np.float32]],
    step: int,
) -> bool:
    """Whether the pictures agree all round a thing (h, w), on one surface, or nearly: then it moved."""
    around = MOVING_THINGS.surroundings_cells
    ring = dilated(thing, around) & ~thing & both
    agrees = ring & same
    if agrees.sum() < max(MOVING_THINGS.min_agreeing * ring.sum(), 3 * around):
        return False
    places = np.column_stack([*np.nonzero(agrees), np.ones(int(agrees.sum()))])
    targets = np.column_stack([values[agrees] for values in moves])
    if not np.isfinite(targets).all():
        return False
    left_over = targets - places @ np.linalg.lstsq(places, targets, rcond=None)[0]
    parallax = np.hypot(*np.ptp(left_over, axis=0)) / step
    across = 2 * float(distance_to_border(thing).max())
    return bool(across > MOVING_THINGS.min_widths_of_parallax * parallax)


def _in_box(values: NDArray[np.float32], corner: tuple[int, int], size: tuple[int, ...]) -> NDArray[np.float32]:
    part = values[corner[0] : corner[0] + size[1], corner[1] : corner[1] + size[0]]
    return np.pad(part, [(0, size[1] - part.shape[0]), (0, size[0] - part.shape[1])], mode="edge")
