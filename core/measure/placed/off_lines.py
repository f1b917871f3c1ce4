"""How far what a panorama shows of two pictures at one place is from their epipolar lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...cameras.projective import distance_to_line
from ...pictures.picture import Picture
from ...raster.arrays import Array
from ...raster.resizing import resized_points
from .options import PLACED
from .overlaps import overlaps
from .placed import PlacedSet

# From two pictures to F (3, 3), x_jᵀ F x_i = 0 in their px, estimated independently of all programs; NaN if unknown.
Fundamental = Callable[[Picture, Picture], Array]


def off_line_figures(
    panorama: PlacedSet, pictures: Sequence[Picture], fundamental: Fundamental
) -> dict[str, float]:
    """off_lines_px: how far what a panorama shows of two pictures at one place is off their epipolar lines, median over
    all overlaps, px of a picture; NaN without maps. pictures: those of the panorama, in its order."""
    off = []
    for overlap in overlaps(panorama):
        rows, columns = np.nonzero(overlap.where)
        every = max(1, len(rows) // PLACED.off_line_samples)
        points = []
        for number in (overlap.i, overlap.j):
            one, view = panorama.pictures[number], pictures[number].view
            if one.map is None:
                break
            part = one.part_of(overlap.part)
            at = np.stack([values[part][rows[::every], columns[::every]] for values in (one.map.x, one.map.y)], axis=-1)
            points.append(resized_points(at.astype(np.float64), one.map.size, (view.shape[1], view.shape[0])))
        if len(points) < 2:
            continue
        F = fundamental(pictures[overlap.i], pictures[overlap.j])
        if np.isfinite(F).all():
            off.append(distance_to_line(F, *points))
    return {"off_lines_px": float(np.nanmedian(np.concatenate(off))) if off else float("nan")}
