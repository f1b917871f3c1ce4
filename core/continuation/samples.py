"""What both pictures tell of the target's inverse depth: samples of the overlap, and what they say at the nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..cameras.lens import distort, undistort
from ..cameras.projective import homogeneous
from ..cameras.view import View
from ..field.field import Field
from ..field.refined_depth import RefinedDepth
from ..raster.arrays import Array
from ..raster.distance import distance_to
from ..raster.grid import Grid
from ..raster.picture_map import falls_inside
from .options import GRID
from .target_grid import TargetGrid


@dataclass(frozen=True)
class Samples:
    """Inverse depth of the target in the overlap: points (N, 2) ideal px of it, δ (N,), trust (N,) from 0 to 1, and
    which (N,) lie at the reference's border."""

    points: Array
    inverse_depth: Array
    trust: Array
    at_border: NDArray[np.bool_]


@dataclass(frozen=True)
class Seen:
    """What the samples say at the nodes.

    All (rows, columns). inside: nodes that both pictures see; inverse_depth: means there, 0 elsewhere; trust: of those;
    to_border: nodes to the nearest one that only the target sees; away: nodes to the nearest that both see.
    """

    inside: NDArray[np.bool_]
    inverse_depth: Array
    trust: Array
    to_border: Array
    away: Array


def samples_of(field: Field, reference: View, target: View, refined: RefinedDepth | None) -> Samples:
    """Samples of a field and its dense refinement, regularly over what reference and target share."""
    camera = reference.camera
    width, height = camera.size
    grid = Grid.over(0, 0, width, height, GRID.field_nodes)
    bent = camera.bent
    values = field.on_grid(grid, undistort(grid.points, camera) if bent else None)
    every = max(1, int(np.sqrt(width * height / GRID.samples)))
    xs, ys = np.arange(0, width, every, dtype=np.float64), np.arange(0, height, every, dtype=np.float64)

    def sampled(nodes: Array) -> Array:
        return grid.to_pixels(nodes, 0, 0, width, height, every).astype(np.float64)

    d, trust = sampled(values.inverse_depth), np.ones((len(ys), len(xs)))
    shift = np.zeros((*d.shape, 2))
    if values.shift is not None:
        shift += np.stack([sampled(values.shift[..., k]) for k in (0, 1)], axis=-1)
    if refined is not None:
        more, sideways, confidence = refined.over(xs, ys)
        d, shift = d + more, shift + sideways
        trust = np.clip(confidence / GRID.full_confidence, GRID.min_confidence, 1).astype(np.float64)
    raw = np.stack(np.meshgrid(xs, ys), axis=-1)
    ray = homogeneous(undistort(raw, camera) if bent else raw) @ target.H_inf.T + d[..., None] * target.e_prime
    ahead = np.isfinite(ray[..., 2]) & (ray[..., 2] > 0)
    at_border = ((raw < every) | (raw > np.array([width, height]) - 1 - every)).any(axis=-1)
    ray, shift, d, trust, at_border = (one[ahead] for one in (ray, shift, d, trust, at_border))
    points = ray[:, :2] / ray[:, 2:] + shift
    seen = distort(points, target.camera) if target.camera.bent else points
    inside = falls_inside(seen[:, 0], seen[:, 1], target.size)
    return Samples(points[inside], (d / ray[:, 2])[inside], trust[inside], at_border[inside])


def seen_at(grid: TargetGrid, samples: Samples) -> Seen:
    """What samples say at the nodes of a grid."""
    ones = np.ones(len(samples.points))
    sums = grid.gathered(
        samples.points, np.stack([ones, samples.trust, samples.trust * samples.inverse_depth], axis=1)
    )
    count, trust, depth = np.moveaxis(sums, -1, 0)
    inside = count > GRID.seen_share * np.median(count[count > 0])
    alone = grid.in_picture & ~inside
    return Seen(
        inside, np.where(inside, depth / np.maximum(trust, 1e-12), 0.0),
        np.where(inside, trust / np.maximum(count, 1e-12), 0.0),
        *(np.minimum(distance_to(one), GRID.far_nodes) for one in (alone, inside)),
    )  # fmt: skip
