"""Other minima along what the pictures hardly tell: the focal length of few pictures, or of what is far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...system.progress import Tick
from .bundle_options import JUDGE, VALLEY
from .polishing import Polished, polish, polished_on, total_cost, used_and_noise
from .solution import Problem, Solution
from .uncertainty import deviations


def lowest(found: Polished, tick: Tick) -> Polished:
    """The cheapest of what is found from longer and shorter focal lengths, step by step as long as the cost falls.

    Focal length, distortion, principal point and places make up for each other there, and the bundle ends in whichever
    hollow of the valley is nearest to its start. Where many points lie beyond infinity the lens fits what the places
    should. Nothing is tried where the focal length is well known.
    """
    tick()
    if found.one_place or not _unsure(found):
        return found
    best, least = found, _cost(found)
    for step in (-VALLEY.log_step, VALLEY.log_step):
        for _ in range(VALLEY.steps):
            lens = best.solution.lens.copy()
            lens[:, 0] += np.where(best.problem.lenses.free[:, 0], step, 0.0)
            tried = _tried(best.problem, replace(best.solution, lens=lens), tick)
            cost = _cost(tried)
            if cost >= (1 - VALLEY.least_gain) * least or tried.behind > max(VALLEY.most_behind, best.behind):
                break
            best, least = tried, cost
    return best


def _tried(problem: Problem, solution: Solution, tick: Tick) -> Polished:
    """Bundled from there; where that ends with many points beyond infinity, again with all of them triangulated anew,
    from where those begin at infinity."""
    tried = polished_on(problem, solution, tick)
    for _ in range(VALLEY.anew):
        if tried.behind <= VALLEY.most_behind:
            break
        tried = polish(problem, tried.solution, tick)
    return tried


def _cost(found: Polished) -> float:
    """By the narrow kernel that hypotheses are compared by: with the bundle's own, few wrong matches decide."""
    return total_cost(found.problem, found.solution, JUDGE.kernel_px)


def _unsure(found: Polished) -> bool:
    _, noise_px = used_and_noise(found.problem, found.solution)
    if np.isnan(noise_px) or not found.problem.lenses.free[:, 0].any():
        return False
    return bool(deviations(found, noise_px).log_focal.max() > VALLEY.unsure)
