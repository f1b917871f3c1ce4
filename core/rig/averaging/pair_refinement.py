"""Refining poses of pairs: each by itself, or all together with the lens that they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from .matched_rays import SharedLens
from .options import PAIR_FIT
from .pair_models import PairModel, Poses

# What keeps a matrix of a pair invertible whose matches leave something undetermined, relative and in px².
RIDGE = 1e-9


def refine_each(model: PairModel, poses: Poses, lens: SharedLens, iterations: int) -> Poses:
    """Every pair by itself, the lens held: Levenberg's method with a damping for each."""
    damping = np.full(len(model.rays), 1e-3)
    cost = model.costs(poses, lens)
    better = np.ones(len(damping), bool)
    for _ in range(iterations):
        if better.any():
            H, g = model.equations(poses, lens, shared=False)
        ridge = damping * np.trace(H, axis1=1, axis2=2) + RIDGE
        steps = -np.linalg.solve(H + ridge[:, None, None] * np.eye(model.freedom), g[..., None])[..., 0]
        tried = model.stepped(poses, _short(steps))
        tried_cost = model.costs(tried, lens)
        better = tried_cost < cost
        poses, cost = poses.chosen(better, tried), np.where(better, tried_cost, cost)
        damping = np.where(better, damping / 5, damping * 8)
        if (damping > 1e4).all():
            break
    return poses


@dataclass(frozen=True)
class LensPrior:
    """What is known of the shared lens before: σ of log factor about 0 and of k1 about 0; which of the two is free."""

    log_sigma: float
    free: tuple[bool, bool] = (True, True)

    @property
    def information(self) -> Array:
        """(2,), of log factor and k1."""
        return np.array([self.log_sigma**-2, PAIR_FIT.k1_sigma**-2])

    def cost(self, lens: SharedLens) -> float:
        """Half the square of how far it is off, in σ."""
        return 0.5 * float(self.information @ _vector(lens) ** 2)


@dataclass(frozen=True, eq=False)
class Together:
    """Pairs that were refined together: poses; lens; cost (log likelihood); information (P, n, n) of each pair's own
    parameters; by_focal (P, n), k1_by_focal: how they and k1 follow the log of the factor; focal_information: of the
    log of the factor, k1 and poses eliminated."""

    poses: Poses
    lens: SharedLens
    cost: float
    information: Array
    by_focal: Array
    k1_by_focal: float
    focal_information: float


def refine_together(
    model: PairModel, poses: Poses, lens: SharedLens, prior: LensPrior, noise: float, iterations: int
) -> Together:
    """All pairs and the lens: Gauss-Newton with each pair's own parameters eliminated; noise: σ px of a residual."""
    free = np.flatnonzero(prior.free)
    lens = model.rays.within_limits(lens)
    damping, cost = 1e-3, _total(model, poses, lens, prior, noise)
    system = _Eliminated(model, poses, lens, prior, noise)
    for _ in range(iterations):
        q = system.lens_step(damping, free)
        steps = system.pose_steps(q, damping)
        new_lens = model.rays.within_limits(SharedLens(lens.factor * float(np.exp(q[0])), lens.k1 + float(q[1])))
        tried = model.stepped(poses, _short(steps))
        tried_cost = _total(model, tried, new_lens, prior, noise)
        if tried_cost < cost:
            gained = cost - tried_cost
            poses, lens, cost, damping = tried, new_lens, tried_cost, max(damping / 5, 1e-9)
            system = _Eliminated(model, poses, lens, prior, noise)
            if gained < PAIR_FIT.tolerance:
                break
        else:
            damping *= 8
            if damping > 1e3:
                break
    S = system.reduced(0.0)[0]
    k1_by_focal = -float(S[0, 1] / S[1, 1]) if prior.free[1] else 0.0
    by_lens = -system.solved(0.0)[:, :, :2]
    by_focal = by_lens[:, :, 0] + by_lens[:, :, 1] * k1_by_focal
    focal_information = float(S[0, 0] + S[0, 1] * k1_by_focal)
    return Together(poses, lens, cost, system.own, by_focal, k1_by_focal, focal_information)


class _Eliminated:
    """The equations of all pairs and the lens at one point, in units of the noise."""

    def __init__(self, model: PairModel, poses: Poses, lens: SharedLens, prior: LensPrior, noise: float) -> None:
        n = model.freedom
        H, g = (term / noise**2 for term in model.equations(poses, lens, shared=True))
        self.own, self.cross, self.gradient = H[:, :n, :n], H[:, :n, n:], g[:, :n]
        self.shared = H[:, n:, n:].sum(axis=0) + np.diag(prior.information)
        self.shared_gradient = g[:, n:].sum(axis=0) + prior.information * _vector(lens)

    def solved(self, damping: float) -> Array:
        """What the own parameters answer (P, n, 3): to log factor, to k1, and to their own gradient."""
        n = self.own.shape[1]
        ridge = damping * np.trace(self.own, axis1=1, axis2=2) + 1e-6
        right = np.concatenate([self.cross, self.gradient[..., None]], axis=2)
        return np.linalg.solve(self.own + ridge[:, None, None] * np.eye(n), right)

    def reduced(self, damping: float) -> tuple[Array, Array]:
        """Normal matrix (2, 2) and gradient (2,) of the lens with the pairs eliminated."""
        answer = np.einsum("pki,pkj->ij", self.cross, self.solved(damping))
        return self.shared - answer[:, :2], self.shared_gradient - answer[:, 2]

    def lens_step(self, damping: float, free: NDArray[np.intp]) -> Array:
        """Step (2,) of log factor and k1."""
        S, gradient = self.reduced(damping)
        q = np.zeros(2)
        if len(free):
            kept = np.ix_(free, free)
            q[free] = -np.linalg.solve(S[kept] + damping * np.diag(np.diag(S[kept])), gradient[free])
        step: Array = np.clip(q, -PAIR_FIT.most_lens_step, PAIR_FIT.most_lens_step)
        return step

    def pose_steps(self, q: Array, damping: float) -> Array:
        """Steps (P, n) of the pairs after that step of the lens."""
        answer = self.solved(damping)
        steps: Array = -(answer[:, :, 2] + answer[:, :, :2] @ q)
        return steps


def _total(model: PairModel, poses: Poses, lens: SharedLens, prior: LensPrior, noise: float) -> float:
    return float(model.costs(poses, lens).sum()) / noise**2 + prior.cost(lens)


def _vector(lens: SharedLens) -> Array:
    return np.array([np.log(lens.factor), lens.k1])


def _short(steps: Array) -> Array:
    length = np.linalg.norm(steps, axis=1, keepdims=True)
    short: Array = steps * np.minimum(1, PAIR_FIT.most_pose_step / np.maximum(length, 1e-12))
    return short
