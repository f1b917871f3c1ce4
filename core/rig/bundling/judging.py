"""What a hypothesis costs at its end, over everything that was verified: by this hypotheses are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...cameras.camera import Camera
from ...cameras.rig import PictureMatches
from ...raster.arrays import Array
from ..averaging.averaged import PairGeometry, Verified
from ..averaging.matched_rays import SharedLens, matched_rays
from ..averaging.pair_models import EpipolarModel, Poses, RotationModel
from .bundle import robust_cost
from .bundle_options import JUDGE
from .polishing import Polished
from .reprojection import lengths_of_errors
from .solution import with_lens


def judged(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, members: Sequence[int],
    pairs: Sequence[PairGeometry], found: Polished,
) -> float:  # fmt: skip
    """The robust misfit of all that was verified, px² a match.

    Observations of points, left out or not, cost by how far off they are; matches that no track took, by how far off
    the epipolar lines of the final cameras. None costs more than what is `JUDGE.missed_kernels` off, and that is what
    matches with a picture cost that is no member.

    The kernel is as narrow as the noise: with a wider one the few matches that are wrong, as those of moving things
    are, decide instead of the many that are right.

    Parameters
    ----------
    cameras, points, verified
        As the bundle was given.
    members : sequence of int
        The pictures of the rig.
    pairs : sequence of PairGeometry
        Those whose matches became tracks.
    found : Polished
        The bundle's result.
    """
    scale = found.problem.scale
    seen = lengths_of_errors(found.problem, found.solution) / scale
    left = _untaken(verified, pairs)
    inside = [pair for pair in left if pair.i in members and pair.j in members]
    beside = np.zeros(0)
    if inside:
        beside = _off_lines(cameras, points, replace(verified, pairs=tuple(inside)), members, found) / scale
    outside = sum(len(pair) for pair in left) - sum(len(pair) for pair in inside)
    lengths = np.concatenate([np.nan_to_num(seen, nan=np.inf), beside, np.full(outside, np.inf)])
    most = np.sqrt(JUDGE.missed_kernels) * JUDGE.kernel_px
    total = robust_cost(np.minimum(lengths, most), JUDGE.kernel_px).sum()
    return float(total) / max(sum(len(pair) for pair in verified.pairs), 1)


def _untaken(verified: Verified, pairs: Sequence[PairGeometry]) -> list[PictureMatches]:
    """The matches that no track took, of each pair that has any."""
    taken = {(pair.i, pair.j): set(map(tuple, pair.index.tolist())) for pair in pairs}
    left = []
    for pair in verified.pairs:
        tracked = taken.get((pair.i, pair.j), set())
        apart = [match for match in pair.index.tolist() if tuple(match) not in tracked]
        if apart:
            left.append(replace(pair, index=np.array(apart, np.intp)))
    return left


def _off_lines(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, members: Sequence[int], found: Polished
) -> Array:
    """Sampson distances (O,) of matches from the epipolar lines of the final cameras, raw px; where two pictures were
    taken from one place, distances from where the rotation takes them."""
    solution, problem = found.solution, found.problem
    place = {member: k for k, member in enumerate(members)}
    final = list(cameras)
    for member, k in place.items():
        final[member] = with_lens(cameras[member], solution.lens[problem.lenses.of[k]])
    matched, ends = matched_rays(final, points, verified)
    first, second = np.array([[place[i], place[j]] for i, j in ends.tolist()]).T
    R = solution.R[second] @ np.swapaxes(solution.R[first], 1, 2)
    t = solution.t[second] - np.einsum("pij,pj->pi", R, solution.t[first])
    length = np.linalg.norm(t, axis=1)
    turning: NDArray[np.bool_] = (problem.place[first] == problem.place[second]) | (length == 0)
    poses = Poses(R, t / np.where(length > 0, length, 1)[:, None])
    models = [model(matched, JUDGE.kernel_px).squares(poses, SharedLens()) for model in (RotationModel, EpipolarModel)]
    off: Array = np.sqrt(np.where(turning[matched.owner], *models))
    return off
