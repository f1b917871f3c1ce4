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
from .parts import part_of_points
from .polishing import Polished, cost_of_start, polish, polish_rotations
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


def at_one_place(problem: Problem, start: Solution, pairs: Sequence[PairGeometry], tick: Tick) -> Polished | None:
    """Rotations alone; None where they leave too much of the matches, or where poses are given."""
    left = np.repeat([pair.parallax_px for pair in pairs], [len(pair.index) for pair in pairs])
    if problem.held.any() or np.median(left) > JUDGE.hardly_apart_px * problem.scale:
        return None
    return _turned(problem, start, tick)


def _turned(problem: Problem, start: Solution, tick: Tick) -> Polished:
    return polish_rotations(problem.with_stations([tuple(range(problem.pictures))]), start, tick)


def no_parallax(turned: Polished) -> bool:
    """Whether rotations leave nothing to be seen, whatever pairs prefer: matches err by more than their noise tells,
    and places and depth would only explain how."""
    errors = lengths_of_errors(turned.problem, turned.solution)
    most = np.array(JUDGE.no_parallax_px) * turned.problem.scale
    return bool((np.nanpercentile(errors, JUDGE.no_parallax_percentiles) < most).all())


def polish_best(
    problem: Problem, start: Solution, stations: Sequence[Station], same: Sequence[SamePlace],
    framed: Callable[[Array], Array], tick: Tick, turned: Polished | None = None,
) -> Polished:  # fmt: skip
    """The cheapest of: every picture at a place of its own and, where there are stations, those of each at one place,
    those of all of them at one, and all pictures at one: pairs with few matches do not show that they rotate. What more
    places cost is counted (BIC).
    Where there is little parallax, rotations bundled as if at one place are better to start from than averaged ones,
    and are tried too.

    framed: brings places (N, 3) to where the start's poses stand; turned: rotations alone, where already known.
    """
    if not stations or problem.held.any():  # given poses say themselves what is at one place
        return _placed_and_polished(problem, start, same, framed, tick)
    turned = turned or _turned(problem, start, tick)
    most = information_criterion(turned)
    candidates = [turned, _placed_and_polished(problem, start, same, framed, tick, most=most)]
    if _little_parallax(turned):
        begun = replace(start, R=turned.solution.R, lens=turned.solution.lens)
        candidates.append(_placed_and_polished(problem, begun, same, framed, tick, most=most))
    apart = min(candidates[1:], key=lambda found: found.cost)
    for together in _assignments(stations, same, problem.pictures):
        assigned = problem.with_stations(together)
        known = _joined(assigned, apart.solution)
        candidates.append(_placed_and_polished(assigned, start, same, framed, tick, known, most))
    return min(candidates, key=information_criterion)


def _assignments(stations: Sequence[Station], same: Sequence[SamePlace], pictures: int) -> list[list[Station]]:
    """Stations as they are proposed and, of several, as one, without and with the pictures that were taken out again:
    pairs between them may have too few matches to show that they rotate. All pictures at one place are another
    candidate already."""
    found = [list(stations)]
    if len(stations) > 1:
        joined = {picture for station in stations for picture in station}
        turning = joined.union(*((pair.i, pair.j) for pair in same))
        found += [[tuple(sorted(one))] for one in ((joined, turning) if turning != joined else (joined,))]
    return [one for one in found if all(len(station) < pictures for station in one)]


def _placed_and_polished(
    problem: Problem, start: Solution, same: Sequence[SamePlace], framed: Callable[[Array], Array], tick: Tick,
    known: Solution | None = None, most: float = np.inf,
) -> Polished:  # fmt: skip
    """Places and bundle in turn, as long as the bundle's rotations give other places than it ends with, and a lower
    cost from there: averaged rotations can be degrees off, and so are places by them. It begins with what is known
    already where points tie all lengths and that costs less than the first places, which know how depth goes on, and
    ends where its parameters alone count for more than `most`: no bundle of them would be taken. Where points do not
    tie all lengths, places found anew may cost a little more."""
    begun = replace(start, centres=framed(place_pictures(problem, start, same).centres))
    tied = _is_tied(problem)
    if known is not None and tied:
        begun = min((begun, known), key=lambda one: cost_of_start(problem, one))
    best = polish(problem, begun, tick)
    for _ in range(JUDGE.most_anew):
        solution = best.solution
        if problem.held.any() or _of_parameters(best) > most:
            break
        centres = place_pictures(problem, solution, same).centres
        if _apart(centres, solution.centres) < JUDGE.astray:
            break
        again = polish(problem, replace(solution, centres=centres), tick)
        if again.cost >= best.cost * (1.0 if tied else JUDGE.as_cheap):
            break
        best = again
    return best


def _is_tied(problem: Problem) -> bool:
    """Whether points tie all lengths between different places."""
    place = problem.place[problem.tracks.picture]
    starts = problem.tracks.starts
    several = np.maximum.reduceat(place, starts) > np.minimum.reduceat(place, starts)
    return len(np.unique(part_of_points(problem.tracks, problem.place)[several])) <= 1


def _joined(problem: Problem, solution: Solution) -> Solution:
    """Pictures of one place in the middle of theirs."""
    _, number, counts = np.unique(problem.place, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(number, axis) for axis in solution.centres.T], axis=1)
    return replace(solution, centres=(sums / counts[:, None])[number])


def _apart(centres: Array, others: Array) -> float:
    """The most that places (N, 3) differ from others when both are shifted and scaled alike; 1: their extent."""
    mine, theirs = centres - centres.mean(axis=0), others - others.mean(axis=0)
    mine *= (mine * theirs).sum() / max(float((mine * mine).sum()), 1e-300)
    off, extent = (np.linalg.norm(values, axis=1).max() for values in (mine - theirs, theirs))
    return float(off / extent) if extent > 0 else 0.0


def _little_parallax(turned: Polished) -> bool:
    """Whether most observations are about where rotations alone have them."""
    problem = turned.problem
    off = np.nanpercentile(lengths_of_errors(problem, turned.solution), JUDGE.little_parallax_percentile)
    return bool(off < JUDGE.little_parallax_sigmas * problem.noise_px)


def information_criterion(found: Polished) -> float:
    """Schwarz's criterion: the cost in nats, and half the log of the number of observations for each free parameter.

    A point that is seen from one place only has no depth: that is most of what a station saves.
    """
    noise = max(found.problem.noise_px, JUDGE.least_noise_px * found.problem.scale)
    return float(found.cost / (2 * noise**2)) + _of_parameters(found)


def _of_parameters(found: Polished) -> float:
    """The part of the criterion that parameters count for."""
    problem, tracks = found.problem, found.problem.tracks
    places = len(np.unique(problem.place)) - 1
    place = problem.place[tracks.picture]
    several = np.maximum.reduceat(place, tracks.starts) > np.minimum.reduceat(place, tracks.starts)
    depths = 0 if found.one_place else int((several & found.solution.solved).sum())
    return float((3 * places + depths) * np.log(len(tracks.point)) / 2)
