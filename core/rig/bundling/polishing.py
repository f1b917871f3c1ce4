"""From places that are nearly right to the bundle's result: bundling, leaving out what does not fit, bundling again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...raster.arrays import Array
from ...raster.robust import sigma_of_lengths
from ...system.progress import Tick
from .bundle import Bundled, DepthPrior, Settings, bundle, robust_cost
from .bundle_options import BUNDLE, JUDGE, POLISHING
from .reprojection import lengths_of_errors
from .solution import Problem, Solution
from .triangulation import triangulate


@dataclass(frozen=True, eq=False)
class Polished:
    """problem: with the places as they were tied; solution: about the picture nearest to the middle, largest distance
    of a place 1; cost: px², of all observations, also of those left out; behind: share of points with ρ < 0; one_place:
    whether only rotations were solved for; prior: what held points without parallax."""

    problem: Problem
    solution: Solution
    cost: float
    behind: float
    one_place: bool
    prior: DepthPrior | None


def polish(problem: Problem, solution: Solution, tick: Tick) -> Polished:
    """All of it, from rotations and places on; points are triangulated here."""
    reference = _middle(solution)
    solution = _points_anew(problem, solution.seen_from(reference).rescaled())
    prior = depth_prior(solution)
    wide = Settings(BUNDLE.first_kernel_px, POLISHING.first_iterations, POLISHING.first_tolerance, lenses=False)
    return _all_free(problem, bundle(problem, solution, wide, reference, prior, tick).solution, reference, tick)


def polished_on(problem: Problem, solution: Solution, tick: Tick) -> Polished:
    """The same from a solution with points on, all free from the beginning."""
    reference = _middle(solution)
    return _all_free(problem, solution.seen_from(reference), reference, tick)


def _all_free(problem: Problem, solution: Solution, reference: int, tick: Tick) -> Polished:
    """Rounds with all observations again, then until nothing changes."""
    for iterations, tolerance in zip(POLISHING.revived_iterations, POLISHING.revived_tolerances, strict=True):
        solution = _revived(problem, solution).rescaled()
        solution, _ = _round(problem, solution, reference, Settings(BUNDLE.kernel_px, iterations, tolerance), tick)
    solution = _settled(problem, solution, reference, BUNDLE.kernel_px, True, tick).rescaled()
    return Polished(problem, solution, total_cost(problem, solution), _behind(solution), False, depth_prior(solution))


def sharpened(found: Polished, tick: Tick) -> Polished:
    """The same bundled on with a kernel as wide as the noise, where that keeps the pictures together: to be done last,
    for a narrow kernel stays in the minimum that it begins in."""
    problem, wide = found.problem, found.solution
    _, noise_px = used_and_noise(problem, wide)
    if np.isnan(noise_px):
        return found
    kernel = BUNDLE.last_kernel_sigmas * noise_px / problem.scale
    kernel = float(np.clip(kernel, BUNDLE.least_kernel_px, BUNDLE.kernel_px))
    reference = 0 if found.one_place else _middle(wide)
    sharp = _settled(problem, wide.seen_from(reference), reference, kernel, not found.one_place, tick).rescaled()
    if _lost(problem, wide, sharp) > POLISHING.sharp_loss:
        return found
    cost, behind = total_cost(problem, sharp), _behind(sharp)
    return replace(found, solution=sharp, cost=cost, behind=behind, prior=depth_prior(sharp))


def used_and_noise(problem: Problem, solution: Solution) -> tuple[NDArray[np.bool_], float]:
    """Which observations (O,) are used, of those that have a point; and robust σ, px, of what is left of one coordinate
    of them, NaN without any."""
    lengths = lengths_of_errors(problem, solution)
    used = solution.used & np.isfinite(lengths)
    return used, sigma_of_lengths(lengths[used]) if used.any() else float("nan")


def _lost(problem: Problem, before: Solution, after: Solution) -> float:
    """Share of the observations that fitted before and do not any more, of the picture that lost most of its own."""
    fitting = [
        np.bincount(
            problem.tracks.picture[lengths_of_errors(problem, solution) < BUNDLE.kernel_px * problem.scale],
            minlength=problem.pictures,
        )
        for solution in (before, after)
    ]
    return float(np.max(1 - fitting[1] / np.maximum(fitting[0], 1), where=fitting[0] > 0, initial=0.0))


def _settled(
    problem: Problem, solution: Solution, reference: int, kernel_px: float, depths: bool, tick: Tick
) -> Solution:
    """Rounds with one kernel until hardly anything is left out any more and the cost does not fall."""
    last = np.inf
    for tolerance in POLISHING.tolerances:
        settings = Settings(kernel_px, POLISHING.iterations, tolerance, depths=depths)
        before = int(solution.used.sum())
        solution, cost = _round(problem, solution.rescaled(), reference, settings, tick)
        pruned = before - int(solution.used.sum())
        if pruned < POLISHING.settled_pruned * before and cost > (1 - POLISHING.settled_cost) * last:
            break
        last = cost
    return solution


def _round(
    problem: Problem, solution: Solution, reference: int, settings: Settings, tick: Tick
) -> tuple[Solution, float]:
    """One bundle, without the observations that it does not fit; the cost."""
    bundled = bundle(problem, solution, settings, reference, depth_prior(solution), tick)
    return _pruned(problem, bundled, POLISHING.prune_sigmas), bundled.cost


def polish_rotations(problem: Problem, solution: Solution, tick: Tick) -> Polished:
    """The same for pictures that were all taken from one place: every point is at infinity."""
    solution = replace(solution, centres=np.zeros_like(solution.centres)).seen_from(0)
    for kernel in POLISHING.rotation_kernels_px:
        solution = _points_anew(problem, solution)
        solution = replace(solution, inverse_ranges=np.zeros_like(solution.inverse_ranges))
        settings = Settings(kernel, POLISHING.rotation_iterations, POLISHING.rotation_tolerance, depths=False)
        bundled = bundle(problem, solution, settings, 0, None, tick)
        solution = _pruned(problem, bundled, POLISHING.rotation_prune_sigmas)
    return Polished(problem, solution, total_cost(problem, solution), 0.0, True, None)


def total_cost(problem: Problem, solution: Solution, kernel_px: float = BUNDLE.kernel_px) -> float:
    """The robust cost, px², of all observations: what is far off costs the same whether its point is solved or not."""
    kernel = kernel_px * problem.scale
    most = np.sqrt(JUDGE.missed_kernels) * kernel
    lengths = np.nan_to_num(lengths_of_errors(problem, solution), nan=most)
    return float(robust_cost(np.minimum(lengths, most), kernel).sum())


def cost_of_start(problem: Problem, solution: Solution) -> float:
    """The robust cost, px², of all observations before any bundle, their points as these places have them."""
    return total_cost(problem, _points_anew(problem, solution.rescaled()))


def depth_prior(solution: Solution) -> DepthPrior | None:
    """ρ near the median of its neighbours in direction, within the spread of all: weak where there is any parallax."""
    points = np.flatnonzero(solution.solved)
    if len(points) < POLISHING.prior_least_points or not solution.centres.any():
        return None
    rays, inverse_ranges = solution.rays[points], solution.inverse_ranges[points]
    _, near = cKDTree(rays).query(rays, k=POLISHING.prior_neighbours + 1)
    mean = np.zeros(len(solution.solved))
    mean[points] = np.median(inverse_ranges[near[:, 1:]], axis=1)
    spread = max(float(np.percentile(np.abs(inverse_ranges), POLISHING.prior_percentile)), 1e-9)
    return DepthPrior(mean, np.full(len(mean), POLISHING.prior_share * spread))


def _middle(solution: Solution) -> int:
    """The picture whose place is nearest to the mean of all: rays from there are the best conditioned."""
    centres = solution.centres
    return int(np.argmin(np.linalg.norm(centres - centres.mean(axis=0), axis=1)))


def _points_anew(problem: Problem, solution: Solution) -> Solution:
    everything = np.ones(len(problem.tracks.point), bool)
    return triangulate(problem, replace(solution, used=everything))


def _revived(problem: Problem, solution: Solution) -> Solution:
    """All observations again; points that they do not fit, or that had too few, are triangulated anew."""
    anew = _points_anew(problem, solution)
    lengths = lengths_of_errors(problem, solution)
    worst = np.maximum.reduceat(np.nan_to_num(lengths, nan=np.inf), problem.tracks.starts)
    bad = (worst > POLISHING.retriangulate_px * problem.scale) | ~solution.solved
    rays = np.where(bad[:, None], anew.rays, solution.rays)
    inverse_ranges = np.where(bad, anew.inverse_ranges, solution.inverse_ranges)
    return replace(anew, rays=rays, inverse_ranges=inverse_ranges)


def _pruned(problem: Problem, bundled: Bundled, sigmas: float) -> Solution:
    """Without the observations that are too far off."""
    solution = bundled.solution
    if not len(bundled.lengths):
        return solution
    limit = max(sigmas * sigma_of_lengths(bundled.lengths), POLISHING.prune_px * problem.scale)
    bad = bundled.chosen[bundled.lengths > limit]
    used = solution.used.copy()
    used[bad] = False
    return replace(solution, used=used)


def _behind(solution: Solution) -> float:
    ranges = solution.inverse_ranges[solution.solved]
    return float((ranges < 0).mean()) if len(ranges) else 0.0


def start(problem: Problem, R: Array, lens: Array) -> Solution:
    """Where the bundle begins before places are known, lens (L, LENS): no points, all places the origin."""
    points, observations = len(problem.tracks), len(problem.tracks.point)
    ahead = np.tile([0.0, 0, 1], (points, 1))
    nowhere = np.zeros((problem.pictures, 3))
    none = np.zeros(points, bool)
    return Solution(R, nowhere, lens, ahead, np.zeros(points), none, np.ones(observations, bool))
