"""Whether what is straight and upright in the world is so in a panorama: known edges, seen through its own maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.raster.arrays import Array
from ...core.raster.picture_map import PictureMap
from ..ground_truth import SAME_DEPTH
from ..scene_camera import SceneCamera
from ..sliding import seen_at
from .set_measures import Found, SetTruth, percentile
from .sphere_truth import in_frame

# Degrees between the points that are followed along a line, and how long, degrees and points, one is that is judged.
STEP_DEG, SHORTEST_DEG, FEWEST = 0.25, 5.0, 12
# Degrees off the vertical below which a line is an upright.
UPRIGHT_DEG = 0.5
# Steps of Newton's method to find where a map shows a pixel, px that each goes at most, and by which the last may miss.
ROUNDS, FARTHEST_PX, CLOSE_PX = 12, 20.0, 0.05


@dataclass(frozen=True)
class WorldLines:
    """Points (N, 3) of the world's straight edges that the true sphere shows; line (N,): the number of each one's edge;
    upright: which edges are vertical."""

    points: Array
    line: NDArray[np.intp]
    upright: NDArray[np.bool_]

    @staticmethod
    def of(truth: SetTruth) -> WorldLines:
        """Evenly spread over the angle that each edge takes, without what something nearer hides."""
        sphere, lines = truth.rendered.sphere, truth.rendered.lines
        parts = [points_along(a - sphere.place, b - sphere.place) for a, b in lines]
        points = np.concatenate([np.zeros((0, 3)), *parts]) + sphere.place
        line = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
        away = np.linalg.norm(points - sphere.place, axis=1)
        x, y = sphere.pixels(points - sphere.place)
        shown = is_there(truth.rendered.distance, x, y, away, wraps=True)
        along = lines[:, 1] - lines[:, 0]
        tilt = np.degrees(np.arctan2(np.linalg.norm(along[:, :2], axis=1), np.abs(along[:, 2])))
        return WorldLines(points[shown], line[shown], tilt < UPRIGHT_DEG)


def points_along(start: Array, end: Array) -> Array:
    """Points (N, 3) from a start to an end (3,), STEP_DEG apart as seen from the origin."""
    way = (end - start) / np.linalg.norm(end - start)
    foot = start - (start @ way) * way
    height = float(np.linalg.norm(foot))
    first, last = math.atan2(start @ way, height), math.atan2(end @ way, height)
    turns = np.linspace(first, last, max(2, math.ceil(math.degrees(last - first) / STEP_DEG) + 1))
    along: Array = foot + height * np.tan(turns)[:, None] * way
    return along


def is_there(distance: NDArray, x: Array, y: Array, away: Array, wraps: bool = False) -> NDArray[np.bool_]:
    """Whether a map of distances (H, W) has, at or beside pixels x, y (N,), what lies so far away (N,); wraps: its left
    and right edge are neighbours."""
    height, width = distance.shape
    found = np.zeros(len(x), bool)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            column, row = np.rint(np.nan_to_num(x)).astype(int) + right, np.rint(np.nan_to_num(y)).astype(int) + down
            column = column % width if wraps else column.clip(0, width - 1)
            found |= np.abs(distance[row.clip(0, height - 1), column] / away - 1) < 2 * SAME_DEPTH
    return found & np.isfinite(x)


def line_figures(found: Found) -> dict[str, float]:
    """lines, uprights: how many edges of the world the panorama shows well enough to be judged; line_px, line_p90_px:
    how far what it shows of each is off the great circle that fits it best, px in the panorama's middle, at its worst
    point (median, 90th percentile of edges); picture_line_px, picture_line_p90_px: the same of each picture on its own,
    wherever it sees an edge; upright_deg, upright_p90_deg: how far the panorama's uprights lean."""
    projection = found.result.canvas.projection
    assert projection is not None
    world = WorldLines.of(found.truth)
    labels = found.labels
    rays = (world.points - found.truth.rendered.sphere.place) @ found.gauge.T
    guess = projection.points(rays) + np.array(found.result.warp.canvas.offset)
    shown = np.full(world.points.shape, np.nan)
    of_pictures: list[float] = []
    for order, camera in enumerate(found.cameras):
        pixels = pixels_of(world.points, camera, found.truth.rendered.depths[found.numbers[order]])
        at = shown_at(found.result.warp.maps[order].arrays(), guess, pixels)
        directions = projection.rays(at - np.array(found.result.warp.canvas.offset)) @ found.gauge
        of_pictures += [off for off, _, _ in straightness(directions, world.line)]
        x, y = (np.rint(np.nan_to_num(part, nan=-1)).astype(int) for part in at.T)
        on_canvas = (x >= 0) & (y >= 0) & (x < labels.shape[1]) & (y < labels.shape[0])
        own = on_canvas & (labels[np.where(on_canvas, y, 0), np.where(on_canvas, x, 0)] == order)
        shown[own] = directions[own]
    judged = straightness(shown, world.line)
    px = projection.focal
    bends = px * np.array([off for off, _, _ in judged])
    alone = px * np.array(of_pictures)
    leans = np.degrees([abs(math.asin(min(1.0, abs(normal[2])))) for _, normal, line in judged if world.upright[line]])
    return {
        "lines": float(len(judged)), "uprights": float(len(leans)),
        "line_px": percentile(bends, 50), "line_p90_px": percentile(bends, 90),
        "picture_line_px": percentile(alone, 50), "picture_line_p90_px": percentile(alone, 90),
        "upright_deg": percentile(leans, 50), "upright_p90_deg": percentile(leans, 90),
    }  # fmt: skip


def pixels_of(points: Array, camera: SceneCamera, depth: NDArray[np.float32]) -> Array:
    """Where (N, 2) a camera sees points (N, 3) of the world, NaN where it does not; depth: of its picture."""
    pixels = seen_at(camera, points)
    away = np.where(np.isfinite(pixels[:, 0]), (points @ camera.R.T + camera.t)[:, 2], np.nan)
    seen = in_frame(pixels, camera) & is_there(depth, pixels[:, 0], pixels[:, 1], away)
    return np.where(seen[:, None], pixels, np.nan)


def shown_at(picture_map: PictureMap, guess: Array, pixels: Array) -> Array:
    """Where (N, 2), px of the map, a map shows pixels (N, 2) of its picture, near a guess (N, 2); NaN for nowhere."""
    at = np.where(np.isfinite(pixels), guess, np.nan)
    for _ in range(ROUNDS):
        here = picture_map.between(np.nan_to_num(at, nan=-1))
        right = picture_map.between(np.nan_to_num(at + (1, 0), nan=-1)) - here
        down = picture_map.between(np.nan_to_num(at + (0, 1), nan=-1)) - here
        off = pixels - here
        area = right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.column_stack([off[:, 0] * down[:, 1] - off[:, 1] * down[:, 0],
                                    right[:, 0] * off[:, 1] - right[:, 1] * off[:, 0]]) / area[:, None]  # fmt: skip
        at = at + np.clip(step, -FARTHEST_PX, FARTHEST_PX)
    missed = np.linalg.norm(picture_map.between(np.nan_to_num(at, nan=-1)) - pixels, axis=1)
    with np.errstate(invalid="ignore"):
        return np.where((missed < CLOSE_PX)[:, None], at, np.nan)


def straightness(directions: Array, line: NDArray[np.intp]) -> list[tuple[float, Array, int]]:
    """Of unit directions (N, 3), NaN for none, by the number of their line (N,): how far the worst is off the great
    circle that fits best, rad, that circle's normal (3,), and the number; without lines of which too little is seen."""
    out = []
    known = np.isfinite(directions).all(axis=1)
    for number in np.unique(line[known]):
        mine = directions[known & (line == number)]
        long = np.degrees(np.arccos(np.clip((mine @ mine[0]).min(), -1, 1)))
        if len(mine) < FEWEST or long < SHORTEST_DEG:
            continue
        normal = np.linalg.svd(mine, full_matrices=False)[2][2]
        out.append((float(np.arcsin(np.abs(mine @ normal).max().clip(0, 1))), normal, int(number)))
    return out
