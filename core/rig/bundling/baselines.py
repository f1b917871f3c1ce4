"""How the lengths between pictures are known: points that three pictures see tie the lengths between the three."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..averaging.averaged import PairGeometry
from ..averaging.graph import components
from .bundle_options import JUDGE
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


def _rigid_groups(found: Polished) -> list[set[int]]:
    """Pictures between which all lengths are in one proportion: triples, joined where they share two pictures."""
    seen = _visibility(found)
    count = len(seen)
    if count == 2:
        return [{0, 1}]  # the only length is the unit
    number = np.arange(count * count).reshape(count, count)
    links = []
    for i in range(count):
        for j in range(i + 1, count):
            shared = (seen[j + 1 :] & seen[i] & seen[j]).sum(axis=1)
            for k in j + 1 + np.flatnonzero(shared >= JUDGE.three_view_points):
                links += [(int(number[i, j]), int(number[i, k])), (int(number[i, j]), int(number[j, k]))]
    groups = [group for group in components(count * count, links) if len(group) > 1]
    return [{k for node in group for k in divmod(node, count)} for group in groups]


def _visibility(found: Polished) -> NDArray[np.bool_]:
    """Which pictures see which points (N, P)."""
    tracks, solution = found.problem.tracks, found.solution
    used = solution.used & solution.solved[tracks.point]
    seen = np.zeros((found.problem.pictures, len(tracks)), bool)
    seen[tracks.picture[used], tracks.point[used]] = True
    return seen
