"""Where pictures were taken, from directions alone: linear equations in all places at once, without any start.

With rotations known, a ray of picture o points to w in the world. The depth of a point along the ray of one view l is
linear in the places of l and of another view r: z = g · (c_r − c_l) with g = w_r × (w_l × w_r) / |w_l × w_r|². The two
views of most parallax are taken, and each view o then gives [w_o]ₓ (c_l + z w_l − c_o) = 0. The places that satisfy
these best, with a positive sum of depths, put most points before their cameras. Rounds of reweighting follow, then
steps of Gauss-Newton on angles. The order of the pictures has no part in it. References: Jiang, Cui and Tan, ICCV 2013;
Pan et al., ECCV 2024.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...cameras.projective import skew
from ...raster.arrays import Array
from .bundle_options import POSITIONS
from .continuity import Blocks, Neighbours, equal_logs, log_sizes, neighbours_of
from .parts import part_of_points
from .solution import Problem, Solution, bearings, lens_of
from .tracks import Index, pairs_within


@dataclass(frozen=True, eq=False)
class Positions:
    """centres (N, 3), mean 0 and largest distance 1; behind: share of points of measured depth behind their cameras."""

    centres: Array
    behind: float


@dataclass(frozen=True)
class SamePlace:
    """Pictures i and j, numbered as in the rig, that a pure rotation explains by so many matches."""

    i: int
    j: int
    matches: int


@dataclass(frozen=True, eq=False)
class _Depths:
    """Of each point: the observations l and r (P,) that its depth z = g · (c_r − c_l) is taken from, g (P, 3), the sine
    of their angle (P,), that angle in standard deviations (P,), and whether it is measured (P,)."""

    left: Index
    right: Index
    g: Array
    sine: Array
    sigmas: Array
    measured: NDArray[np.bool_]


def place_pictures(problem: Problem, solution: Solution, same: Sequence[SamePlace] = ()) -> Positions:
    """Places of all pictures by their rotations; those of one `problem.place` get one place."""
    return _Positioning(problem, solution, same).run()


class _Positioning:
    def __init__(self, problem: Problem, solution: Solution, same: Sequence[SamePlace]) -> None:
        tracks = problem.tracks
        self.tracks, self.count, self.same = tracks, problem.pictures, same
        self.w: Array = np.einsum("oji,oj->oi", solution.R[tracks.picture], bearings(problem, solution))
        self.focal = lens_of(problem, solution, tracks.picture).focal
        self.sigma = problem.noise_px
        self.weight = np.ones(len(tracks.point))
        self.inside = pairs_within(tracks.point)
        self.part = part_of_points(tracks, problem.place)
        self.centres: Array | None = None
        self.place = problem.place
        _, number = np.unique(problem.place, return_inverse=True)
        self.at = (number[:, None] == np.arange(number.max() + 1)).astype(float)
        self.spread = np.kron(self.at, np.eye(3))

    def run(self) -> Positions:
        for round_ in range(POSITIONS.rounds):
            if round_ == 0 or round_ in POSITIONS.choosing_rounds:
                depths = self.chosen_depths()
                near = neighbours_of(self.tracks, self.part, depths.measured, self.place, self.w)
                of_depth = self.depth_blocks(depths)
            before = self.centres
            if before is not None and round_ == POSITIONS.newton_round:
                self.centres = before = self.normalised(self.continued(depths, near, before), depths)
            if before is None:
                self.centres = self.normalised(self.first(depths, of_depth), depths)
                continue
            self.centres = self.normalised(self.next(depths, near, of_depth, round_), depths)
            change = np.linalg.norm(self.centres - before)
            if round_ > POSITIONS.least_rounds and change < POSITIONS.tolerance:
                break
        assert self.centres is not None
        z = self.depths_along(depths, self.centres)[depths.measured]
        return Positions(self.centres, float((z < 0).mean()) if len(z) else 0.0)

    def chosen_depths(self) -> _Depths:
        """Each point's two views of most parallax, from two places and among those that fit if there are two."""
        first, second = self.inside
        apart = self.place[self.tracks.picture[first]] != self.place[self.tracks.picture[second]]
        cosine = (self.w[first] * self.w[second]).sum(axis=1)
        doubted = np.minimum(self.weight[first], self.weight[second]) <= POSITIONS.least_weight
        order = np.lexsort((cosine + 4.0 * doubted + 8.0 * ~apart, self.tracks.point[first]))
        _, begins = np.unique(self.tracks.point[first[order]], return_index=True)
        left, right = first[order[begins]], second[order[begins]]
        normal = np.cross(self.w[left], self.w[right])
        sine = np.linalg.norm(normal, axis=1)
        g = np.cross(self.w[right], normal) / np.maximum(sine, 1e-9)[:, None] ** 2
        sigmas = sine * self.focal[left] / (np.sqrt(2) * self.sigma)
        measured = (sigmas > POSITIONS.measured_sigmas) & apart[order[begins]]
        return _Depths(left, right, g, sine, sigmas, measured)

    def depths_along(self, depths: _Depths, centres: Array) -> Array:
        """z (P,) along the left views."""
        picture = self.tracks.picture
        z: Array = (depths.g * (centres[picture[depths.right]] - centres[picture[depths.left]])).sum(axis=1)
        return z

    def depth_blocks(self, depths: _Depths) -> Blocks:
        """How the depth of every observation along its own ray depends on the places: left, right, own."""
        point, picture = self.tracks.point, self.tracks.picture
        along = (self.w * self.w[depths.left[point]]).sum(axis=1)
        by_right = along[:, None] * depths.g[point]
        blocks = ((depths.left, self.w - by_right), (depths.right, by_right))
        found = [(picture[view[point]], rows[:, None, :]) for view, rows in blocks]
        return [*found, (picture, -self.w[:, None, :])]

    def first(self, depths: _Depths, of_depth: Blocks) -> Array:
        """Places (N, 3) from nothing, up to a shift: distances are taken to be what they are for a usual parallax."""
        rows = np.flatnonzero(depths.measured[self.tracks.point])
        sine = depths.sine[self.tracks.point]
        usual = float(np.median(sine[rows])) if len(rows) else 1.0
        system = _System(self.count)
        self.add_rays(system, depths, rows, sine / usual, None, None)
        self.add_same(system, 1.0)
        return self.smallest(system, self.towards(depths, of_depth, rows, sine))

    def next(self, depths: _Depths, near: Neighbours, of_depth: Blocks, round_: int) -> Array:
        """Better places (N, 3), up to a shift and a sign."""
        assert self.centres is not None
        rows = np.flatnonzero(depths.measured[self.tracks.point])
        away, distance, depth = self.away(depths, self.centres)
        off = np.cross(self.w, away)
        self.reweight(depths, off / distance[:, None], away, round_)
        newton = round_ >= POSITIONS.newton_round
        system = _System(self.count)
        self.add_rays(system, depths, rows, 1 / distance, off, away / distance[:, None] if newton else None)
        self.add_same(system, float(np.median(1 / distance[rows])) if len(rows) else 1.0)
        towards = self.towards(depths, of_depth, rows, 1 / np.abs(depth))
        if not newton:
            return self.smallest(system, towards)
        system.add(*equal_logs(near, depth, of_depth))
        return self.stepped(system, towards, depths)

    def add_rays(
        self, system: _System, depths: _Depths, rows: Index, scale: Array, off: Array | None, seen: Array | None
    ) -> None:
        """That points lie on the rays that see them; scale (O,): 1 / distance; off (O, 3): present residuals; seen:
        see `ray_blocks`."""
        used = rows[rows != depths.left[self.tracks.point[rows]]]
        weight = (scale * self.focal / self.sigma) ** 2 * self.weight
        blocks = [(picture[used], J[used]) for picture, J in self.ray_blocks(depths, seen)]
        system.add(blocks, weight[used], None if off is None else off[used])

    def ray_blocks(self, depths: _Depths, seen: Array | None) -> Blocks:
        """How [w_o]ₓ (c_l + z w_l − c_o) depends on the places; seen (O, 3): unit vectors along which a change is none
        of the angle."""
        point, picture = self.tracks.point, self.tracks.picture
        cross = skew(self.w)
        if seen is not None:
            cross = cross - np.matmul(cross, seen[:, :, None]) * seen[:, None, :]
        along = np.matmul(cross, self.w[depths.left[point]][:, :, None]) * depths.g[point][:, None, :]
        return [
            (picture[depths.left[point]], cross - along), (picture[depths.right[point]], along), (picture, -cross)
        ]  # fmt: skip

    def away(self, depths: _Depths, centres: Array) -> tuple[Array, Array, Array]:
        """Of every observation: the point from its place (O, 3), its distance and its depth along the ray, both no less
        than a share of the usual."""
        point, picture = self.tracks.point, self.tracks.picture
        z = self.depths_along(depths, centres)
        X = centres[picture[depths.left]] + z[:, None] * self.w[depths.left]
        away = X[point] - centres[picture]
        least = np.maximum(POSITIONS.least_distance * self.usual_depths(depths, z), 1e-12)[point]
        depth = (away * self.w).sum(axis=1)
        depth = np.where(np.abs(depth) < least, np.where(depth < 0, -least, least), depth)
        return away, np.maximum(np.linalg.norm(away, axis=1), least), depth

    def usual_depths(self, depths: _Depths, z: Array) -> Array:
        """For each point (P,) the median |z| of those of its part whose depth is measured, 1 where there are none."""
        usual = np.ones(len(z))
        for part in np.unique(self.part):
            mine = self.part == part
            if (mine & depths.measured).any():
                usual[mine] = np.median(np.abs(z[mine & depths.measured]))
        return usual

    def continued(self, depths: _Depths, near: Neighbours, centres: Array) -> Array:
        """Places (N, 3) with each part of the rig as large as makes depths go on from one to the next: the linear
        rounds leave that anywhere. What loops of parts tell of it is left to the steps that follow."""
        picture, (parts, part) = self.tracks.picture, np.unique(self.part, return_inverse=True)
        if len(parts) == 1:
            return centres
        _, _, depth = self.away(depths, centres)
        sizes = np.exp(log_sizes(near, self.place[picture], part[self.tracks.point], depth))
        i, j = (picture[ends] for ends in self.inside)
        i, j, k = np.unique([i, j, part[self.tracks.point[self.inside[0]]]], axis=1)
        apart = sizes[k][:, None] * (centres[i] - centres[j])
        lengths = np.sqrt(np.bincount(k, (apart**2).sum(axis=1)) / np.bincount(k))
        length = np.maximum(lengths, max(POSITIONS.least_distance * lengths.max(), 1e-12))[k][:, None]
        places: Array = self.at @ np.linalg.lstsq((self.at[i] - self.at[j]) / length, apart / length, rcond=None)[0]
        return places

    def reweight(self, depths: _Depths, off: Array, away: Array, round_: int) -> None:
        """Cauchy weights by sines off (O, 3), the kernel narrower with each round; what lies behind fits badly."""
        error = self.focal * np.linalg.norm(off, axis=1)
        behind = (away * self.w).sum(axis=1) < 0
        error = np.where(behind, np.maximum(error, POSITIONS.behind_sigmas * self.sigma), error)
        sigmas = max(POSITIONS.last_kernel_sigmas, POSITIONS.first_kernel_sigmas * POSITIONS.kernel_decay**round_)
        self.weight = 1 / (1 + (error / (sigmas * self.sigma)) ** 2)
        self.weight[depths.left[depths.measured]] = 1  # on its own ray by construction
        self.weight[~depths.measured[self.tracks.point]] = 1

    def towards(self, depths: _Depths, of_depth: Blocks, rows: Index, scale: Array) -> Array:
        """The mean of weighted depths as a row (3 N,): what keeps the scale, and points before their cameras."""
        sure = np.minimum(depths.sigmas[self.tracks.point[rows]] / POSITIONS.sure_sigmas, 1)
        weight = scale[rows] * sure * self.weight[rows]
        row = np.zeros((self.count, 3))
        for picture, blocks in of_depth:
            for axis in range(3):
                values = weight * blocks[rows, 0, axis]
                row[:, axis] += np.bincount(picture[rows], values, minlength=self.count)
        return row.ravel() / max(len(rows), 1)

    def add_same(self, system: _System, scale: float) -> None:
        """Pairs that a rotation explains pull their places together, by the parallax that usual points would show."""
        for pair in self.same:
            focal = float(np.median(self.focal[self.tracks.picture == pair.i]))
            matches = min(pair.matches, POSITIONS.station_matches)
            weight = POSITIONS.station_share * matches * (focal * scale / self.sigma) ** 2
            off = np.zeros((1, 3))
            if self.centres is not None:
                off[0] = self.centres[pair.i] - self.centres[pair.j]
                apart = focal * scale * float(np.linalg.norm(off)) / (POSITIONS.station_sigmas * self.sigma)
                weight /= 1 + apart**2
            i, j = np.array([pair.i]), np.array([pair.j])
            system.add([(i, np.eye(3)[None]), (j, -np.eye(3)[None])], np.array([weight]), off)

    def smallest(self, system: _System, towards: Array) -> Array:
        """min cᵀ A c subject to towards · c = 1."""
        regular, _ = system.regular()
        free = np.linalg.solve(self.spread.T @ regular @ self.spread, self.spread.T @ towards)
        found = self.spread @ free
        scale = float(towards @ found)
        return found.reshape(-1, 3) / (scale if abs(scale) > 1e-300 else 1.0)

    def stepped(self, system: _System, towards: Array, depths: _Depths) -> Array:
        """A step of Gauss-Newton that keeps the mean depth and does not change many depths by much."""
        assert self.centres is not None
        regular, size = system.regular()
        held = np.outer(towards, towards) / max(float(towards @ towards), 1e-300)
        left = self.spread.T @ (regular + POSITIONS.scale_stiffness * size * held) @ self.spread
        free: Array = np.linalg.solve(left, self.spread.T @ system.gradient)
        step: Array = -np.reshape(self.spread @ free, (-1, 3))
        z = self.depths_along(depths, self.centres)[depths.measured]
        change = np.abs(self.depths_along(depths, step)[depths.measured]) / np.maximum(np.abs(z), 1e-9)
        typical = float(np.percentile(change, POSITIONS.change_percentile)) if len(change) else 0.0
        return self.centres + step * min(POSITIONS.most_step, POSITIONS.most_change / max(typical, 1e-9))

    def normalised(self, centres: Array, depths: _Depths) -> Array:
        """About their mean, the largest distance 1, most points before their cameras."""
        z = self.depths_along(depths, centres)[depths.measured]
        if len(z) and (z < 0).mean() > 0.5:
            centres = -centres
        centres = centres - centres.mean(axis=0)
        return centres / max(float(np.linalg.norm(centres, axis=1).max()), 1e-300)


class _System:
    """Normal equations of places: matrix (3 N, 3 N) and gradient (3 N,)."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.matrix = np.zeros((3 * count, 3 * count))
        self.gradient = np.zeros(3 * count)

    def add(self, blocks: Blocks, weight: Array, off: Array | None = None) -> None:
        """Rows Σ J c with weights (M,) and, where they are not to be 0 at c = 0, their present values off (M, k)."""
        for p, J in blocks:
            weighted = np.swapaxes(J * weight[:, None, None], 1, 2)
            for q, J_q in blocks:
                self.matrix += self._summed(p * self.count + q, np.matmul(weighted, J_q))
            if off is not None:
                for axis, values in enumerate(np.matmul(weighted, off[:, :, None])[:, :, 0].T):
                    self.gradient[axis::3] += np.bincount(p, values, minlength=self.count)

    def _summed(self, key: Index, values: Array) -> Array:
        """Blocks (M, 3, 3) summed where they belong, by first picture × N + second."""
        total = np.empty((self.count * self.count, 3, 3))
        for a in range(3):
            for b in range(3):
                total[:, a, b] = np.bincount(key, values[:, a, b], minlength=len(total))
        blocks = total.reshape(self.count, self.count, 3, 3)
        summed: Array = blocks.transpose(0, 2, 1, 3).reshape(3 * self.count, 3 * self.count)
        return summed

    def regular(self) -> tuple[Array, float]:
        """The matrix with the mean place held and a little on its diagonal; the mean of its diagonal."""
        size = float(np.trace(self.matrix)) / len(self.matrix)
        size = size if size > 0 else 1.0
        shift = np.tile(np.eye(3), (self.count, 1))
        held = shift @ shift.T / self.count
        return self.matrix + size * (held + POSITIONS.regular * np.eye(len(self.matrix))), size
