"""The bundle: all cameras and points at once, by Levenberg's method on a Cauchy cost, points eliminated.

The cost's curvature is taken by weights (iteratively reweighted least squares). Each point is a block of 3 × 3 that is
eliminated (Schur complement); the cameras that remain are solved densely. Cameras of one lens, or at one place, share
columns; so do the turns of views of one sphere. Reference: Triggs et al., Bundle Adjustment: A Modern Synthesis, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...raster.arrays import Array
from ...system.progress import Tick, unwatched
from ..averaging.turns import rotations
from .bundle_options import BUNDLE
from .reprojection import CAMERA, Reprojection, derivatives, reproject, tangents
from .solution import Problem, Solution
from .tracks import Index, pairs_within


@dataclass(frozen=True, eq=False)
class DepthPrior:
    """Where ρ of each point is drawn to, weakly: mean and sigma (P,)."""

    mean: Array
    sigma: Array


@dataclass(frozen=True)
class Settings:
    """kernel_px: scale of the Cauchy cost, not yet multiplied by the problem's scale; iterations at most; tolerance:
    relative change of the cost that ends them; lenses: whether lenses may change; depths: whether places and ρ may,
    else rotations alone are solved for and all places are one."""

    kernel_px: float = BUNDLE.kernel_px
    iterations: int = 60
    tolerance: float = 1e-8
    lenses: bool = True
    depths: bool = True


@dataclass(frozen=True, eq=False)
class Bundled:
    """solution; cost: px²; chosen (O',), lengths (O',): the observations that took part and how far they are off, px;
    iterations."""

    solution: Solution
    cost: float
    chosen: Index
    lengths: Array
    iterations: int


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations: cameras (C, C) with gradient (C,); points (P, 3, 3) with gradients (P, 3); between (O, 3,
    CAMERA), of each observation."""

    cameras: Array
    gradient: Array
    points: Array
    point_gradients: Array
    between: Array


class Structure:
    """Which observations take part and how they hang together: the same in all iterations.

    columns (N, CAMERA): the unknown that each parameter of a camera is, -1 where it is held.
    """

    def __init__(self, problem: Problem, solution: Solution, settings: Settings, reference: int) -> None:
        tracks = problem.tracks
        eligible = solution.used & solution.solved[tracks.point]
        seen_by = np.bincount(tracks.point[eligible], minlength=len(tracks))
        self.chosen: Index = np.flatnonzero(eligible & (seen_by[tracks.point] >= 2))
        self.picture = tracks.picture[self.chosen]
        self.points, self.point, counts = np.unique(
            tracks.point[self.chosen], return_inverse=True, return_counts=True
        )
        self.starts = np.concatenate([[0], np.cumsum(counts)[:-1]]) if len(counts) else np.zeros(0, np.intp)
        order = np.argsort(self.picture, kind="stable")
        bounds = np.searchsorted(self.picture[order], np.arange(problem.pictures + 1))
        self.of_picture = [order[a:b] for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        self.pairs = self._pairs_of_pictures(problem.pictures)
        self.columns = _columns(problem, settings, reference)
        self.turns = problem.bodies.R
        self.unknowns = int(self.columns.max(initial=-1)) + 1

    def _pairs_of_pictures(self, count: int) -> list[tuple[int, int, Index, Index]]:
        """For every two pictures the observations of points that both see."""
        a, b = pairs_within(self.point)
        key = self.picture[a] * count + self.picture[b]
        order = np.argsort(key, kind="stable")
        keys, begins = np.unique(key[order], return_index=True)
        parts = np.split(order, begins[1:]) if len(keys) else []
        return [(int(k) // count, int(k) % count, a[part], b[part]) for k, part in zip(keys, parts, strict=True)]

    def summed_by_point(self, values: Array) -> Array:
        return np.add.reduceat(values, self.starts, axis=0)

    def reduced(self, whole: Array) -> Array:
        """A matrix or vector over all parameters of all cameras, summed over those that are one unknown."""
        chooser = self.chooser
        if whole.ndim == 1:
            return chooser.T @ whole
        return chooser.T @ whole @ chooser

    @cached_property
    def chooser(self) -> Array:
        """(N CAMERA, C): how each camera's parameters follow from the unknowns. Ones, but for turns: a body's is one
        about its own axes, and R of a view, exp(ω) R, turns with R_view ω."""
        flat = self.columns.ravel()
        chooser = np.zeros((len(flat), self.unknowns))
        chooser[flat >= 0, flat[flat >= 0]] = 1
        for j in np.flatnonzero(self.columns[:, 0] >= 0):
            chooser[j * CAMERA : j * CAMERA + 3, self.columns[j, :3]] = self.turns[j]
        return chooser


def _columns(problem: Problem, settings: Settings, reference: int) -> Index:
    columns = np.full((problem.pictures, CAMERA), -1)
    still = problem.held
    if not still.any():
        still = np.arange(problem.pictures) == reference
    bodies = problem.bodies.of
    moving = ~np.isin(bodies, bodies[still])
    each, number = np.unique(bodies[moving], return_inverse=True)
    count = 3 * len(each)
    columns[moving, :3] = 3 * number[:, None] + np.arange(3)
    if settings.depths:
        pinned = set(problem.place[~moving].tolist())
        places = {p: k for k, p in enumerate(p for p in np.unique(problem.place).tolist() if p not in pinned)}
        for j, place in enumerate(problem.place.tolist()):
            if place in places:
                columns[j, 3:6] = count + 3 * places[place] + np.arange(3)
        count += 3 * len(places)
    if settings.lenses:
        free = problem.lenses.free
        numbers = np.full(free.shape, -1)
        numbers[free] = count + np.arange(int(free.sum()))
        columns[:, 6:] = numbers[problem.lenses.of]
    return columns


def bundle(
    problem: Problem, solution: Solution, settings: Settings, reference: int, prior: DepthPrior | None = None,
    tick: Tick = unwatched,
) -> Bundled:  # fmt: skip
    """Minimise the robust cost of all observations that are used.

    Parameters
    ----------
    problem, solution : Problem, Solution
        What is seen, and where to start.
    settings : Settings
        Kernel, iterations and what is free.
    reference : int
        The picture whose pose is held, unless poses are given.
    prior : DepthPrior, optional
        Draws ρ; without one, points without parallax are held by the damping alone.
    tick : callable
        Called at every step that is tried; ends the work by raising.

    Returns
    -------
    Bundled
    """
    structure = Structure(problem, solution, settings, reference)
    tick()
    seen = reproject(problem, solution, structure.chosen)
    cost = _cost(problem, solution, structure, seen, settings, prior)
    damping, done = BUNDLE.damping, 0
    while done < settings.iterations and len(structure.chosen):
        done += 1
        bases = tangents(solution.rays)
        normal = normal_equations(problem, solution, structure, seen, settings, prior, bases)
        scale = scale_direction(structure, solution)
        before = cost
        for _ in range(BUNDLE.tries):
            tick()
            try:
                step = _solved(structure, normal, scale, damping)
            except np.linalg.LinAlgError:  # singular to rounding: more damping makes it regular
                damping *= BUNDLE.damping_up
                continue
            moved = _stepped(problem, solution, structure, bases, *step)
            moved_seen = reproject(problem, moved, structure.chosen)
            moved_cost = _cost(problem, moved, structure, moved_seen, settings, prior)
            if moved_cost < cost:
                solution, seen, cost = moved, moved_seen, moved_cost
                damping = max(damping * BUNDLE.damping_down, BUNDLE.least_damping)
                break
            damping *= BUNDLE.damping_up
        if before - cost <= settings.tolerance * before:
            break
    return Bundled(solution, cost, structure.chosen, np.linalg.norm(seen.errors, axis=1), done)


def robust_cost(lengths: Array, kernel_px: float) -> Array:
    """Cauchy's cost (O,), px², of errors with these lengths."""
    cost: Array = kernel_px**2 * np.log1p((lengths / kernel_px) ** 2)
    return cost


def _cost(
    problem: Problem, solution: Solution, structure: Structure, seen: Reprojection, settings: Settings,
    prior: DepthPrior | None,
) -> float:  # fmt: skip
    kernel = settings.kernel_px * problem.scale
    cost = float(robust_cost(np.linalg.norm(seen.errors, axis=1), kernel).sum())
    cost += float((problem.lenses.weights(problem.scale) * solution.lens**2).sum())
    if prior is not None and settings.depths:
        off = (solution.inverse_ranges - prior.mean) / prior.sigma
        cost += (BUNDLE.prior_noise_px * problem.scale) ** 2 * float(np.log1p(off[structure.points] ** 2).sum())
    return cost


def normal_equations(
    problem: Problem, solution: Solution, structure: Structure, seen: Reprojection, settings: Settings,
    prior: DepthPrior | None, bases: Array,
) -> Normal:  # fmt: skip
    """At the current solution, with the robust weights there."""
    kernel = settings.kernel_px * problem.scale
    root = np.sqrt(1 / (1 + (seen.errors**2).sum(axis=1) / kernel**2))
    root[seen.behind] = 0
    camera, point = derivatives(problem, solution, seen, bases)
    camera *= root[:, None, None]
    point *= root[:, None, None]
    if not settings.depths:
        point[:, :, 2] = 0
    errors = root[:, None] * seen.errors
    points = structure.summed_by_point(_products(point, point))
    point_gradients = structure.summed_by_point(_products(point, errors[:, :, None])[:, :, 0])
    if not settings.depths:
        points[:, 2, 2] += 1
    elif prior is not None:
        sigma = prior.sigma[structure.points]
        off = solution.inverse_ranges[structure.points] - prior.mean[structure.points]
        weight = (BUNDLE.prior_noise_px * problem.scale / sigma) ** 2 / (1 + (off / sigma) ** 2)
        points[:, 2, 2] += weight
        point_gradients[:, 2] += weight * off
    whole = np.zeros((problem.pictures * CAMERA,) * 2)
    gradient = np.zeros(problem.pictures * CAMERA)
    for j, mine in enumerate(structure.of_picture):
        rows = camera[mine].reshape(-1, CAMERA)
        block = slice(j * CAMERA, (j + 1) * CAMERA)
        whole[block, block] = rows.T @ rows
        gradient[block] = rows.T @ errors[mine].ravel()
    cameras, gradient = structure.reduced(whole), structure.reduced(gradient)
    weight = problem.lenses.weights(problem.scale)
    unknown = structure.columns[problem.lenses.first, 6:]
    free = unknown >= 0
    cameras[unknown[free], unknown[free]] += weight[free]
    gradient[unknown[free]] += (weight * solution.lens)[free]
    return Normal(cameras, gradient, points, point_gradients, _products(point, camera))


def _products(left: Array, right: Array) -> Array:
    """leftᵀ right of each observation: (O, 2, a), (O, 2, b) to (O, a, b)."""
    product: Array = left[:, 0, :, None] * right[:, 0, None, :]
    product += left[:, 1, :, None] * right[:, 1, None, :]
    return product


def schur_complement(structure: Structure, normal: Normal, inverses: Array) -> tuple[Array, Array]:
    """What of the cameras' equations remains without the points (C, C), (C,), their blocks' inverses given."""
    eliminated = np.matmul(inverses[structure.point], normal.between)
    count = structure.columns.size
    whole, gradient = np.zeros((count, count)), np.zeros(count)
    for j, mine in enumerate(structure.of_picture):
        block = slice(j * CAMERA, (j + 1) * CAMERA)
        rows = eliminated[mine].reshape(-1, CAMERA)
        whole[block, block] = normal.between[mine].reshape(-1, CAMERA).T @ rows
        gradient[block] = rows.T @ normal.point_gradients[structure.point[mine]].ravel()
    for i, j, first, second in structure.pairs:
        product = normal.between[first].reshape(-1, CAMERA).T @ eliminated[second].reshape(-1, CAMERA)
        rows_i, rows_j = slice(i * CAMERA, (i + 1) * CAMERA), slice(j * CAMERA, (j + 1) * CAMERA)
        whole[rows_i, rows_j] = product
        whole[rows_j, rows_i] = product.T
    return structure.reduced(whole), structure.reduced(gradient)


def scale_direction(structure: Structure, solution: Solution) -> Array:
    """How all places grow together (C,), a unit vector; 0 where they cannot.

    No observation tells the scale, but priors of ρ would be cheaper the larger it is.
    """
    columns = structure.columns[:, 3:6]
    free = columns >= 0
    growth = np.zeros(structure.unknowns)
    held = solution.centres[~free[:, 0]]
    if len(held) and np.ptp(held, axis=0).max() == 0:
        growth[columns[free]] = (solution.centres - held[0])[free]
    length = float(np.linalg.norm(growth))
    return growth / length if length else growth


def _solved(structure: Structure, normal: Normal, scale: Array, damping: float) -> tuple[Array, Array]:
    """Steps of the cameras' unknowns (C,) and of the points (P, 3); none along `scale` (C,)."""
    diagonal = np.einsum("pii->pi", normal.points)
    damped = normal.points + (damping * diagonal + 1e-12)[:, :, None] * np.eye(3)
    inverses = np.linalg.inv(damped)
    fill, gradient_fill = schur_complement(structure, normal, inverses)
    left = normal.cameras - fill
    size = len(left)
    left[np.diag_indices(size)] += damping * np.diag(normal.cameras)
    usual = np.trace(left) / max(size, 1)
    left[np.diag_indices(size)] += BUNDLE.regular * usual
    left += BUNDLE.scale_stiffness * usual * np.outer(scale, scale)
    step = np.linalg.solve(left, gradient_fill - normal.gradient)
    if not np.isfinite(step).all():  # the solver leaves NaN where products of its rows overflow, and says nothing
        raise np.linalg.LinAlgError("no finite step")
    by_camera = (structure.chooser @ step).reshape(-1, CAMERA)[structure.picture]
    pulled = structure.summed_by_point(np.matmul(normal.between, by_camera[:, :, None])[:, :, 0])
    points = -np.matmul(inverses, (normal.point_gradients + pulled)[:, :, None])[:, :, 0]
    return step, points


def _stepped(
    problem: Problem, solution: Solution, structure: Structure, bases: Array, step: Array, points: Array
) -> Solution:
    by_camera = (structure.chooser @ step).reshape(-1, CAMERA)
    lens = by_camera[problem.lenses.first, 6:]
    lens[:, 0] = np.clip(lens[:, 0], -BUNDLE.most_log_focal, BUNDLE.most_log_focal)
    chosen = structure.points
    rays, inverse_ranges = solution.rays.copy(), solution.inverse_ranges.copy()
    moved = rays[chosen] + np.matmul(bases[chosen], points[:, :2, None])[:, :, 0]
    lengths = np.linalg.norm(moved, axis=1)
    rays[chosen] = moved / lengths[:, None]
    inverse_ranges[chosen] = (inverse_ranges[chosen] + points[:, 2]) / lengths
    return replace(
        solution,
        R=rotations(by_camera[:, :3]) @ solution.R,
        centres=solution.centres + by_camera[:, 3:6],
        lens=solution.lens + lens,
        rays=rays,
        inverse_ranges=inverse_ranges,
    )
