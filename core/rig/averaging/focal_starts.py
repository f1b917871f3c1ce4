"""Focal lengths to start from where little is known of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...cameras.camera import Camera
from ...raster.arrays import Array
from ...system.progress import Tick, unwatched
from .averaged import Verified
from .candidates import ransac_pose
from .matched_rays import MatchedRays, SharedLens, matched_rays
from .options import LADDER
from .pair_models import EpipolarModel, Poses


def starts(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, tick: Tick = unwatched
) -> list[SharedLens]:
    """Hypotheses of the shared lens that are worth following to the end, the likeliest first.

    Parameters
    ----------
    cameras : sequence of Camera
        As known before.
    points : sequence of (M_i, 2)
        The features of every picture, raw px.
    verified : Verified
        Their matches.
    tick : callable
        Called between steps.

    Returns
    -------
    list of SharedLens
        One where the focal length is known to some per cent. Else the best of a ladder of focal lengths over the
        strongest pairs; a shorter one with a barrel lens, which looks much the same; and a second minimum.
    """
    sigma = log_sigma(cameras)
    if sigma <= LADDER.known_sigma or not verified.pairs:
        return [SharedLens()]
    matched, _ = matched_rays(cameras, points, verified)
    few = matched.of_pairs(np.arange(min(len(matched), LADDER.pairs))).thinned(LADDER.matches)
    factors = np.geomspace(*LADDER.factors, LADDER.rungs)
    cost = np.empty(len(factors))
    for rung, factor in enumerate(factors):
        tick()
        cost[rung] = _cost(few, SharedLens(float(factor)), verified)
    cost += 0.5 * (np.log(factors) / sigma) ** 2
    before, after = np.concatenate([[np.inf], cost[:-1]]), np.concatenate([cost[1:], [np.inf]])
    minima = np.flatnonzero((cost <= before) & (cost <= after))
    minima = minima[np.argsort(cost[minima], kind="stable")]
    best = float(factors[minima[0]])
    shorter, k1 = LADDER.barrel
    found = [SharedLens(best), matched.within_limits(SharedLens(best * shorter, k1))]
    for second in minima[1:2]:
        near = cost[second] < LADDER.second_share * cost.min() + LADDER.second_extra
        if near and abs(np.log(factors[second] / best)) > LADDER.second_log_focal:
            found.append(SharedLens(float(factors[second])))
    return found


def log_sigma(cameras: Sequence[Camera]) -> float:
    """σ of the log of the shared factor: what is known best of any camera that is not given; 0 if all are."""
    return min((camera.log_sigma for camera in cameras if not camera.fixed), default=0.0)


def _cost(matched: MatchedRays, lens: SharedLens, verified: Verified) -> float:
    """Robust cost of the poses that RANSAC finds with this focal length, log likelihood."""
    seen = matched.undistorted(lens)
    R, t = np.tile(np.eye(3), (len(matched), 1, 1)), np.tile([1.0, 0, 0], (len(matched), 1))
    for k in range(len(matched)):
        part = seen.of(slice(matched.starts[k], matched.starts[k + 1]))
        pose = ransac_pose(part, LADDER.iterations, verified.scale, verified.seed)
        if pose is not None:
            R[k], t[k], _ = pose
    width = LADDER.judged_px * verified.scale
    model = EpipolarModel(matched, width)
    return float(np.log1p(model.squares(Poses(R, t), lens) / width**2).sum())
