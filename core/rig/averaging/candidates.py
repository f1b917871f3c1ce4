"""The poses that the matches of each pair allow: with few matches the deepest minimum is often a wrong one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import poselib
from numpy.typing import NDArray

from ...pose.rotation import nearest_rotation
from ...raster.arrays import Array
from ...raster.robust import sigma_of
from ...system.progress import Tick, unwatched
from .matched_rays import MatchedRays, Rays, SharedLens
from .options import CANDIDATES, PAIR_FIT
from .pair_models import EpipolarModel, Poses, cauchy_costs
from .pair_refinement import refine_each
from .turns import degrees_between, dot

# Directions of a baseline all around, opposite ones left out: of a cube's faces, edges and corners.
_CUBE = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1], [1, 1, 1],
     [1, 1, -1], [1, -1, 1], [-1, 1, 1]], float
)  # fmt: skip
DIRECTIONS = _CUBE / np.linalg.norm(_CUBE, axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Candidates:
    """The poses of the pairs that have any, by one lens.

    numbers (P,): which of all verified pairs they are; inliers (O,): of all verified matches; rays: those inliers, of
    pairs with very many only some; turned (P, 3, 3): the best pure rotations; poses: of every pair the best first;
    costs: their negative log likelihoods; noise: σ px of a Sampson distance.
    """

    numbers: NDArray[np.intp]
    inliers: NDArray[np.bool_]
    rays: MatchedRays
    turned: Array
    poses: tuple[Poses, ...]
    costs: tuple[Array, ...]
    noise: float

    @property
    def first(self) -> Poses:
        """The best pose of each pair."""
        return Poses(np.array([poses.R[0] for poses in self.poses]), np.array([poses.t[0] for poses in self.poses]))


def candidates(
    matched: MatchedRays, lens: SharedLens, scale: float, seed: int, tick: Tick = unwatched
) -> Candidates:
    """Poses of all pairs, the best first.

    Starts are RANSAC's pose and, where matches are few, those of other seeds and the best pure rotation with directions
    of the baseline all around; so is a rotation that is given to begin with. All are refined and judged by a Cauchy
    cost, and by parallax of the wrong sign.

    Parameters
    ----------
    matched : MatchedRays
        All verified matches.
    lens : SharedLens
        At which they are seen.
    scale : float
        px by which thresholds are multiplied.
    seed : int
        Of RANSAC.
    tick : callable
        Called before each pair.

    Returns
    -------
    Candidates
        Of the pairs that some pose explains.
    """
    seen = matched.undistorted(lens)
    numbers, turned, starts = [], [], []
    inliers = np.zeros(len(seen.a), bool)
    for k in range(len(matched)):
        tick()
        rows = slice(matched.starts[k], matched.starts[k + 1])
        part = seen.of(rows)
        poses, agree = _ransac(part, scale, seed)
        if agree.sum() < CANDIDATES.min_inliers:
            continue
        rotation = _best_rotation(part, scale, seed)
        given = matched.turns[k] if matched.turns else None
        if len(part.a) < CANDIDATES.few_matches:
            poses = _all_around(poses, rotation)
        else:
            poses = Poses(poses.R[:1], poses.t[:1])
        if given is not None:
            poses = _all_around(poses, given)
        inliers[rows] = agree
        numbers.append(k)
        turned.append(rotation)
        starts.append(poses)
    kept = np.array(numbers, np.intp)
    if not len(kept):
        noise = PAIR_FIT.start_noise_px * scale
        return Candidates(kept, inliers, matched.of_pairs(kept), np.zeros((0, 3, 3)), (), (), noise)
    rays = _of_inliers(matched, kept, inliers)
    return _refined(kept, inliers, rays, np.array(turned), starts, lens, scale)


def _all_around(poses: Poses, rotation: Array) -> Poses:
    """Further poses: a rotation (3, 3) with directions of the baseline all around."""
    around = np.broadcast_to(rotation, (len(DIRECTIONS), 3, 3))
    return Poses(np.concatenate([poses.R, around]), np.concatenate([poses.t, DIRECTIONS]))


def at_other_lens(found: Candidates, lens: SharedLens, scale: float) -> Candidates:
    """The same candidates refined at another lens, and judged and ordered anew."""
    return _refined(found.numbers, found.inliers, found.rays, found.turned, list(found.poses), lens, scale)


def belonging(matched: MatchedRays, squares: Array, before: NDArray[np.bool_], scale: float) -> NDArray[np.bool_]:
    """Which matches (O,) with such squared distances, px², belong to their pair's pose; those that did before too where
    that leaves few."""
    inliers = squares < (CANDIDATES.inlier_px * scale) ** 2
    scarce = matched.sums(inliers.astype(np.intp)) < CANDIDATES.min_inliers
    out: NDArray[np.bool_] = inliers | before & scarce[matched.owner]
    return out


def _of_inliers(matched: MatchedRays, kept: NDArray[np.intp], inliers: NDArray[np.bool_]) -> MatchedRays:
    masks = [inliers[matched.starts[k] : matched.starts[k + 1]] for k in kept]
    return matched.of_pairs(kept).where(np.concatenate(masks)).thinned(CANDIDATES.most_matches)


def _refined(
    kept: NDArray[np.intp], inliers: NDArray[np.bool_], rays: MatchedRays, turned: Array, starts: list[Poses],
    lens: SharedLens, scale: float,
) -> Candidates:  # fmt: skip
    width = PAIR_FIT.cauchy_px * scale
    owner = np.repeat(np.arange(len(starts)), [len(poses.R) for poses in starts])
    poses = Poses(np.concatenate([p.R for p in starts]), np.concatenate([p.t for p in starts]))
    # a few iterations tell which starts are worth more
    for iterations, most in CANDIDATES.refining:
        many = rays.of_pairs(owner)
        model = EpipolarModel(many, width)
        poses = refine_each(model, poses, lens, iterations)
        residual = model.residuals(poses, lens)
        fit = cauchy_costs(many, residual**2, width)
        order = np.lexsort((fit, owner))
        rank = np.arange(len(owner)) - np.searchsorted(owner, owner)
        first = order[rank == 0]
        if (rank >= most).any():
            best = np.sort(order[rank < most])
            owner, poses = owner[best], Poses(poses.R[best], poses.t[best])
    noise = noise_of(residual[np.isin(many.owner, first)], scale)
    behind, poses = _facing(many, residual, poses, lens, width)
    cost = (fit + behind) / noise**2
    chosen, costs = [], []
    for k in range(len(starts)):
        of_pair = np.flatnonzero(owner == k)
        distinct = _distinct(poses.R[of_pair], cost[of_pair], turned[k])
        chosen.append(Poses(poses.R[of_pair[distinct]], poses.t[of_pair[distinct]]))
        costs.append(cost[of_pair[distinct]])
    return Candidates(kept, inliers, rays, turned, tuple(chosen), tuple(costs), noise)


def noise_of(residual: Array, scale: float) -> float:
    """σ px of Sampson distances, never less than what features are good for."""
    return max(sigma_of(residual), PAIR_FIT.least_noise_px * scale)


def _ransac(seen: Rays, scale: float, seed: int) -> tuple[Poses, NDArray[np.bool_]]:
    """Poses by several seeds where matches are few, that with most inliers first, and those inliers."""
    seeds = range(seed, seed + (CANDIDATES.seeds if len(seen.a) < CANDIDATES.few_matches else 1))
    tried = [ransac_pose(seen, CANDIDATES.iterations, scale, each) for each in seeds]
    found = [each for each in tried if each is not None]
    if not found:
        return Poses(np.zeros((0, 3, 3)), np.zeros((0, 3))), np.zeros(len(seen.a), bool)
    found.sort(key=lambda item: -int(item[2].sum()))
    return Poses(np.array([f[0] for f in found]), np.array([f[1] for f in found])), found[0][2]


def ransac_pose(
    seen: Rays, iterations: int, scale: float, seed: int
) -> tuple[Array, Array, NDArray[np.bool_]] | None:
    """R (3, 3), t (3,) of length 1 and the inliers (O,) of a pair's pose; None if no sample gives one."""
    sides = [ray[:, :2] * focal[:, None] for ray, focal in zip((seen.a, seen.b), seen.focal, strict=True)]
    # points lie about the principal point: the size is not looked at
    cameras = [
        {"model": "SIMPLE_PINHOLE", "width": 1, "height": 1, "params": [float(focal[0]), 0.0, 0.0]}
        for focal in seen.focal
    ]
    options = {
        "max_epipolar_error": CANDIDATES.inlier_px * scale,
        "seed": seed,
        "max_iterations": iterations,
        "min_iterations": CANDIDATES.fewest_iterations,
    }
    pose, info = poselib.estimate_relative_pose(*sides, *cameras, options, {})
    length = float(np.linalg.norm(pose.t))
    if not length > 0 or not np.isfinite(pose.R).all():
        return None
    return np.asarray(pose.R), np.asarray(pose.t) / length, np.asarray(info["inliers"], bool)


def _best_rotation(seen: Rays, scale: float, seed: int) -> Array:
    """The pure rotation (3, 3) that most matches are near, fitted to them with weights that fall off with distance."""
    a, b = seen.unit()
    threshold = CANDIDATES.rotation_px * scale / float(seen.focal[1].mean())
    drawn = np.random.default_rng(seed).integers(0, len(a), (CANDIDATES.rotation_samples, 2))
    drawn = drawn[drawn[:, 0] != drawn[:, 1]]
    tried = _frames(b[drawn]) @ np.swapaxes(_frames(a[drawn]), 1, 2)
    near = (np.linalg.norm(a @ np.swapaxes(tried, 1, 2) - b, axis=2) < threshold).sum(axis=1)
    return fit_rotation(a, b, tried[int(near.argmax())], threshold / 2, CANDIDATES.rotation_rounds)


def _frames(pairs: Array) -> Array:
    """Right-handed frames (S, 3, 3), as columns, of two unit vectors each (S, 2, 3)."""
    middle, across = pairs.sum(axis=1), np.cross(pairs[:, 0], pairs[:, 1])
    frame = np.stack([middle, across, np.cross(middle, across)], axis=2)
    unit: Array = frame / np.maximum(np.linalg.norm(frame, axis=1, keepdims=True), 1e-12)
    return unit


def fit_rotation(a: Array, b: Array, R: Array, width: float, rounds: int) -> Array:
    """The rotation that takes unit vectors a to b (M, 3) best, from R on; width: rad from which they count less."""
    for _ in range(rounds):
        weight = 1 / (1 + ((a @ R.T - b) ** 2).sum(axis=1) / width**2)
        R = nearest_rotation((b * weight[:, None]).T @ a)
    return R


def _facing(rays: MatchedRays, residual: Array, poses: Poses, lens: SharedLens, width: float) -> tuple[Array, Poses]:
    """What points behind the cameras cost (P,), px², and t with the sign that has fewer: parallax along the epipolar
    line is of one sign in front."""
    seen = rays.undistorted(lens)
    a, b = seen.unit()
    turned = np.einsum("oij,oj->oi", poses.R[rays.owner], a)
    t = poses.t[rays.owner]
    along = t - dot(t, turned)[:, None] * turned
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    parallax = seen.focal[1] / np.sqrt(2) * dot(b - turned, along)
    weight = 1 / (1 + (residual / width) ** 2)
    cost = [
        rays.sums(weight * 0.5 * width**2 * np.log1p((np.minimum(sign * parallax, 0) / width) ** 2)) for sign in (1, -1)
    ]
    sign = np.where(cost[0] <= cost[1], 1.0, -1.0)
    return np.minimum(*cost), Poses(poses.R, poses.t * sign[:, None])


def _distinct(R: Array, cost: Array, turned: Array) -> list[int]:
    """Which candidates of a pair are worth keeping, the best first."""
    order = np.argsort(cost, kind="stable")
    near = degrees_between(R, turned) < CANDIDATES.from_rotation_degrees
    chosen: list[int] = []
    for k in order[cost[order] < cost[order[0]] + CANDIDATES.log_likelihood]:
        apart = not chosen or (degrees_between(R[chosen], R[k]) > CANDIDATES.apart_degrees).all()
        if apart and near[k]:
            chosen.append(int(k))
    return chosen[: CANDIDATES.most] or [int(order[0])]
