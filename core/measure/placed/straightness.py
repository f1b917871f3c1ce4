"""Whether straight lines of the pictures are straight in a panorama: their rays lie in one plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...panorama.upright_edges import edge_ends
from ...pictures.picture import Picture
from ...raster.arrays import Array
from ...raster.resizing import resized_points
from ..metrics import shown_at
from .options import PLACED
from .placed import PlacedPicture, PlacedSet


def line_figures(panorama: PlacedSet, pictures: Sequence[Picture]) -> dict[str, float]:
    """How far long straight lines of the pictures are bent where the panorama shows them.

    Parameters
    ----------
    panorama : PlacedSet
        Its pictures have maps, and it is known which rays it shows; otherwise all is NaN.
    pictures : sequence of Picture
        Those of the panorama, in its order.

    Returns
    -------
    dict
        bent_px: px at 900 per radian, the 95th percentile over lines of each one's 90th percentile of distances from
        the plane of rays that fits it best; bent_alone_px: of lines that lie mostly in what one picture alone shows;
        lines, lines_alone: how many. A lens that bends lines is in it, for all programs alike.
    """
    everywhere: list[float] = []
    alone: list[float] = []
    if panorama.rays_at is not None and all(one.map is not None for one in panorama.pictures):
        for one, picture in zip(panorama.pictures, pictures, strict=True):
            for bend, share_alone in _bends(panorama, one, picture):
                everywhere.append(bend)
                if share_alone > 0.5:
                    alone.append(bend)
    return {
        "bent_px": _worst(everywhere), "bent_alone_px": _worst(alone),
        "lines": float(len(everywhere)), "lines_alone": float(len(alone)),
    }  # fmt: skip


def _worst(bends: list[float]) -> float:
    return float(np.percentile(bends, 95)) if len(bends) >= PLACED.least_lines else float("nan")


def _bends(panorama: PlacedSet, one: PlacedPicture, picture: Picture) -> list[tuple[float, float]]:
    """Of each long line that is shown: its bend, px, and the share of it that no other picture shows."""
    assert panorama.rays_at is not None and one.map is not None
    height, width = picture.view.shape[:2]
    ends, lengths = edge_ends(picture)
    ends = resized_points(ends[lengths >= PLACED.line_length].reshape(-1, 2), (width, height), one.map.size)
    lines = [_along(start, end) for start, end in ends.reshape(-1, 2, 2)]
    if not lines:
        return []
    every = shown_at(one.map, np.concatenate(lines)) + one.corner
    found = []
    for at in np.split(every, np.cumsum([len(line) for line in lines])[:-1]):
        there = at[np.isfinite(at).all(axis=1)]
        columns, rows = np.rint(there).astype(int).T
        views = panorama.views_at[rows, columns]
        if (views > 0).sum() < max(PLACED.line_shown * len(at), PLACED.line_points):
            continue
        rays = panorama.rays_at(there)
        normal = np.linalg.svd(rays, full_matrices=False)[2][2]
        off = np.percentile(np.abs(rays @ normal), 90) * PLACED.px_per_radian
        found.append((float(off), float((views == 1).mean())))
    return found


def _along(start: Array, end: Array) -> Array:
    """Points (N, 2) along a line, without its very ends, which detection sets a little beyond."""
    count = max(PLACED.line_points, int(np.linalg.norm(end - start) / PLACED.line_step_px))
    shares = np.linspace(0.02, 0.98, count)[:, None]
    points: Array = start + shares * (end - start)
    return points
