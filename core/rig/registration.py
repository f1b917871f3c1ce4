"""The way in: from features and matches of N pictures to their cameras."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..cameras.bodies import Bodies, bodies_of
from ..cameras.camera import Camera
from ..cameras.lens import undistort
from ..cameras.rig import FocalGuess, Observations, PictureMatches, Registration, Rig, RigEdge
from ..pose.options import FOCAL
from ..raster.arrays import Array
from ..system.errors import NoOverlap
from ..system.progress import Progress, ReportProgress
from .averaging.averaged import PairGeometry, Verified
from .averaging.averaging import hypotheses
from .averaging.graph import components
from .averaging.options import PAIRS
from .averaging.pairs import verified as verify
from .averaging.turns import degrees_between
from .bundling.baselines import baselines, guessed_places
from .bundling.bundle_options import JUDGE
from .bundling.polishing import Polished, used_and_noise
from .bundling.solution import lens_of, with_lens
from .bundling.solving import Solved, solve
from .bundling.uncertainty import deviations
from .given_poses import check_given_poses
from .twins import twins_of, with_twins, without

# Shares of the work that are done when pairs are verified, and when their rotations are averaged.
_VERIFIED, _AVERAGED = 0.1, 0.4


def register(
    cameras: Sequence[Camera],
    points: Sequence[Array],
    matches: Sequence[PictureMatches],
    scale: float = 1.0,
    seed: int = 0,
    progress: ReportProgress | None = None,
    names: Sequence[str] = (),
) -> Registration:
    """Find the cameras of all pictures that connect, in the frame of the first of them.

    The order of the pictures matters for nothing else. Of pictures that show the same from the same place one is
    registered, and the others stand where it does.

    Parameters
    ----------
    cameras : sequence of Camera
        As known before matching. Given focal lengths and poses stay; poses are world to camera.
    points : sequence of (M_i, 2)
        The features of every picture, raw px.
    matches : sequence of PictureMatches
        Which of them match, of each pair at most once.
    scale : float
        px by which thresholds are multiplied: full pixels per pixel of the picture that features were found in.
    seed : int
        Of every random choice.
    progress : callable
        Told of the stage "geometry"; raises `Cancelled` when it was asked to.
    names : sequence of str, optional
        What pictures are called where it is said why one is left out; by default their numbers from 1.

    Returns
    -------
    Registration

    Raises
    ------
    NoOverlap
        If no two pictures connect.
    DegenerateGeometry
        If given cameras do not fit the matches.
    """
    progress = progress or Progress()
    names = names or [f"picture {number}" for number in range(1, len(cameras) + 1)]
    twins = twins_of(cameras, points, matches, scale)
    kept = [number for number in range(len(cameras)) if number not in twins]
    if not twins or len(kept) < 2:
        return _registered(cameras, points, matches, scale, seed, progress, names)
    found = _registered(
        [cameras[number] for number in kept], [points[number] for number in kept], without(twins, matches, kept), scale,
        seed, progress, [names[number] for number in kept],
    )  # fmt: skip
    return with_twins(found, kept, twins, points, matches, scale, names)


def _registered(
    cameras: Sequence[Camera], points: Sequence[Array], matches: Sequence[PictureMatches], scale: float, seed: int,
    progress: ReportProgress, names: Sequence[str],
) -> Registration:  # fmt: skip
    """The same of pictures of which none shows just what another one does."""
    ideal = [undistort(p, camera) for p, camera in zip(points, cameras, strict=True)]
    plain = [camera.without_lens() for camera in cameras]
    verified = verify(ideal, _watched(matches, progress), scale, seed)
    check_given_poses(plain, ideal, verified, names)
    bodies = bodies_of(cameras)
    averages = hypotheses(plain, ideal, verified, partial(progress, "geometry", _VERIFIED))
    found = []
    for k, rotated in enumerate(averages):
        share = _AVERAGED + (1 - _AVERAGED) * k / len(averages)
        solved = solve(plain, ideal, verified, rotated, partial(progress, "geometry", share))
        if solved is not None:
            found.append(solved)
    if not found:
        raise NoOverlap(_nothing_connects(verified))
    found.sort(key=lambda solved: solved.cost)
    left_out = _left_out(names, found[0].averaged.members, verified, bodies)
    return _registration_of(cameras, points, found, left_out)


def _watched(matches: Sequence[PictureMatches], progress: ReportProgress) -> Iterator[PictureMatches]:
    """The same matches; each is told before it is looked at."""
    for number, pair in enumerate(matches):
        progress("geometry", _VERIFIED * number / len(matches))
        yield pair


def _registration_of(
    cameras: Sequence[Camera], points: Sequence[Array], found: Sequence[Solved], left_out: dict[int, str]
) -> Registration:
    best = found[0]
    framed = replace(best.found, solution=best.found.solution.seen_from(0).rescaled())
    pairs = sorted(best.averaged.pairs, key=lambda pair: (pair.i, pair.j))
    lengths = baselines(pairs, best.averaged.members, framed)
    members = best.averaged.members
    edges = _edges(best, framed, pairs, lengths)
    guessed = guessed_places(pairs, members, lengths, framed)
    rig = _rig(cameras, points, best, framed, edges, _guesses(found), guessed)
    return Registration(rig, members, left_out)


def _rig(
    cameras: Sequence[Camera], points: Sequence[Array], best: Solved, found: Polished, edges: tuple[RigEdge, ...],
    guesses: tuple[FocalGuess, ...], guessed: Array,
) -> Rig:  # fmt: skip
    """guessed (N,): deviations of places by what nothing measured."""
    problem, solution, members = found.problem, found.solution, best.averaged.members
    tracks, lens = problem.tracks, problem.lenses.of
    used, noise = used_and_noise(problem, solution)
    sure = deviations(found, noise)
    log_focal = np.where(sure.log_focal > 0, np.hypot(sure.log_focal, _apart(guesses)), 0.0)
    whole = solution.solved & (np.bincount(tracks.point[used], minlength=len(tracks)) >= 2)
    number = np.cumsum(whole) - 1
    rows = np.flatnonzero(whole[tracks.point])
    raw = np.array([points[members[j]][k] for j, k in zip(tracks.picture[rows], tracks.feature[rows], strict=True)])
    seen = Observations(tracks.picture[rows], number[tracks.point[rows]], raw.reshape(-1, 2), used[rows])
    return Rig(
        tuple(
            _camera(cameras[member], solution.lens[lens[k]], log_focal[k]) for k, member in enumerate(members)
        ),
        solution.R,
        solution.t,
        solution.rays[whole],
        solution.inverse_ranges[whole],
        sure.inverse_ranges[whole],
        seen,
        edges,
        _stations(found),
        tuple(int(k) for k in lens),
        log_focal,
        np.hypot(sure.places, guessed),
        guesses,
        noise,
        best.averaged.loop_degrees,
    )


def _apart(guesses: Sequence[FocalGuess]) -> float:
    """Root mean square of the log of the focal lengths that explain the pictures almost alike, by the best one's."""
    return float(np.sqrt(np.mean([np.log(guess.focal / guesses[0].focal) ** 2 for guess in guesses])))


def _camera(camera: Camera, lens: Array, log_focal: float) -> Camera:
    """As estimated, log_focal: the deviation of that; and where its focal length comes from, in words."""
    source = camera.source
    if camera.assumed:
        told = log_focal <= FOCAL.undetermined
        source = f"{'the matches, from' if told else 'not determined by the matches,'} {source}"
    return replace(with_lens(camera, lens), source=source)


def _stations(found: Polished) -> tuple[tuple[int, ...], ...]:
    place = found.problem.place
    groups = [tuple(int(k) for k in np.flatnonzero(place == number)) for number in np.unique(place)]
    return tuple(group for group in groups if len(group) > 1)


def _edges(
    best: Solved, found: Polished, pairs: Sequence[PairGeometry], lengths: Sequence[str]
) -> tuple[RigEdge, ...]:
    R = found.solution.R
    place = {member: k for k, member in enumerate(best.averaged.members)}
    told = []
    for pair, baseline in zip(pairs, lengths, strict=True):
        i, j = place[pair.i], place[pair.j]
        off = float(degrees_between(pair.R, R[j] @ R[i].T))
        told.append(RigEdge(i, j, pair.found, len(pair.index), pair.noise_px, pair.parallax_px, off, baseline))
    return tuple(told)


def _guesses(found: Sequence[Solved]) -> tuple[FocalGuess, ...]:
    """Hypotheses that cost little more than the best, each lens once."""
    guesses: list[FocalGuess] = []
    for solved in found:
        solution = solved.found.solution
        lens = lens_of(solved.found.problem, solution, np.zeros(1, np.intp))
        guess = FocalGuess(float(lens.focal[0]), float(lens.k1[0]), solved.cost)
        near = any(abs(np.log(guess.focal / other.focal)) < JUDGE.same_log_focal for other in guesses)
        if solved.cost <= found[0].cost * (1 + JUDGE.possible) and not near:
            guesses.append(guess)
    return tuple(guesses)


def _left_out(
    names: Sequence[str], members: Sequence[int], verified: Verified, bodies: Bodies
) -> dict[int, str]:
    """Why each other picture is not in the rig; of the views of a sphere it is said once, of the first."""
    count, pairs = len(names), [(pair.i, pair.j) for pair in verified.pairs]
    groups = {k: group for group in components(count, pairs, bodies.of.tolist()) for k in group}
    told = {}
    for k in sorted(set(bodies.of.tolist()) - set(members)):
        best = int(verified.best[bodies.members(k)].max())
        others = sorted({int(bodies.of[other]) for other in groups[k]} - {k})
        if not others:
            told[k] = (
                f"connects to no other picture: at best {best} matches agree on how the camera moved, "
                f"{PAIRS.min_inliers} are needed; take a picture in between, or leave it out if it shows another place"
            )
        elif set(others).isdisjoint(members):
            told[k] = (
                f"connects only with {_listed([names[other] for other in others])}, and that group with none of the "
                f"others (at best {best} matches agree): take a picture in between"
            )
        else:
            told[k] = f"its pairs contradict the others' ({best} matches agree in the best of them)"
    return told


def _nothing_connects(verified: Verified) -> str:
    best = int(verified.best.max(initial=0))
    return (
        f"no two pictures connect: at best {best} matches of a pair agree on how the camera moved, and "
        f"{PAIRS.min_inliers} are needed. Use pictures that overlap by a third or more."
    )


def _listed(names: Sequence[str]) -> str:
    """Names in words."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
