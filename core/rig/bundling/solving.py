"""From one hypothesis of the lens to a bundled solution: rotations, tracks, places, bundle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...cameras.bodies import bodies_of
from ...cameras.camera import Camera
from ...raster.arrays import Array
from ...system.progress import Tick
from ..averaging.averaged import Averaged, PairGeometry, Verified
from ..averaging.averaging import averaged
from ..averaging.matched_rays import SharedLens
from .bundle_options import JUDGE
from .judging import judged
from .parts import supported
from .polishing import Polished, sharpened, start
from .solution import LENS, Problem, lenses_of
from .stations import at_one_place, no_parallax, polish_best, proposed, same_places
from .tracks import build_tracks, fitting_pairs
from .valley import lowest


@dataclass(frozen=True, eq=False)
class Solved:
    """A hypothesis at its end: averaged rotations; pairs whose matches became tracks; the bundle's result; cost: px² a
    verified match, what hypotheses are compared by; moved: the most that the bundle changed the log of a focal length.
    """

    averaged: Averaged
    pairs: list[PairGeometry]
    found: Polished
    cost: float
    moved: float


def solve(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, rotated: Averaged | None, tick: Tick
) -> Solved | None:
    """Follow a hypothesis, its averaged rotations, to its end; None if it connects no two pictures.

    Where the bundle moves the focal length much, pairs are estimated again with the bundle's: an error of some per cent
    turns every pair by degrees, and the tracks were chosen by that.
    """
    found: list[Solved] = []
    while rotated is not None and len(rotated.members) > 1:
        tick()
        found.append(_bundled(cameras, points, verified, rotated, tick))
        if found[-1].moved < JUDGE.most_log_focal or len(found) == JUDGE.passes:
            break
        known, shared = _cameras_of(cameras, rotated, found[-1].found)
        rotated = averaged(known, points, verified, shared, hold=True, tick=tick)
    return _ended(cameras, points, verified, min(found, key=lambda solved: solved.cost), tick) if found else None


def _ended(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, solved: Solved, tick: Tick
) -> Solved:
    """What is done once, with the best of all that was found from there."""
    found = sharpened(lowest(solved.found, tick), tick)
    cost = judged(cameras, points, verified, solved.averaged.members, solved.pairs, found)
    return replace(solved, found=found, cost=cost)


def _bundled(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, rotated: Averaged, tick: Tick
) -> Solved:
    pairs = fitting_pairs(rotated.pairs)
    members = rotated.members
    tracks = supported(build_tracks(pairs, points, members), len(members))
    own = [cameras[k] for k in members]
    held = np.array([camera.pose is not None for camera in own])
    lenses = lenses_of(own)
    bodies = bodies_of(own)
    problem = Problem(tracks, lenses, verified.scale, rotated.noise_px, bodies.of, held, bodies)
    by_pairs = [rotated.cameras[members[k]] for k in lenses.first]
    lens = np.zeros((len(lenses), LENS))
    lens[:, 0] = np.log([camera.focal for camera in by_pairs] / lenses.focal[lenses.first])
    lens[:, 1] = [camera.distortion[0] for camera in by_pairs]
    lens[~lenses.free] = 0
    given = _Given(own, held)
    begun = start(problem, given.turned(rotated.R[list(members)]), lens)
    turned = at_one_place(problem, begun, pairs, tick)
    if turned is not None and no_parallax(turned):
        found = turned
    else:
        stations = proposed(pairs, members) or ([tuple(range(len(members)))] if rotated.one_place else [])
        found = polish_best(problem, begun, stations, same_places(pairs, members), given.placed, tick, turned)
    moved = float(np.abs(found.solution.lens[:, 0] - lens[:, 0]).max())
    return Solved(rotated, pairs, found, judged(cameras, points, verified, members, pairs, found), moved)


class _Given:
    """Poses that are given: the rest is brought into their frame."""

    def __init__(self, cameras: Sequence[Camera], held: NDArray[np.bool_]) -> None:
        self.held = held
        poses = [camera.pose for camera in cameras if camera.pose is not None]
        self.R = np.array([R for R, _ in poses]).reshape(-1, 3, 3)
        self.centres = np.array([-R.T @ t for R, t in poses]).reshape(-1, 3)

    def turned(self, R: Array) -> Array:
        """Rotations (N, 3, 3) in the frame of the given ones, and those themselves."""
        if not len(self.R):
            return R
        between = Rotation.from_matrix(np.swapaxes(R[self.held], 1, 2) @ self.R).mean().as_matrix()
        turned: Array = R @ between
        turned[self.held] = self.R
        return turned

    def placed(self, centres: Array) -> Array:
        """Places (N, 3) likewise; the scale is the given ones' where they are apart."""
        if not len(self.R):
            return centres
        mine, theirs = centres[self.held], self.centres
        mine_off, theirs_off = mine - mine.mean(axis=0), theirs - theirs.mean(axis=0)
        own_size, size = np.linalg.norm(mine_off), np.linalg.norm(theirs_off)
        scale = size / own_size if own_size > 0 and size > 0 else 1.0
        moved: Array = (centres - mine.mean(axis=0)) * scale + theirs.mean(axis=0)
        moved[self.held] = theirs
        return moved


def _cameras_of(cameras: Sequence[Camera], rotated: Averaged, found: Polished) -> tuple[list[Camera], SharedLens]:
    """All pictures' cameras with the bundle's focal lengths, and its k1; those of pictures left out move as the others'
    do in the middle."""
    solution, lenses = found.solution, found.problem.lenses
    factors = np.full(len(cameras), np.exp(np.median(solution.lens[:, 0])))
    factors[list(rotated.members)] = np.exp(solution.lens[lenses.of, 0])
    known = [
        camera if camera.fixed else replace(camera, K=camera.scaled(float(factor)))
        for camera, factor in zip(cameras, factors, strict=True)
    ]
    free = lenses.free[:, 1]
    return known, SharedLens(1.0, float(np.median(solution.lens[free, 1])) if free.any() else 0.0)
