"""The focal length that straight edges of both pictures ask for, where matches alone may be led astray.

On buildings upright edges meet in one vanishing point and level ones in two more, at right angles, and both pictures
show the same three directions. That holds at one focal length only, since the rotation between the pictures, which the
matches tell, goes with it: Caprile and Torre, Using vanishing points for camera calibration, IJCV 1990.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera, Knowledge, zoomed
from ..cameras.matches import Matches
from ..cameras.projective import down_at
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from .options import EDGE_FOCAL, REFINEMENT
from .refinement import Pose, pose_at_focal


@dataclass(frozen=True, eq=False)
class Edges:
    """Straight edges of a picture, longest first: ends (N, 2, 2) ideal px, lengths (N,), shares of the longer side."""

    ends: Array
    lengths: Array


@dataclass(frozen=True)
class _Candidate:
    """A pose with a focal length held, what it costs the matches, both pictures' edges with it, the angles (3,) of the
    best frame (see `_frame`), and what the edges say for that."""

    pose: Pose
    cost: float
    pictures: tuple[_Directions, _Directions]
    angles: Array
    evidence: float

    def with_frame_of(self, other: _Candidate) -> _Candidate:
        """With the frame that another one leads to, where that is better."""
        angles, evidence = _followed(self.pictures, other.angles)
        return replace(self, angles=angles, evidence=evidence) if evidence > self.evidence else self

    def score(self, camera: Camera) -> float:
        """Higher is better: edges, matches, and what is usual."""
        z = np.log(self.pose.K[0, 0] / camera.focal) / camera.log_sigma
        freedom = REFINEMENT.prior_freedom
        usual = (freedom + 1) * np.log1p(z * z / freedom)
        return float(EDGE_FOCAL.edge_weight * self.evidence - EDGE_FOCAL.match_weight * self.cost - usual)


def focal_by_edges(
    matches: Matches, two_view: TwoView, cameras: tuple[Camera, Camera], edges: tuple[Edges, Edges]
) -> tuple[Camera, Camera] | None:
    """Find the focal length of a pair of which nothing was known, by its edges beside its matches.

    Parameters
    ----------
    matches : Matches
        Those that the geometry explains, ideal px.
    two_view : TwoView
        The geometry by matches alone, of the general model.
    cameras : (Camera, Camera)
        As they were assumed.
    edges : (Edges, Edges)
        Of both pictures.

    Returns
    -------
    (Camera, Camera) or None
        Both with the focal length found; None unless the edges speak clearly for another one than the matches found.
    """
    few = matches.thinned(EDGE_FOCAL.matches)
    start = Pose(two_view.K, two_view.K_prime, two_view.R, two_view.t)

    def candidate(factor: float) -> _Candidate:
        pose, cost = pose_at_focal(few, start, cameras, factor, two_view.sigma)
        pictures = _Directions.of(edges[0], pose.K), _Directions.of(edges[1], pose.K_prime @ pose.R)
        return _Candidate(pose, cost, pictures, *_best_frame(pictures))

    side = max(cameras[0].size)
    shortest, longest = np.log(EDGE_FOCAL.sides)
    focals = side * np.exp(np.arange(shortest, longest, EDGE_FOCAL.log_step))
    found = {number: candidate(float(focals[number] / start.K[0, 0])) for number in range(0, len(focals), 2)}
    _share_frames(found)
    # every other one tells where the best is, and its neighbours which it is
    best = max(found, key=lambda number: found[number].score(cameras[0]))
    around = [number for number in (best - 1, best + 1) if 0 <= number < len(focals)]
    found |= {number: candidate(float(focals[number] / start.K[0, 0])) for number in around}
    _share_frames(found)
    nearest = found[min(found, key=lambda number: abs(np.log(focals[number] / start.K[0, 0])))]
    by_matches = candidate(1.0).with_frame_of(nearest)
    scores = {number: one.score(cameras[0]) for number, one in found.items()}
    best = max(scores, key=lambda number: scores[number])
    # matches and what is usual may speak for it, too, but edges alone have to suffice
    by_edges = EDGE_FOCAL.edge_weight * (found[best].evidence - by_matches.evidence)
    gain = min(by_edges, scores[best] - by_matches.score(cameras[0]))
    if gain < EDGE_FOCAL.min_gain or best in (0, len(focals) - 1):
        return None
    peak = _peak(scores[best - 1], scores[best], scores[best + 1])
    factor = float(focals[best] * np.exp(EDGE_FOCAL.log_step * peak) / start.K[0, 0])
    first, second = (
        replace(camera, K=zoomed(K, factor), source=EDGE_FOCAL.source, log_sigma=EDGE_FOCAL.log_sigma,
                knowledge=Knowledge.EDGES)
        for camera, K in zip(cameras, (start.K, start.K_prime), strict=True)
    )  # fmt: skip
    return first, second


def _share_frames(found: dict[int, _Candidate]) -> None:
    """Give each candidate the frame of the next shorter or longer focal length where that is better: a search may miss
    the best one."""
    numbers = sorted(found)
    for order in (numbers, numbers[::-1]):
        for before, number in pairwise(order):
            found[number] = found[number].with_frame_of(found[before])


def _peak(before: float, at: float, after: float) -> float:
    """Where, in steps from the middle one, the parabola through three values is highest; the middle one is."""
    bend = before - 2 * at + after
    return 0.0 if bend >= 0 else float(0.5 * (before - after) / bend)


@dataclass(frozen=True)
class _Directions:
    """How near edges of a picture run to vanishing points of directions in the reference's frame.

    P (3, 3): a direction's vanishing point, px; lines (N, 3): of the edges, with unit normals; middles (N, 4): 1, x, y,
    x² + y² of their middles; lengths (N,).
    """

    P: Array
    lines: Array
    middles: Array
    lengths: Array

    @staticmethod
    def of(edges: Edges, P: Array) -> _Directions:
        middle, along = edges.ends.mean(axis=1), edges.ends[:, 1] - edges.ends[:, 0]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        normal = np.column_stack([along[:, 1], -along[:, 0]])
        lines = np.column_stack([normal, -(normal * middle).sum(axis=1)])
        middles = np.column_stack([np.ones(len(middle)), middle, np.square(middle).sum(axis=1)])
        return _Directions(P, lines, middles, edges.lengths)

    def longest(self, count: int) -> _Directions:
        """Of the longest edges only."""
        return replace(self, lines=self.lines[:count], middles=self.middles[:count], lengths=self.lengths[:count])

    def agreeing(self, directions: Array) -> NDArray[np.float32]:
        """exp(−½ (angle / σ)²) (…, N) of the angle in the picture between each edge and the way from its middle to the
        vanishing point of each direction (…, 3)."""
        points = directions.reshape(-1, 3) @ self.P.T
        u, v, w = points.T
        squared = np.array([u * u + v * v, -2 * u * w, -2 * v * w, w * w]).T @ self.middles.T
        sine = points @ self.lines.T
        sine *= sine
        sine /= np.maximum(squared, 1e-12, out=squared)
        # float32 from where nothing cancels any more: several times as fast, and the sums are right to six digits
        out: NDArray[np.float32] = sine.astype(np.float32)
        out *= np.float32(-0.5 / np.radians(EDGE_FOCAL.edge_sigma_deg) ** 2)
        return np.exp(out, out=out).reshape(*directions.shape[:-1], -1)


def _best_frame(pictures: tuple[_Directions, _Directions]) -> tuple[Array, float]:
    """The angles (3,) of the best three directions at right angles, one of them upright (see `_frame`), and what the
    edges say for them."""
    pitch, roll = (
        angle.ravel() for angle in np.radians(np.meshgrid(
            *(np.arange(-reach, reach + step / 2, step) for reach, step in EDGE_FOCAL.upright_grid_deg)
        ))
    )  # fmt: skip
    longest = [picture.longest(EDGE_FOCAL.first_edges) for picture in pictures]
    found = _total(longest, down_at(pitch, roll)[None])
    best, value = np.zeros(3), -1.0
    for start in _apart(down_at(pitch, roll), found):
        yaw = np.radians(np.arange(0.0, 90.0, EDGE_FOCAL.yaw_step_deg))
        angles = np.column_stack([np.full(len(yaw), pitch[start]), np.full(len(yaw), roll[start]), yaw])
        there, there_value = _followed(pictures, angles[np.argmax(_total(longest, _frame(angles)))])
        if there_value > value:
            best, value = there, there_value
    return best, value


def _followed(pictures: Sequence[_Directions], angles: Array) -> tuple[Array, float]:
    """The best frame near the one of angles (3,), and what the edges say for it."""
    value, step = float(_total(pictures, _frame(angles[None]))[0]), np.radians(EDGE_FOCAL.yaw_step_deg) / 2
    for _ in range(EDGE_FOCAL.steps):
        around = angles + step * _AROUND
        values = _total(pictures, _frame(around))
        if values.max() > value:
            angles, value = around[np.argmax(values)], float(values.max())
        else:
            step /= 2
    return angles, value


_AROUND = np.vstack([np.eye(3), -np.eye(3)])


def _apart(down: Array, values: Array) -> list[int]:
    """The best few directions (M, 3), by their values (M,), that lie apart from each other."""
    out: list[int] = []
    for number in np.argsort(-values, kind="stable"):
        if all(down[number] @ down[other] < np.cos(np.radians(EDGE_FOCAL.apart_deg)) for other in out):
            out.append(int(number))
        if len(out) == EDGE_FOCAL.starts:
            break
    return out


def _total(pictures: Sequence[_Directions], directions: Array) -> Array:
    """Evidence (M,) of the edges of all pictures for frames of some directions each (k, M, 3): the logarithm of how
    much likelier each edge is if some edges run in these directions than if all run anywhere, weighted by length."""
    density = EDGE_FOCAL.aligned_share / 3 * np.sqrt(np.pi / 2) / np.radians(EDGE_FOCAL.edge_sigma_deg)
    total = np.zeros(directions.shape[1])
    for picture in pictures:
        agreeing = picture.agreeing(directions).sum(axis=0)
        agreeing *= np.float32(density)
        total += np.log1p(agreeing, out=agreeing) @ picture.lengths
    return total


def _frame(angles: Array) -> Array:
    """The directions (3, M, 3) of frames with angles (M, 3), pitch, roll and yaw in radians: down and two level ones.
    """
    x, y, z = down_at(angles[:, 0], angles[:, 1]).T
    sine, cosine = np.sin(angles[:, 2]), np.cos(angles[:, 2])
    wide = np.hypot(x, y)
    level = y / wide, -x / wide, np.zeros_like(z)
    other = x * z / wide, y * z / wide, -wide
    first = [cosine * a + sine * b for a, b in zip(level, other, strict=True)]
    second = [cosine * b - sine * a for a, b in zip(level, other, strict=True)]
    return np.array([[x, y, z], first, second]).transpose(0, 2, 1)
