"""Which pictures were taken from one place: proposed by pairs that rotate, decided by what the bundle costs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...raster.arrays import Array
from ...system.progress import Tick
from ..averaging.averaged import PairGeometry
from ..averaging.graph import components
from .bundle_options import JUDGE
from .polishing import Polished, polish, polish_rotations
from .positions import SamePlace, place_pictures
from .reprojection import lengths_of_errors
from .solution import Problem, Solution

Station = tuple[int, ...]


def proposed(pairs: Sequence[PairGeometry], members: Sequence[int]) -> list[Station]:
    """Stations that pairs join which a rotation explains, pictures counted among the members.

    A picture is taken out again as long as all its pairs inside together prefer a pose.
    """
    place = {member: k for k, member in enumerate(members)}
    gain = {(place[pair.i], place[pair.j]): pair.rotation_gain * len(pair.index) for pair in pairs}
    turning = [(place[pair.i], place[pair.j]) for pair in pairs if pair.rotates]
    found = []
    for group in components(len(members), turning):
        station = set(group)
        while len(station) > 1:
            inside = {k: sum(g for ends, g in gain.items() if k in ends and station.issuperset(ends)) for k in station}
            least = min(inside, key=lambda k: inside[k])
            if inside[least] >= 0:
                found.append(tuple(sorted(station)))
                break
            station.remove(least)
    return found


def same_places(pairs: Sequence[PairGeometry], members: Sequence[int]) -> list[SamePlace]:
    """Pairs that a rotation explains, pictures counted among the members."""
    place = {member: k for k, member in enumerate(members)}
    return [SamePlace(place[pair.i], place[pair.j], len(pair.index)) for pair in pairs if pair.rotates]


def without_parallax(problem: Problem, start: Solution, pairs: Sequence[PairGeometry], tick: Tick) -> Polished | None:
    """All at one place, where rotations leave nothing to be seen, whatever pairs prefer: matches err by more than their
    noise tells, and places and depth would only explain how. None elsewhere, or where poses are given."""
    left = np.repeat([pair.parallax_px for pair in pairs], [len(pair.index) for pair in pairs])
    if problem.held.any() or np.median(left) > JUDGE.hardly_apart_px * problem.scale:
        return None
    turned = polish_rotations(problem.with_stations([tuple(range(problem.pictures))]), start, tick)
    errors = lengths_of_errors(turned.problem, turned.solution)
    most = np.array(JUDGE.no_parallax_px) * problem.scale
    return turned if (np.nanpercentile(errors, JUDGE.no_parallax_percentiles) < most).all() else None


def polish_best(
    problem: Problem, start: Solution, stations: Sequence[Station], same: Sequence[SamePlace],
    framed: Callable[[Array], Array], tick: Tick,
) -> Polished:  # fmt: skip
    """The cheapest of: every picture at a place of its own and, where there are stations, those of each at one place,
    and all at one place: pairs with few matches do not show that they rotate. What more places cost is counted (BIC).
    Where there is little parallax, rotations bundled as if at one place are better to start from than averaged ones,
    and are tried too. Places of stations start both from nothing and from what was found without them: either start
    can end beside the best.

    framed: brings places (N, 3) to where the start's poses stand.
    """

    def from_nothing(assigned: Problem, begun: Solution) -> Polished:
        placed = place_pictures(assigned, begun, same)
        return polish(assigned, replace(begun, centres=framed(placed.centres)), tick)

    if not stations or problem.held.any():  # given poses say themselves what is at one place
        return from_nothing(problem, start)
    turned = polish_rotations(problem.with_stations([tuple(range(problem.pictures))]), start, tick)
    candidates = [turned, from_nothing(problem, start)]
    if _little_parallax(turned):
        candidates.append(from_nothing(problem, replace(start, R=turned.solution.R, lens=turned.solution.lens)))
    if not any(len(station) == problem.pictures for station in stations):
        tied = problem.with_stations(stations)
        apart = min(candidates[1:], key=lambda found: found.cost).solution
        together = replace(start, R=apart.R, lens=apart.lens, centres=_at_stations(tied, apart.centres))
        candidates += [from_nothing(tied, start), polish(tied, together, tick)]
    return min(candidates, key=information_criterion)


def _at_stations(problem: Problem, centres: Array) -> Array:
    """Places (N, 3) with those of one station in their middle."""
    _, number, count = np.unique(problem.place, return_inverse=True, return_counts=True)
    middle = np.stack([np.bincount(number, axis) for axis in centres.T], axis=1) / count[:, None]
    placed: Array = middle[number]
    return placed


def _little_parallax(turned: Polished) -> bool:
    """Whether most observations are about where rotations alone have them."""
    problem = turned.problem
    off = np.nanpercentile(lengths_of_errors(problem, turned.solution), JUDGE.little_parallax_percentile)
    return bool(off < JUDGE.little_parallax_sigmas * problem.noise_px)


def information_criterion(found: Polished) -> float:
    """Schwarz's criterion: the cost in nats, and half the log of the number of observations for each free parameter.

    A point that is seen from one place only has no depth: that is most of what a station saves.
    """
    problem = found.problem
    tracks = problem.tracks
    places = len(np.unique(problem.place)) - 1
    place = problem.place[tracks.picture]
    several = np.maximum.reduceat(place, tracks.starts) > np.minimum.reduceat(place, tracks.starts)
    depths = 0 if found.one_place else int((several & found.solution.solved).sum())
    noise = max(problem.noise_px, JUDGE.least_noise_px * problem.scale)
    return float(found.cost / (2 * noise**2) + (3 * places + depths) * np.log(len(tracks.point)) / 2)
