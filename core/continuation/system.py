"""One least squares for the target's inverse depth at all nodes: what was seen, and how it goes on.

Everything that is wanted is linear in δ: samples; differences along the plane that goes on somewhere; second
differences; straight lines, along which δ is affine; uprights, along which δ / λ is constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.projective import project
from ..raster.arrays import NEIGHBOURS, Array, Part
from ..system.threads import ask
from .banded import Equations, LeastSquares
from .options import GRID, SYSTEM
from .samples import Samples, Seen
from .target_grid import TargetGrid

# Three nodes in a row, below one another and to the right.
ROWS_OF_THREE = (np.s_[:-2, :], np.s_[1:-1, :], np.s_[2:, :]), (np.s_[:, :-2], np.s_[:, 1:-1], np.s_[:, 2:])


@dataclass(frozen=True)
class Surroundings:
    """What goes on where.

    label (rows, columns): which plane, −1 for none; inverse_depth (rows, columns): of that plane, or of what stands in
    for one; attraction (rows, columns): share 0..1 of the pull towards it; values (rows, columns, K): δ of all planes.
    """

    label: NDArray[np.intp]
    inverse_depth: Array
    attraction: Array
    values: Array


@dataclass(frozen=True)
class Guides:
    """What the target's picture shows of how surfaces go on.

    colours (rows, columns, 3): luma and chroma, 0 to 255, at the nodes; edges (M, 2, 3): rays to both ends of straight
    edges in the target camera's frame; confirmed: whether such edges confirm which way is down.
    """

    colours: Array
    edges: Array
    confirmed: bool


def surface(
    grid: TargetGrid, samples: Samples, seen: Seen, guides: Guides, goes_on: Surroundings, rounds: int
) -> Array:
    """Inverse depth (rows, columns) at the nodes, by reweighted least squares (Huber's loss) in so many rounds."""
    count, most = grid.numbers.size, nearest(samples)
    data, weight = _data(grid, samples, seen)
    membrane, tied = _membrane(grid, guides.colours, goes_on)
    bends, stiff = _bends(grid, guides.colours, goes_on)
    lines, uprights = _straight(grid, guides.edges)
    upright = SYSTEM.uprights if guides.confirmed else SYSTEM.doubtful_uprights
    slope = SYSTEM.membrane * (SYSTEM.carried_slope * GRID.nodes) ** 2
    s2 = np.square(grid.by_number(grid.sensitivity))
    pull = SYSTEM.attraction * s2 * grid.by_number(goes_on.attraction)
    there = np.maximum(grid.by_number(goes_on.inverse_depth), 0)
    problem = LeastSquares(count, (data, membrane, bends, lines, uprights))
    weights, stiffness, upright_weights = weight, stiff, np.ones(len(uprights.wanted))
    straight = np.full(len(lines.wanted), slope * SYSTEM.lines)
    boost, bound, at = np.ones(len(tied)), np.zeros(count), np.zeros(count)
    z = np.zeros(count)
    for number in range(rounds):
        ask()
        held = SYSTEM.bound_weight * s2 * bound
        z = problem.solved(
            (weights, SYSTEM.membrane * tied * boost, slope * stiffness, straight,
             SYSTEM.membrane * upright * upright_weights),
            pull + held + 1e-9 * s2, pull * there + held * at,
        )  # fmt: skip
        missed, _, bent, _, leaning = (np.abs(one) for one in problem.residuals(z))
        weights = weight / np.maximum(1, missed / SYSTEM.sample_px)
        upright_weights = 1 / np.maximum(1, leaning / SYSTEM.upright_px)
        if number < SYSTEM.bending_rounds:
            stiffness = stiff / np.maximum(1, bent / SYSTEM.bend_px)
        # what was held at a bound stays there while it does not move away from it
        rest = (bound > 0) & ((z <= 1e-6 * most) | (z >= most * (1 - 1e-6)))
        bound = ((z < 0) | (z > most) | rest).astype(np.float64)
        at = np.where(z > most / 2, most, 0.0)
        boost = np.minimum(boost * _stiffening(grid, np.clip(z, 0, most), seen), SYSTEM.max_stiffening)
    result: Array = np.clip(z, 0, most)[grid.numbers]
    return result


def without_folds(grid: TargetGrid, inverse_depth: Array, seen: Seen) -> Array:
    """Inverse depth (rows, columns), smoothed where what only the target sees would turn over, or be enlarged beyond
    use."""
    low, high = SYSTEM.allowed_areas
    for _ in range(SYSTEM.smoothing_steps):
        near = _misshapen(grid, inverse_depth, seen, low, high)
        if not near.any():
            break
        inverse_depth = np.where(near, cv2.GaussianBlur(inverse_depth, (0, 0), SYSTEM.smoothing_nodes), inverse_depth)
    return inverse_depth


def nearest(samples: Samples) -> float:
    """The greatest inverse depth that a surface may have."""
    return float(SYSTEM.max_factor * np.percentile(samples.inverse_depth, 99.5))


def cell_areas(grid: TargetGrid, inverse_depth: Array) -> Array:
    """Areas (rows − 1, columns − 1) that the cells between nodes take up in the panorama, in units of those at
    infinity; negative where they are turned over."""

    def areas(depth: Array) -> Array:
        unit = grid.panorama_rays(depth)
        unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
        across, down = unit[:-1, 1:] - unit[:-1, :-1], unit[1:, :-1] - unit[:-1, :-1]
        result: Array = (np.cross(across, down) * unit[:-1, :-1]).sum(axis=-1)
        return result

    ratio: Array = areas(inverse_depth) / areas(np.zeros(grid.shape))
    return ratio


def _data(grid: TargetGrid, samples: Samples, seen: Seen) -> tuple[Equations, Array]:
    """What the samples say (n,), in px, and what they count: each node's alike, more near the border."""
    nodes, weights = grid.taps(samples.points)
    s = grid.sensitivity_of(grid.rays_of(samples.points))
    count = np.bincount(nodes.ravel(), weights.ravel(), grid.numbers.size)
    usual = float(np.median(count[count > 0]))
    around = (weights * np.maximum(count, 0.3 * usual)[nodes]).sum(axis=1)
    border = (weights * grid.by_number(seen.to_border)[nodes]).sum(axis=1) - 1
    near = 1 + SYSTEM.border_weight * np.exp(-np.maximum(border, 0) / SYSTEM.border_nodes)
    equations = Equations(nodes, weights * s[:, None], s * samples.inverse_depth)
    return equations, samples.trust / np.maximum(around, 1e-9) * near


def _membrane(grid: TargetGrid, colours: Array, goes_on: Surroundings) -> tuple[Equations, Array]:
    """Neighbours differ as the plane does on which both lie; else, along gravity, as what is upright does. Equations,
    and how much neighbours are tied (n,)."""
    point = grid.view.K @ grid.down
    parts, tied = [], []
    for axis, (a, b) in enumerate(reversed(NEIGHBOURS)):
        s = (grid.sensitivity[a] + grid.sensitivity[b]) / 2
        mean = np.sqrt(grid.level_range[a] * grid.level_range[b])
        way = point[:2] - point[2] * grid.grid.points[a]
        along = way[..., 1 - axis] ** 2 / (np.square(way).sum(axis=-1) + 1e-9)
        same = (goes_on.label[a] == goes_on.label[b]) & (goes_on.label[a] >= 0)
        factors = [np.where(same, 1, along * mean / grid.level_range[k] + 1 - along) for k in (a, b)]
        step = goes_on.inverse_depth[b] - goes_on.inverse_depth[a]
        parts.append(Equations(
            np.stack([grid.numbers[a].ravel(), grid.numbers[b].ravel()], axis=1),
            np.stack([(-s * factors[0]).ravel(), (s * factors[1]).ravel()], axis=1),
            np.where(same, s * step, 0).ravel(),
        ))  # fmt: skip
        upright = 1 + (SYSTEM.along_gravity - 1) * along
        tied.append(np.where(same, 1, _alike(colours[a], colours[b]) * upright).ravel())
    return Equations.joined(parts), np.concatenate(tied)


def _bends(grid: TargetGrid, colours: Array, goes_on: Surroundings) -> tuple[Equations, Array]:
    """Second differences vanish. Equations, and how stiff the surface is there (n,)."""
    s, numbers = grid.sensitivity, grid.numbers
    parts, stiff = [], []
    for a, b, c in ROWS_OF_THREE:
        nodes = np.stack([numbers[k].ravel() for k in (a, b, b, c)], axis=1)
        parts.append(Equations(nodes, np.outer(s[b].ravel(), [1, -1, -1, 1]), np.zeros(len(nodes))))
        free = np.minimum(_crease(grid, goes_on, a, b), _crease(grid, goes_on, b, c))
        stiff.append((_alike(colours[a], colours[c], 0.5) * free).ravel())
    corners = p, q, r, t = np.s_[:-1, :-1], np.s_[:-1, 1:], np.s_[1:, :-1], np.s_[1:, 1:]
    nodes = np.stack([numbers[k].ravel() for k in corners], axis=1)
    parts.append(Equations(nodes, np.outer(s[p].ravel() * np.sqrt(2), [1, -1, -1, 1]), np.zeros(len(nodes))))
    free = np.min([_crease(grid, goes_on, p, k) for k in (q, r, t)], axis=0)
    stiff.append((_alike(colours[p], colours[t]) * free).ravel())
    return Equations.joined(parts), np.concatenate(stiff)


def _alike(colours: Array, others: Array, share: float = 1.0) -> Array:
    """How alike (…) colours (…, 3) are, from 1 down to `SystemOptions.min_contrast`; share: of the difference."""
    apart = np.linalg.norm(colours - others, axis=-1) * share / SYSTEM.contrast
    result: Array = np.maximum(1 / (1 + apart**2), SYSTEM.min_contrast)
    return result


def _crease(grid: TargetGrid, goes_on: Surroundings, a: Part, b: Part) -> Array:
    """The share of stiffness between nodes a and b: little where two planes meet without a jump."""
    one, other = goes_on.label[a], goes_on.label[b]
    if not goes_on.values.shape[-1]:
        return np.ones(one.shape)
    values = goes_on.values[a]
    there, beside = (
        np.take_along_axis(values, np.maximum(k, 0)[..., None], axis=-1)[..., 0] for k in (one, other)
    )
    meet = (one != other) & (one >= 0) & (other >= 0)
    meet &= np.abs(there - beside) * grid.sensitivity[a] < SYSTEM.crease_px
    return np.where(meet, SYSTEM.crease, 1.0)


def _straight(grid: TargetGrid, edges: Array) -> tuple[Equations, Equations]:
    """That straight edges (M, 2, 3) stay straight, and that those which are upright stay so."""
    ahead = (edges[..., 2] > 1e-6).all(axis=1)
    edges = edges[ahead]
    ends = project(edges @ grid.view.K.T)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / grid.grid.step
    long = length >= SYSTEM.min_line * GRID.nodes
    edges, ends, length = edges[long], ends[long], length[long]
    # half a node apart, so that three in a row name unknowns that lie close together
    points = np.maximum(4, (2 * length).astype(int) + 1)
    edge = np.repeat(np.arange(len(points)), points)
    first = np.cumsum(points) - points
    place = (np.arange(len(edge)) - first[edge]) / (points[edge] - 1)
    at = ends[edge, 0] + place[:, None] * (ends[edge, 1] - ends[edge, 0])
    rays = grid.rays_of(at)
    nodes, weights = grid.taps(at)
    s, level_range = grid.bounded_sensitivity(rays), grid.level_range_of(rays)
    step = (length / (points - 1))[edge]
    middle = np.flatnonzero(edge[:-2] == edge[2:]) + 1 if len(edge) > 2 else np.zeros(0, np.intp)
    three = np.stack([middle - 1, middle, middle + 1], axis=1)
    # second derivatives, whose squares sum up to the same however densely points lie
    factors = weights[three] * np.array([1.0, -2.0, 1.0])[:, None] * (s / step**1.5)[middle][:, None, None]
    lines = Equations(nodes[three].reshape(-1, 12), factors.reshape(-1, 12), np.zeros(len(middle)))
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    upright = np.abs(normals @ grid.down) < SYSTEM.upright_tilt
    start = np.flatnonzero((edge[:-1] == edge[1:]) & upright[edge[:-1]]) if len(edge) else np.zeros(0, np.intp)
    two = np.stack([start, start + 1], axis=1)
    scale = np.sqrt(level_range[two].prod(axis=1) / step[start]) * s[two].mean(axis=1)
    factors = weights[two] * (np.array([-1.0, 1.0]) * scale[:, None] / level_range[two])[..., None]
    return lines, Equations(nodes[two].reshape(-1, 8), factors.reshape(-1, 8), np.zeros(len(start)))


def _stiffening(grid: TargetGrid, z: Array, seen: Seen) -> Array:
    """By what factor (n,) neighbours, in the order of `_membrane`, are to be tied more than before, because the
    surface (N,) folds or stretches what only the target sees."""
    factor = np.where(_misshapen(grid, z[grid.numbers], seen, *SYSTEM.areas), SYSTEM.stiffening, 1.0)
    return np.concatenate([factor[:-1].ravel(), factor[:, :-1].ravel()])


def _misshapen(grid: TargetGrid, inverse_depth: Array, seen: Seen, low: float, high: float) -> NDArray[np.bool_]:
    """The nodes (rows, columns) that only the target sees around cells whose areas are not between two bounds."""
    area = cell_areas(grid, inverse_depth)
    bad = np.pad(((area < low) | (area > high)).astype(np.uint8), ((0, 1), (0, 1)), mode="edge")
    near: NDArray[np.bool_] = (cv2.dilate(bad, np.ones((3, 3), np.uint8)) > 0) & ~seen.inside
    return near
