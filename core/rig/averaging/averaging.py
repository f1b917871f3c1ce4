"""From verified matches of all pairs to rotations of all pictures that connect, and the lens they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...cameras.bodies import Bodies, bodies_of
from ...cameras.camera import Camera
from ...cameras.rig import PictureMatches
from ...raster.arrays import Array
from ...system.progress import Tick, unwatched
from .averaged import Averaged, PairGeometry, Verified
from .candidates import Candidates, at_other_lens, belonging, candidates, noise_of
from .focal_starts import log_sigma, starts
from .graph import components, heaviest_component
from .matched_rays import MatchedRays, SharedLens, matched_rays
from .options import AVERAGING, PAIR_FIT
from .pair_models import EpipolarModel, Poses
from .pair_refinement import LensPrior, Together, refine_each, refine_together
from .pure_rotations import PairRotations, as_rotations, each_as_rotation
from .rotation_averaging import NEVER, Links, Rotations, average, worst_loop
from .turns import degrees_between, rotations


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Candidates of the pairs, the best of them refined together, and what all that says of the log of the focal length
    (1 / variance)."""

    found: Candidates
    together: Together
    focal_information: float


def hypotheses(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, tick: Tick = unwatched
) -> list[Averaged]:
    """Average from every start that is worth it (`focal_starts.starts`).

    Parameters
    ----------
    cameras, points, verified, tick
        As for `averaged`.

    Returns
    -------
    list of Averaged
        The cheapest first. Of those that end at the same lens and rotations only one.
    """
    begun = starts(cameras, points, verified, tick)
    found = [averaged(cameras, points, verified, start, tick=tick) for start in begun]
    distinct: list[Averaged] = []
    for each in sorted((each for each in found if each is not None), key=lambda each: each.cost):
        if not any(_alike(each, other) for other in distinct):
            distinct.append(each)
    return distinct


def _alike(first: Averaged, second: Averaged) -> bool:
    """Whether a bundle would lead both to the same end."""
    if first.members != second.members:
        return False
    zoom = [np.log(a.focal / b.focal) for a, b in zip(first.cameras, second.cameras, strict=True)]
    bend = [a.distortion[0] - b.distortion[0] for a, b in zip(first.cameras, second.cameras, strict=True)]
    R = [each.R[list(first.members)] @ each.R[first.members[0]].T for each in (first, second)]
    return bool(
        np.abs(zoom).max() < AVERAGING.alike_log_focal
        and np.abs(bend).max() < AVERAGING.alike_k1
        and degrees_between(*R).max() < AVERAGING.alike_degrees
    )


def averaged(
    cameras: Sequence[Camera], points: Sequence[Array], verified: Verified, start: SharedLens, hold: bool = False,
    tick: Tick = unwatched,
) -> Averaged | None:  # fmt: skip
    """Find the rotations of all pictures that connect, and one factor on their focal lengths and one k1.

    Parameters
    ----------
    cameras : sequence of Camera
        As known before. Ratios between their focal lengths are kept; given ones stay as they are.
    points : sequence of (M_i, 2)
        The features of every picture, raw px.
    verified : Verified
        Their matches.
    start : SharedLens
        Where to start (`focal_starts.starts`).
    hold : bool
        Whether the start's focal length and k1 stay: those of a bundle, which knows better than pairs do.
    tick : callable
        Called between steps.

    Returns
    -------
    Averaged or None
        None if no pair has a pose.
    """
    if not verified.pairs:
        return None
    matched, ends = matched_rays(cameras, points, verified)
    prior = LensPrior(log_sigma(cameras) or 1.0, (False, False) if hold else matched.anything_free)
    fitted = _fitted(matched, matched.within_limits(start), prior, verified, tick)
    if fitted is None:
        return None
    return _averaged(cameras, verified, matched, ends, fitted, tick)


def _fitted(
    matched: MatchedRays, start: SharedLens, prior: LensPrior, verified: Verified, tick: Tick
) -> _Fitted | None:
    """Candidates and lens; sought a second time where the lens changed much, or where it comes from rotations."""
    found = candidates(matched, start, verified.scale, verified.seed, tick)
    if not len(found.numbers):
        return None
    tick()
    together = _together(found, start, prior, verified.scale)
    if not any(prior.free):
        return _Fitted(found, together, AVERAGING.held_information)
    tick()
    turning = as_rotations(found, together, prior, start, verified.scale)
    rotate = turning.share > PAIR_FIT.rotation_share
    lens = turning.lens if rotate else together.lens
    evidence = PAIR_FIT.rotation_log_focal**-2 if rotate else AVERAGING.focal_evidence * together.focal_information
    if not rotate and _near(lens, start):
        return _Fitted(found, together, evidence)
    # anew, not followed from here: weak pairs find other minima at another lens
    again = candidates(matched, lens, verified.scale, verified.seed, tick)
    if not len(again.numbers):
        return _Fitted(found, together, evidence)
    if rotate:
        prior = LensPrior(prior.log_sigma, (False, False))
    together = _together(again, lens, prior, verified.scale)
    return _Fitted(again, together, evidence if rotate else AVERAGING.focal_evidence * together.focal_information)


def _near(lens: SharedLens, other: SharedLens) -> bool:
    same_focal = abs(np.log(lens.factor / other.factor)) < PAIR_FIT.repeat_log_focal
    return bool(same_focal and abs(lens.k1 - other.k1) < PAIR_FIT.repeat_k1)


def _together(found: Candidates, lens: SharedLens, prior: LensPrior, scale: float) -> Together:
    model = EpipolarModel(found.rays, PAIR_FIT.cauchy_px * scale)
    return refine_together(model, found.first, lens, prior, found.noise, PAIR_FIT.iterations)


def _averaged(
    cameras: Sequence[Camera], verified: Verified, matched: MatchedRays, ends: NDArray[np.intp], fitted: _Fitted,
    tick: Tick,
) -> Averaged:  # fmt: skip
    """Average, and again with the new lens as long as closing loops moves the focal length: rotations of pairs follow
    it linearly over some per cent only."""
    by_pairs, bodies = fitted.together.lens, bodies_of(cameras)
    for _ in range(AVERAGING.lens_rounds):
        tick()
        found, together = fitted.found, fitted.together
        pairs = [(int(i), int(j)) for i, j in ends[found.numbers]]
        members = heaviest_component(len(cameras), pairs, found.rays.counts.tolist(), bodies.of.tolist())
        kept = np.flatnonzero(np.isin(ends[found.numbers], members).all(axis=1))
        links = _with_bodies(_links(found, together, [pairs[k] for k in kept], members, kept), bodies, members)
        before = float(np.log(by_pairs.factor / together.lens.factor))
        turned = average(links, fitted.focal_information, before)
        lens = SharedLens(
            together.lens.factor * float(np.exp(turned.log_focal)),
            together.lens.k1 + together.k1_by_focal * turned.log_focal,
        )
        lens = matched.within_limits(lens)
        if abs(turned.log_focal) < AVERAGING.same_log_focal:
            break
        fitted = _at_lens(matched, lens, fitted, verified.scale)
    rigid = bodies_of([cameras[member] for member in members]).made_rigid(turned.R)
    turned = replace(turned, R=rigid)
    chosen = _chosen(matched, found, kept, links, turned, lens, verified.scale)
    return _summary(cameras, verified, matched, members, links, turned, lens, chosen)


def _at_lens(matched: MatchedRays, lens: SharedLens, fitted: _Fitted, scale: float) -> _Fitted:
    """The same with the focal length that closes loops; k1 follows it."""
    found = at_other_lens(fitted.found, lens, scale)
    prior = LensPrior(1.0, (False, matched.anything_free[1]))
    return _Fitted(found, _together(found, lens, prior, scale), fitted.focal_information)


def _links(
    found: Candidates, together: Together, pairs: Sequence[tuple[int, int]], members: Sequence[int],
    kept: NDArray[np.intp],
) -> Links:  # fmt: skip
    """What is averaged: the best candidate is the one that was refined together with the lens."""
    most = max(len(found.costs[k]) for k in kept)
    R = np.tile(together.poses.R[kept][:, None], (1, most, 1, 1))
    costs = np.full((len(kept), most), NEVER)
    costs[:, 0] = 0
    for row, k in enumerate(kept):
        others = len(found.costs[k]) - 1
        R[row, 1 : 1 + others] = found.poses[k].R[1:]
        costs[row, 1 : 1 + others] = found.costs[k][1:] - found.costs[k][0]
    place = {member: k for k, member in enumerate(members)}
    return Links(
        len(members), tuple((place[i], place[j]) for i, j in pairs), R, costs, _of_turn(together.information[kept]),
        together.by_focal[kept, :3], found.rays.counts[kept],
    )  # fmt: skip


def _with_bodies(links: Links, bodies: Bodies, members: Sequence[int]) -> Links:
    """The links, and after them those between the views of each body that is among the members."""
    place = {member: k for k, member in enumerate(members)}
    pairs = [(i, j) for i, j in bodies.pairs if i in place]
    if not pairs:
        return links
    count, most = len(pairs), links.costs.shape[1]
    R = np.array([bodies.between(i, j) for i, j in pairs])
    costs = np.full((count, most), NEVER)
    costs[:, 0] = 0
    information = np.tile(np.radians(AVERAGING.body_degrees) ** -2 * np.eye(3), (count, 1, 1))
    return Links(
        links.count, (*links.pairs, *((place[i], place[j]) for i, j in pairs)),
        np.concatenate([links.R, np.tile(R[:, None], (1, most, 1, 1))]), np.concatenate([links.costs, costs]),
        np.concatenate([links.information, information]), np.concatenate([links.by_focal, np.zeros((count, 3))]),
        np.concatenate([links.inliers, np.full(count, AVERAGING.body_matches)]), count,
    )  # fmt: skip


def _of_turn(information: Array) -> Array:
    """Information (P, 3, 3) on the turns alone from that on turns and directions of the baseline (P, 5, 5)."""
    cross, own = information[:, :3, 3:], information[:, 3:, 3:]
    own = own + 1e-9 * np.trace(information, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    left: Array = information[:, :3, :3] - cross @ np.linalg.solve(own, np.swapaxes(cross, 1, 2))
    return left


@dataclass(frozen=True, eq=False)
class _Chosen:
    """The pairs between members with the poses that the whole has chosen: numbers (P,) of verified pairs; inliers of
    each; poses; information (P, 3, 3); squares (O,) of all their verified matches; noise; turning."""

    numbers: NDArray[np.intp]
    inliers: tuple[NDArray[np.bool_], ...]
    poses: Poses
    information: Array
    squares: Array
    noise: float
    turning: PairRotations


def _chosen(
    matched: MatchedRays, found: Candidates, kept: NDArray[np.intp], links: Links, turned: Rotations, lens: SharedLens,
    scale: float,
) -> _Chosen:  # fmt: skip
    """The chosen candidates refined at the final lens, and which matches belong to them."""
    each = np.arange(len(kept))
    choices = turned.choice[each]
    R = rotations(links.by_focal[each] * turned.log_focal) @ links.R[each, choices]
    t = np.array([found.poses[k].t[choice] for k, choice in zip(kept, choices, strict=True)])
    width = PAIR_FIT.cauchy_px * scale
    numbers = found.numbers[kept]
    few = found.rays.of_pairs(kept)
    poses = refine_each(EpipolarModel(few, width), Poses(R, t), lens, AVERAGING.pose_iterations)
    whole = matched.of_pairs(numbers)
    squares = EpipolarModel(whole, width).squares(poses, lens)
    before = np.concatenate([found.inliers[matched.starts[k] : matched.starts[k + 1]] for k in numbers])
    inliers = belonging(whole, squares, before, scale)
    rays = whole.where(inliers)
    model = EpipolarModel(rays, width)
    noise = noise_of(model.residuals(poses, lens), scale)
    information = _of_turn(model.equations(poses, lens, shared=False)[0] / noise**2)
    turning = each_as_rotation(rays, found.turned[kept], lens, squares[inliers], noise)
    of_each = tuple(np.split(inliers, whole.starts[1:-1]))
    return _Chosen(numbers, of_each, poses, information, squares, noise, turning)


def _summary(
    cameras: Sequence[Camera], verified: Verified, matched: MatchedRays, members: Sequence[int], links: Links,
    turned: Rotations, lens: SharedLens, chosen: _Chosen,
) -> Averaged:  # fmt: skip
    """What is handed on: pairs that agree with the averaged rotations, from the smaller number to the larger."""
    matches = len(chosen.numbers)
    first, second = (end[:matches] for end in links.ends)
    between = turned.R[second] @ np.swapaxes(turned.R[first], 1, 2)
    off = degrees_between(chosen.poses.R, between)
    agrees = off < links.allowed_degrees[:matches]
    R = np.full((len(cameras), 3, 3), np.nan)
    R[list(members)] = turned.R
    near = degrees_between(chosen.turning.R, between) < PAIR_FIT.rotation_degrees
    counts = np.array([int(inliers.sum()) for inliers in chosen.inliers])
    enough = (counts >= PAIR_FIT.rotation_matches) & (chosen.turning.gain > PAIR_FIT.rotation_gric)
    rotates = near & enough
    pairs = tuple(
        _pair(verified, chosen, k, (members[first[k]], members[second[k]]), float(off[k]), bool(rotates[k]))
        for k in np.flatnonzero(agrees)
    )
    bodies = bodies_of(cameras).of.tolist()
    connected = components(len(cameras), [(pair.i, pair.j) for pair in pairs], bodies)[0]
    rotations_of_links = np.concatenate([chosen.poses.R, links.R[matches:, 0]])
    closing = np.concatenate([agrees, np.ones(links.exact, bool)])
    R[np.setdiff1d(np.arange(len(cameras)), connected)] = np.nan
    pairs = tuple(pair for pair in pairs if pair.i in connected)
    return Averaged(
        members=tuple(connected),
        cameras=tuple(lens.of(camera) for camera in cameras),
        R=R,
        pairs=pairs,
        noise_px=chosen.noise,
        loop_degrees=worst_loop(links, rotations_of_links, closing),
        one_place=_one_place(bodies, pairs, connected),
        cost=_cost(verified, matched, chosen, turned),
    )


def _pair(
    verified: Verified, chosen: _Chosen, k: int, ends: tuple[int, int], off: float, rotates: bool
) -> PairGeometry:
    number = int(chosen.numbers[k])
    match: PictureMatches = verified.pairs[number]
    R, t, information = chosen.poses.R[k], chosen.poses.t[k], chosen.information[k]
    if ends != (match.i, match.j):
        # a turn from the left of R is one of its inverse from the right
        R, t, information = R.T, -R.T @ t, R.T @ information @ R
    squares = np.split(chosen.squares, np.cumsum([len(mask) for mask in chosen.inliers])[:-1])[k]
    return PairGeometry(
        match.i, match.j, match.index[chosen.inliers[k]], verified.found[number], len(match), R, t, information,
        noise_of(np.sqrt(squares[chosen.inliers[k]]), verified.scale), float(chosen.turning.parallax[k]),
        float(chosen.turning.gain[k]) / int(chosen.inliers[k].sum()), rotates, off,
    )  # fmt: skip


def _one_place(bodies: Sequence[int], pairs: Sequence[PairGeometry], members: Sequence[int]) -> bool:
    """Whether pure rotations join all members and explain most matches; bodies: as for `components`."""
    rotating = [pair for pair in pairs if pair.rotates]
    share = sum(len(pair.index) for pair in rotating) / max(sum(len(pair.index) for pair in pairs), 1)
    joined = components(len(bodies), [(pair.i, pair.j) for pair in rotating], bodies)[0]
    return share > PAIR_FIT.one_place_share and len(joined) == len(members)


def _cost(verified: Verified, matched: MatchedRays, chosen: _Chosen, turned: Rotations) -> float:
    """Mean robust misfit of all verified matches, those of pairs left out at the most that any costs, and what the
    pairs' rotations disagree by; px² at the features' scale."""
    width, most = PAIR_FIT.cauchy_px * verified.scale, AVERAGING.unexplained_widths
    explained = np.log1p(np.minimum(chosen.squares / width**2, most**2)).sum()
    total = len(matched.owner)
    left_out = (total - len(chosen.squares)) * np.log1p(most**2)
    disagreement = 2 * turned.cost * chosen.noise**2 / width**2
    return float((explained + left_out + disagreement) * PAIR_FIT.cauchy_px**2 / total)
