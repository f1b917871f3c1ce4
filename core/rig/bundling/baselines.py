"""How the lengths between pictures are known: points that three pictures see tie the lengths between the three."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...raster.arrays import Array
from ..averaging.averaged import PairGeometry
from ..averaging.graph import components
from .bundle_options import CONTINUITY
from .parts import parts_of_pairs
from .polishing import Polished


def baselines(pairs: Sequence[PairGeometry], members: Sequence[int], found: Polished) -> list[str]:
    """For each pair "measured", "continuity" or "none" (see `cameras.rig.RigEdge`): none where a pure rotation is the
    better model of its matches, so that they say of no baseline that there is one."""
    place = {member: k for k, member in enumerate(members)}
    groups = _rigid_groups(found)
    told = []
    for pair in pairs:
        i, j = place[pair.i], place[pair.j]
        station = found.problem.place[i] == found.problem.place[j]
        if station or pair.rotation_gain >= 0:
            told.append("none")
        else:
            told.append("measured" if any({i, j} <= group for group in groups) else "continuity")
    return told


def guessed_places(
    pairs: Sequence[PairGeometry], members: Sequence[int], known: Sequence[str], found: Polished
) -> Array:
    """Deviations (N,) of places by what nothing measured: the lengths of parts that only depth's continuity ties to the
    first picture's, known: what `baselines` says of each pair."""
    place = {member: k for k, member in enumerate(members)}
    centres = found.solution.centres
    joined = [(place[pair.i], place[pair.j]) for pair, how in zip(pairs, known, strict=True) if how != "continuity"]
    first = next(group for group in components(len(members), joined) if 0 in group)
    apart = np.linalg.norm(centres[:, None] - centres[list(first)], axis=2).min(axis=1)
    deviation: Array = CONTINUITY.log_sigma * apart
    return deviation


def _rigid_groups(found: Polished) -> list[set[int]]:
    """Pictures between which all lengths are in one proportion."""
    places, at = np.unique(found.problem.place, return_inverse=True)
    seen = np.zeros((len(places), len(found.problem.tracks)), bool)
    np.logical_or.at(seen, at, _visibility(found))
    if len(places) <= 2:
        return [set(range(len(at)))]  # the only length is the unit
    part = parts_of_pairs(seen, np.ones(seen.shape[1]))
    sizes = np.bincount(part[np.triu_indices(len(places), 1)])
    return [set(np.flatnonzero(np.isin(at, np.argwhere(part == one))).tolist()) for one in np.flatnonzero(sizes > 1)]


def _visibility(found: Polished) -> NDArray[np.bool_]:
    """Which pictures see which points (N, P)."""
    tracks, solution = found.problem.tracks, found.solution
    used = solution.used & solution.solved[tracks.point]
    seen = np.zeros((found.problem.pictures, len(tracks)), bool)
    seen[tracks.picture[used], tracks.point[used]] = True
    return seen
