"""Inverse depth on every ray beyond the overlap, continued from what both pictures tell of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from ..cameras.lens import distort
from ..cameras.view import View
from ..field.field import Field
from ..field.refined_depth import RefinedDepth
from ..raster.arrays import Array
from ..raster.grid import Grid
from .options import GRID, LOOKUP, SYSTEM, TAKEOVER
from .plane_labels import agreement, labelled
from .planes import find_planes
from .samples import Samples, Seen, samples_of, seen_at
from .system import Guides, Surroundings, nearest, surface, without_folds
from .target_grid import TargetGrid


@dataclass(frozen=True, eq=False)
class Continuation:
    """What the target alone shows, as a surface.

    Attributes
    ----------
    K : (3, 3) array
        Of the reference, px.
    grid : TargetGrid
    inverse_depth : (rows, columns) array
        δ = 1 / Z' at its nodes, in 1 / baseline of the target camera's axis.
    fine : (h, w) array
        The same between the nodes, LOOKUP.oversampling to each.
    every : int
        px of the target between these values, the first at the first node.
    takeover_px : float
        px of the reference's plane, beyond its border, over which the surface takes over from the field.
    """

    K: Array
    grid: TargetGrid
    inverse_depth: Array
    fine: Array
    every: int
    takeover_px: float

    @staticmethod
    def of(K: Array, grid: TargetGrid, inverse_depth: Array, takeover_px: float) -> Continuation:
        """A surface from its nodes (rows, columns); K (3, 3) of the reference."""
        nodes = grid.grid
        every = max(1, nodes.step // LOOKUP.oversampling)
        left, top = grid.first_px
        width, height = (nodes.step * (count - 1) + 1 for count in (nodes.columns, nodes.rows))
        margin = 2  # nodes that interpolation looks at beyond the last
        wider = Grid(
            (nodes.start[0] - margin * nodes.step, nodes.start[1] - margin * nodes.step), nodes.step,
            nodes.columns + 2 * margin, nodes.rows + 2 * margin,
        )  # fmt: skip
        padded = np.pad(inverse_depth, margin, mode="edge")
        fine = wider.to_pixels(padded, left, top, width, height, every).astype(np.float64)
        return Continuation(K, grid, inverse_depth, fine, every, takeover_px)

    def at(self, rays: Array) -> Array:
        """Inverse depth (…) = 1 / range along unit rays (…, 3) in the reference's frame, 1 / baseline, ≥ 0.

        Where a ray meets the surface more than once, the nearest is seen.
        """
        view = self.grid.view
        infinite = rays.reshape(-1, 3) @ view.R.T
        away = np.linalg.norm(self.grid.panorama_rays(self.inverse_depth), axis=-1)
        highest = float((self.inverse_depth / away).max())
        tried = np.linspace(1.05 * highest, 0, LOOKUP.scan)
        near, far = np.full(len(infinite), tried[-1]), np.full(len(infinite), tried[-1])
        open_ = np.ones(len(infinite), bool)
        for before, now in zip(tried[:-1], tried[1:], strict=True):
            crossed = open_ & (self._excess(infinite, np.full(len(infinite), now)) >= 0)
            near[crossed], far[crossed] = before, now
            open_ &= ~crossed
        for _ in range(LOOKUP.narrowing):
            middle = (near + far) / 2
            beyond = self._excess(infinite, middle) >= 0
            near, far = np.where(beyond, near, middle), np.where(beyond, middle, far)
        excess = [self._excess(infinite, one) for one in (near, far)]
        share = np.clip(excess[1] / np.maximum(excess[1] - excess[0], 1e-300), 0, 1)
        result: Array = (far + share * (near - far)).reshape(rays.shape[:-1])
        return result

    def outline(self, points: Array) -> Array:
        """Rays (…, 3) of any length, in the reference's frame, of ideal pixels (…, 2) of the target."""
        rays = self.grid.rays_of(points)
        seen: Array = (rays - self._surface(points)[..., None] * self.grid.view.t) @ self.grid.view.R
        return seen

    def _excess(self, infinite: Array, depth: Array) -> Array:
        """By how much (N,) the surface lies nearer than inverse depth (N,) along R r (N, 3)."""
        seen = infinite + depth[:, None] * self.grid.view.t
        ahead = np.maximum(seen[:, 2], 0.05)
        K = self.grid.view.K
        points = seen[:, :2] / ahead[:, None] @ K[:2, :2].T + K[:2, 2]
        excess: Array = self._surface(points) * ahead - depth
        return excess

    def _surface(self, points: Array) -> Array:
        """δ (…) at ideal pixels (…, 2) of the target; beyond the nodes that of the last."""
        place = (points - np.array(self.grid.first_px)) / self.every
        found: Array = map_coordinates(self.fine, [place[..., 1], place[..., 0]], order=1, mode="nearest")
        return found


def continue_beyond(
    field: Field, views: Sequence[View], refined: RefinedDepth | None, picture: NDArray[np.uint8], edges: Array,
    down: Array, confirmed: bool,
) -> Continuation | None:  # fmt: skip
    """Continues a field's inverse depth to what the target alone shows (docs/method.md, 5).

    Parameters
    ----------
    field : Field
    views : sequence of View
        Of reference and target.
    refined : RefinedDepth, optional
        What dense refinement found.
    picture : (H, W[, C]) uint8 array
        The target.
    edges : (M, 2, 3) array
        Rays to both ends of straight edges of the target, in its camera's frame.
    down : (3,) array
        Along gravity, in the reference camera's frame.
    confirmed : bool
        Whether upright edges confirm that.

    Returns
    -------
    Continuation or None
        None without a baseline, or where both pictures see too little.
    """
    reference, target = views
    if not target.e_prime.any() or not np.isfinite(target.R).all():
        return None
    grid = TargetGrid.over(target, target.R @ down)
    samples = samples_of(field, reference, target, refined)
    if len(samples.points) < GRID.min_samples or np.percentile(samples.inverse_depth, 99.5) <= 0:
        return None
    seen = seen_at(grid, samples)
    guides = Guides(_colours(grid, picture), edges, confirmed)
    solution = without_folds(grid, _solved(grid, samples, seen, guides), seen)
    return Continuation.of(reference.K, grid, solution, _takeover(reference, grid, samples, seen, solution))


def _takeover(reference: View, grid: TargetGrid, samples: Samples, seen: Seen, solution: Array) -> float:
    """px of the reference over which the solution (rows, columns) takes over from the field: more where the two differ
    by so much at the border that the map would fold over less."""
    side = max(reference.size)
    low, high = (share * side for share in TAKEOVER.shares)
    nodes, weights = grid.taps(samples.points)
    goes_on = samples.at_border & ((weights * grid.by_number(seen.to_border)[nodes]).sum(axis=1) < TAKEOVER.near_nodes)
    if not goes_on.any():
        return low
    there = (weights * grid.by_number(solution)[nodes]).sum(axis=1)
    off = np.abs(there - samples.inverse_depth) * grid.sensitivity_of(grid.rays_of(samples.points)) / GRID.side_px
    return float(np.clip(TAKEOVER.px_per_px * side * np.percentile(off[goes_on], TAKEOVER.percentile), low, high))


def _solved(grid: TargetGrid, samples: Samples, seen: Seen, guides: Guides) -> Array:
    """Inverse depth (rows, columns) at the nodes."""
    nodes, weights = grid.taps(samples.points)
    border_px = (weights * grid.by_number(seen.to_border)[nodes]).sum(axis=1) * grid.grid.step
    planes = find_planes(grid, samples, border_px)
    nothing = Surroundings(
        np.full(grid.shape, -1), np.zeros(grid.shape), np.zeros(grid.shape), np.zeros((*grid.shape, 0))
    )
    no_edges = Guides(guides.colours, np.zeros((0, 2, 3)), guides.confirmed)
    smooth = surface(grid, samples, seen, no_edges, nothing, SYSTEM.first_rounds)
    if not planes:
        return smooth
    label, values = labelled(grid, planes, seen, guides.colours, smooth, nearest(samples))
    on = np.take_along_axis(values, np.maximum(label, 0)[..., None], axis=-1)[..., 0]
    free = np.array([SYSTEM.free_attraction if plane.kind == "free" else 1.0 for plane in planes])
    ramp = np.where(seen.inside, 1, np.clip(seen.away / (SYSTEM.attraction_ramp * GRID.nodes), 0, 1))
    pull = np.where(label >= 0, free[np.maximum(label, 0)] * ramp, 0)
    goes_on = Surroundings(label, np.where(label >= 0, on, 0), pull, values)
    trusted = replace(samples, trust=samples.trust * agreement(grid, samples, seen, planes, label))
    return surface(grid, trusted, seen, guides, goes_on, SYSTEM.rounds)


def _colours(grid: TargetGrid, picture: NDArray[np.uint8]) -> Array:
    """Luma and chroma, 0 to 255 (rows, columns, 3) of the target at the nodes, averaged over about a node's cell."""
    height, width = picture.shape[:2]
    step = grid.grid.step
    size = max(1, round(3 * width / step)), max(1, round(3 * height / step))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).reshape(size[1], size[0], -1)
    if small.shape[2] == 1:
        small = np.repeat(small, 3, axis=2)
    toned = cv2.cvtColor(cv2.GaussianBlur(small[..., :3], (0, 0), 1.0), cv2.COLOR_RGB2YCrCb).astype(np.float32)
    raw = distort(grid.grid.points, grid.view.camera)
    place = (raw + 0.5) * np.array([size[0] / width, size[1] / height]) - 0.5
    x, y = np.moveaxis(place, -1, 0).astype(np.float32)
    colours: Array = cv2.remap(toned, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float64)
    return colours
