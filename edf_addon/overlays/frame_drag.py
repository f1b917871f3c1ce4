"""What dragging the frame of a panorama asks for: its crop, its middle and its horizon. From what a result keeps,
without a stitch. No bpy.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.cameras.projective import rotation_from_vector
from ...core.panorama.levelling import angles_of
from ...core.raster.arrays import Array
from ..scene.scene_geometry import projection_of

MIDDLE, HORIZON = "MIDDLE", "HORIZON"
# Each edge of a box [[left, top], [right, bottom]]: which end, and of which axis.
EDGES = {"LEFT": (0, 0), "TOP": (0, 1), "RIGHT": (1, 0), "BOTTOM": (1, 1)}
# px of the panorama that a crop keeps at least on either side.
LEAST = 16
# px by which a small panorama may be larger than the full one would be, shrunk.
ROUNDED = 2
# Share of the width on either side of the middle within which the horizon is moved, and beyond which it is turned.
MOVED = 0.25


def part_at(known: dict[str, Any], point: Array, within: float) -> str | None:
    """What lies at a px (2,) of a panorama, within so many px: edges ("LEFT", "LEFT TOP" and so on), HORIZON, MIDDLE;
    None outside."""
    size = _size(known)
    if (point < -within).any() or (point > size + within).any():
        return None
    ends = np.stack([np.zeros(2), size])
    edges = [name for name, (end, axis) in EDGES.items() if abs(point[axis] - ends[end, axis]) <= within]
    if edges:
        return " ".join(edges)
    row = horizon_row(known)
    return HORIZON if row is not None and abs(point[1] - row) <= within else MIDDLE


def horizon_row(known: dict[str, Any]) -> float | None:
    """The row of a panorama at which what is level with the viewpoint lies; None on the reference's own plane."""
    projection = projection_of(known)
    return None if projection is None else projection.centre[1]


def box_by(known: dict[str, Any], part: str, by: Array) -> list[int]:
    """The crop that dragging edges, or all of it, by px (2,) of a panorama asks for: left, top, width and height in px
    of the full one."""
    told, share = known["report"]["canvas"], float(known["share"])
    left, top, width, height = told["box"]
    ends = np.array([[left, top], [left + width, top + height]], np.float64)
    margin = 0.0 if share == 1 else float(ROUNDED)
    low, high = np.full(2, margin), np.array(told["whole"]) - margin
    if part == MIDDLE:
        ends += np.clip(by, np.minimum(low - ends[0], 0), np.maximum(high - ends[1], 0))
    for name, (end, axis) in EDGES.items():
        if name in part.split():
            other = ends[1 - end, axis]
            allowed = (low[axis], other - LEAST) if end == 0 else (other + LEAST, high[axis])
            ends[end, axis] = np.clip(ends[end, axis] + by[axis], *allowed)
    first, last = np.ceil(np.clip(ends[0], low, high) / share), np.floor(np.clip(ends[1], low, high) / share)
    return [int(one) for one in (*first, *(last - first))]


def shown_box(known: dict[str, Any], box: list[int]) -> Array:
    """Both ends (2, 2) px of a panorama of a crop in px of the full one."""
    left, top, width, height = (side * float(known["share"]) for side in box)
    own = known["report"]["canvas"]["box"]
    return np.array([[left, top], [left + width, top + height]]) - own[:2]


def centre_by(known: dict[str, Any], centre: tuple[float, float], by: Array) -> tuple[float, float]:
    """The frame's centre, radians to the right and up, after its middle was dragged by px (2,) of a panorama."""
    focal = float(known["report"]["canvas"]["projection"]["focal_px"])
    return centre[0] + by[0] / focal, centre[1] - by[1] / focal


def horizon_by(known: dict[str, Any], start: Array, end: Array) -> Array:
    """Two points (2, 2) px, from left to right, of the horizon that was dragged from one px to another: up or down in
    the middle, around the middle at its ends."""
    width = _size(known)[0]
    middle = np.array([(width - 1) / 2, horizon_row(known)], np.float64)
    if abs(start[0] - middle[0]) <= MOVED * width:
        lift = np.array([0.0, end[1] - start[1]])
        return np.stack([middle - (MOVED * width, 0), middle + (MOVED * width, 0)]) + lift
    arm = end - middle if end[0] > middle[0] else middle - end
    arm = arm / max(float(np.linalg.norm(arm)), 1e-9) * MOVED * width
    return np.stack([middle - arm, middle + arm])


def level_by_line(known: dict[str, Any], line: Array) -> tuple[float, float, float]:
    """Yaw, pitch and roll, degrees, of the reference in a panorama whose horizon runs through two points (2, 2) px of
    this one, from left to right."""
    projection = projection_of(known)
    assert projection is not None
    left, right = projection.rays(np.asarray(line, np.float64))
    down = np.cross(left, right)
    down /= np.linalg.norm(down)
    ahead = projection.rotation[:, 2] - (projection.rotation[:, 2] @ down) * down
    ahead /= np.linalg.norm(ahead)
    return angles_of(np.stack([np.cross(down, ahead), down, ahead], axis=1))


def level_turned(known: dict[str, Any], by: Array) -> tuple[float, float, float]:
    """The same of a whole sphere whose middle was dragged sideways by px (2,)."""
    projection = projection_of(known)
    assert projection is not None
    turn = rotation_from_vector(np.array([0.0, by[0] / projection.focal, 0.0]))
    return angles_of(projection.rotation @ turn)


def _size(known: dict[str, Any]) -> Array:
    told = known["report"]["canvas"]
    return np.array([told["width"], told["height"]], np.float64)
