"""Rotations of all pictures from those of their pairs, which may have several candidates and depend on focal length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from .graph import Pair, is_bridge, strongest_tree, walk
from .options import AVERAGING
from .triplets import Triangles, triangles, without_contradicted
from .turns import degrees_between, rotation_vectors, rotations

# The cost of a candidate that a pair does not have.
NEVER = 1e6


@dataclass(frozen=True, eq=False)
class Links:
    """P pairs between N pictures, numbered 0 … N − 1.

    pairs: from which to which; R (P, C, 3, 3): candidates, R x_from = x_to, repeated up to C; costs (P, C): how much
    less likely (log) than the first, NEVER where repeated; information (P, 3, 3): of R, 1 / rad², turned from the left;
    by_focal (P, 3): how R turns with the log of the focal length; inliers (P,); exact: how many of the last are views
    of one body, whose rotations are known.
    """

    count: int
    pairs: tuple[Pair, ...]
    R: Array
    costs: Array
    information: Array
    by_focal: Array
    inliers: NDArray[np.intp]
    exact: int = 0

    @property
    def ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """From which and to which pictures (P,)."""
        both = np.array(self.pairs, np.intp)
        return both[:, 0], both[:, 1]

    @cached_property
    def degrees(self) -> Array:
        """Standard deviation (P,) of each pair's rotation, a mean over its axes."""
        ridge = 1e-6 * np.trace(self.information, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        spread = np.linalg.inv(self.information + ridge)
        degrees: Array = np.degrees(np.sqrt(np.trace(spread, axis1=1, axis2=2) / 3))
        return degrees

    @cached_property
    def weights(self) -> Array:
        """Information (P, 3, 3) with what rotations err beyond it."""
        ridge = 1e-6 * np.trace(self.information, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        spread = np.linalg.inv(self.information + ridge)
        beyond = np.full(len(self.pairs), np.radians(AVERAGING.systematic_degrees) ** 2)
        beyond[len(beyond) - self.exact :] = 0
        return np.linalg.inv(spread + beyond[:, None, None] * np.eye(3))

    @cached_property
    def allowed_degrees(self) -> Array:
        """By how much each pair (P,) may be off and still agrees."""
        return np.maximum(AVERAGING.agrees_degrees, AVERAGING.agrees_sigmas * self.degrees)


@dataclass(frozen=True, eq=False)
class Rotations:
    """R (N, 3, 3) of all pictures; choice (P,): of each pair's candidates; log_focal: change of the log of the focal
    length; used (P,): which pairs took part; cost: negative log likelihood; off_degrees (P,): of each pair."""

    R: Array
    choice: NDArray[np.intp]
    log_focal: float
    used: NDArray[np.bool_]
    cost: float
    off_degrees: Array


def average(links: Links, focal_information: float, log_focal_before: float = 0.0) -> Rotations:
    """Average rotations robustly.

    Pairs that triangles contradict start switched off; the rest is averaged with weights that fall off with misfit,
    from a wide scale to a sharp one. Pairs come back where they agree after all. Then single pairs are left out, and
    single candidates switched, as long as that lowers the cost of the whole: this closes loops that no triangle checks.

    Parameters
    ----------
    links : Links
        That join all N pictures.
    focal_information, log_focal_before : float
        What the pairs say of the change of the log of the focal length, and how surely (1 / variance).

    Returns
    -------
    Rotations
    """
    choices = [R[cost < NEVER] for R, cost in zip(links.R, links.costs, strict=True)]
    found = triangles(links.pairs, choices, links.degrees)
    problem = _Problem(links, focal_information, log_focal_before)
    averaged = _without_false(problem, found)
    state = _switched(problem, averaged.state, averaged.used)
    return Rotations(
        state.R, state.choice, state.log_focal, averaged.used, problem.cost(state), problem.off_degrees(state)
    )


@dataclass(frozen=True, eq=False)
class _State:
    R: Array
    choice: NDArray[np.intp]
    log_focal: float


@dataclass(frozen=True, eq=False)
class _FromTree:
    """Averaged from a tree on: which pairs took part at the end, and which of those no triangle confirms; cost."""

    state: _State
    used: NDArray[np.bool_]
    unconfirmed: NDArray[np.bool_]
    cost: float


def _without_false(problem: _Problem, found: Triangles) -> _FromTree:
    """Averaged rotations. Where some pairs disagree, those that no triangle confirms are left out one at a time: a
    false one in the first tree would have sound ones dropped for it."""
    links = problem.links
    given = np.ones(len(links.pairs), bool)
    best = _from_tree(problem, found, given)
    while (problem.off_degrees(best.state) > links.allowed_degrees).any():
        left = [links.pairs[k] for k in np.flatnonzero(given)]
        before = best
        for k in np.flatnonzero(before.unconfirmed & given):
            if not is_bridge(links.count, left, links.pairs[k]):
                without = given & (np.arange(len(given)) != k)
                tried = _from_tree(problem, found, without)
                if tried.cost < min(best.cost, before.cost - AVERAGING.switch_gain):
                    best, fewer = tried, without
        if best is before:
            break
        given = fewer
    return best


def _from_tree(problem: _Problem, found: Triangles, given: NDArray[np.bool_]) -> _FromTree:
    """Averaged with the given pairs, from the tree of the most trusted on; others come back where they agree."""
    links = problem.links
    used, closed = without_contradicted(links.count, links.pairs, found, links.degrees, given)
    unconfirmed = used & (closed == 0)
    state = _State(_along_tree(links, used, closed), np.zeros(len(links.pairs), np.intp), 0.0)
    state = problem.followed(state, used, AVERAGING.iterations, AVERAGING.widths)
    back = np.maximum(AVERAGING.back_degrees, AVERAGING.back_sigmas * links.degrees)
    used = used | (problem.off_degrees(state) < back)
    state = problem.followed(state, used, AVERAGING.again_iterations, AVERAGING.widths[-1:])
    return _FromTree(state, used, unconfirmed, problem.cost(state))


def _along_tree(links: Links, used: NDArray[np.bool_], closed: NDArray[np.intp]) -> Array:
    """First rotations (N, 3, 3): along the tree of the most trusted pairs."""
    trust = np.sqrt(links.inliers) * (1 + np.minimum(closed, AVERAGING.most_triangles))
    trust = trust / (AVERAGING.systematic_degrees + links.degrees) / (links.costs < NEVER).sum(axis=1)
    kept = np.flatnonzero(used)
    tree = strongest_tree(links.count, [links.pairs[k] for k in kept], trust[kept].tolist())
    number = {pair: k for k, pair in enumerate(links.pairs)}
    R = np.tile(np.eye(3), (links.count, 1, 1))
    for i, j in walk(tree, 0):
        R[j] = (links.R[number[i, j], 0] if (i, j) in number else links.R[number[j, i], 0].T) @ R[i]
    return R


class _Problem:
    """The cost of rotations and of a common change of the log of the focal length, and steps that lower it."""

    def __init__(self, links: Links, focal_information: float, log_focal_before: float) -> None:
        self.links, self.focal_information, self.before = links, focal_information, log_focal_before
        self.weights = links.weights
        self.first, self.second = links.ends
        self.each = np.arange(len(links.pairs))

    def _residuals(self, state: _State) -> tuple[Array, Array]:
        """Rotations (P, 3, 3) of the pairs at this focal length, and the vectors (P, 3) by which they are off."""
        R = rotations(self.links.by_focal * state.log_focal) @ self.links.R[self.each, state.choice]
        return R, rotation_vectors(R @ state.R[self.first] @ np.swapaxes(state.R[self.second], 1, 2))

    def off_degrees(self, state: _State) -> Array:
        """By how much each pair is off (P,)."""
        off: Array = np.degrees(np.linalg.norm(self._residuals(state)[1], axis=1))
        return off

    def cost(self, state: _State) -> float:
        """Negative log likelihood of all pairs, those that take no part too, with the sharp width."""
        off = self._residuals(state)[1]
        width = AVERAGING.widths[-1]
        robust = width**2 * np.log1p(_squares(off, self.weights) / width**2) / 2
        own = self.links.costs[self.each, state.choice]
        return float((robust + own).sum()) + 0.5 * self.focal_information * (state.log_focal - self.before) ** 2

    def chosen(self, state: _State, width: float) -> _State:
        """The candidates that fit best where the pictures stand now."""
        turn = rotations(self.links.by_focal * state.log_focal)[:, None]
        between = state.R[self.first] @ np.swapaxes(state.R[self.second], 1, 2)
        off = rotation_vectors(turn @ self.links.R @ between[:, None])
        squares = np.einsum("pci,pij,pcj->pc", off, self.weights, off)
        robust = width**2 * np.log1p(squares / width**2) / 2 + self.links.costs
        return replace(state, choice=robust.argmin(axis=1))

    def followed(
        self, state: _State, used: NDArray[np.bool_], iterations: int, widths: Sequence[float], choosing: bool = True
    ) -> _State:
        """Iterate with those pairs; the last width stays. choosing: whether candidates are chosen anew on the way."""
        for iteration in range(iterations):
            width = widths[min(iteration, len(widths) - 1)]
            if choosing and iteration % 3 == 2:
                state = self.chosen(state, width)
            state, step = self._stepped(state, used, width)
            if iteration > len(widths) + 4 and step < AVERAGING.tolerance:
                break
        return state

    def _stepped(self, state: _State, used: NDArray[np.bool_], width: float) -> tuple[_State, float]:
        system = self._system(state, used, width)
        step = np.linalg.solve(system.A, system.right)
        largest = float(np.abs(step[:-1]).max())
        turn = step[:-1].reshape(-1, 3) * min(1.0, AVERAGING.most_step / max(largest, 1e-12))
        change = float(np.clip(step[-1], -AVERAGING.most_focal_step, AVERAGING.most_focal_step))
        return replace(state, R=rotations(turn) @ state.R, log_focal=state.log_focal + change), largest

    def _system(self, state: _State, used: NDArray[np.bool_], width: float) -> _System:
        R, off = self._residuals(state)
        # near the end weights fall off faster: what disagrees by much must not pull at all
        power = 1.0 if width > AVERAGING.widths[-1] else 1.5
        weight = used / (1 + _squares(off, self.weights) / width**2) ** power
        weights = self.weights * weight[:, None, None]
        count = self.links.count
        J = np.concatenate([R, np.tile(-np.eye(3), (len(R), 1, 1)), self.links.by_focal[:, :, None]], axis=2)
        weighted = np.swapaxes(J, 1, 2) @ weights
        axes = np.arange(3)
        last = np.full(len(R), 3 * count)
        rows = np.column_stack([3 * self.first[:, None] + axes, 3 * self.second[:, None] + axes, last])
        A, right = np.zeros((3 * count + 1, 3 * count + 1)), np.zeros(3 * count + 1)
        np.add.at(A, (rows[:, :, None], rows[:, None, :]), weighted @ J)
        np.add.at(right, rows, -np.einsum("pij,pj->pi", weighted, off))
        A[-1, -1] += self.focal_information
        right[-1] -= self.focal_information * (state.log_focal - self.before)
        # the world turned under all pictures changes nothing: it is held
        world, mean = state.R.reshape(-1, 3), np.trace(A[:-1, :-1]) / (3 * count)
        A[:-1, :-1] += mean / (3 * count) * (world @ world.T)
        A += 1e-12 * mean * np.eye(len(A))
        return _System(A, right, J, rows, weights, off)

    def gains(self, state: _State, used: NDArray[np.bool_]) -> Array:
        """By how much the cost would fall (P, C) if a pair took another candidate and all gave way: linear theory."""
        system = self._system(state, used, AVERAGING.widths[-1])
        inverse = np.linalg.inv(system.A)
        J, W = system.J, system.weights
        give = W @ J @ inverse[system.rows[:, :, None], system.rows[:, None, :]] @ np.swapaxes(J, 1, 2) @ W
        now = self.links.R[self.each, state.choice]
        turn = rotation_vectors(self.links.R @ np.swapaxes(now, 1, 2)[:, None])
        rise = np.einsum("pci,pij,pj->pc", turn, W, system.off)
        rise += np.einsum("pci,pij,pcj->pc", turn, W - give, turn) / 2
        gains: Array = self.links.costs[self.each, state.choice][:, None] - self.links.costs - rise
        return gains


@dataclass(frozen=True, eq=False)
class _System:
    """Equations A step = right of turns of all pictures and the log of the focal length; J (P, 3, 7) at rows (P, 7) of
    A, weights (P, 3, 3) and residuals off (P, 3) of each pair."""

    A: Array
    right: Array
    J: Array
    rows: NDArray[np.intp]
    weights: Array
    off: Array


def _squares(off: Array, weights: Array) -> Array:
    squares: Array = np.einsum("pi,pij,pj->p", off, weights, off)
    return squares


def _switched(problem: _Problem, state: _State, used: NDArray[np.bool_]) -> _State:
    """Switch one pair's candidate at a time, the most promising first, as long as the whole becomes likelier."""
    costs = problem.links.costs
    best, tries, improved = problem.cost(state), 0, True
    while improved:
        improved = False
        gains = np.where(costs < NEVER, problem.gains(state, used), -np.inf)
        gains[problem.each, state.choice] = -np.inf
        order = np.argsort(-gains, axis=None, kind="stable")
        for flat in order[gains.ravel()[order] > -AVERAGING.switch_slack][: AVERAGING.most_switches - tries]:
            tries += 1
            pair, other = np.unravel_index(flat, gains.shape)
            tried = _with_choice(problem, state, used, int(pair), int(other), best)
            if tried is not None:
                state, best, improved = tried, problem.cost(tried), True
                break
    return state


def _with_choice(
    problem: _Problem, state: _State, used: NDArray[np.bool_], pair: int, other: int, best: float
) -> _State | None:
    """Followed with another candidate of a pair; None if that does not lower the cost."""
    choice = state.choice.copy()
    choice[pair] = other
    tried = replace(state, choice=choice)
    for iterations, widths, choosing in (
        (AVERAGING.switch_iterations, AVERAGING.switch_widths, False),
        (AVERAGING.again_iterations, AVERAGING.widths[-1:], True),
    ):
        tried = problem.followed(tried, used, iterations, widths, choosing)
        if problem.cost(tried) > best - AVERAGING.switch_gain:
            return None
    return tried


def worst_loop(links: Links, rotations_of_pairs: Array, used: NDArray[np.bool_]) -> float:
    """Degrees by which the worst loop of used pairs does not close; NaN without any.

    Loops: of each pair with the way between its pictures along the tree of the strongest ones.
    """
    kept = np.flatnonzero(used)
    pairs = [links.pairs[k] for k in kept]
    tree = strongest_tree(links.count, pairs, (links.inliers[kept] / links.degrees[kept]).tolist())
    number = dict(zip(pairs, kept, strict=True))
    R = np.full((links.count, 3, 3), np.nan)
    for root in range(links.count):
        if np.isnan(R[root]).any():
            R[root] = np.eye(3)
            for i, j in walk(tree, root):
                own = number.get((i, j))
                R[j] = (rotations_of_pairs[own] if own is not None else rotations_of_pairs[number[j, i]].T) @ R[i]
    loops = [k for k, pair in zip(kept, pairs, strict=True) if pair not in set(tree)]
    if not loops:
        return float("nan")
    first, second = (end[loops] for end in links.ends)
    return float(degrees_between(rotations_of_pairs[loops], R[second] @ np.swapaxes(R[first], 1, 2)).max())
