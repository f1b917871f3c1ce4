"""What the bundle solves for, and what it is given, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..cameras.camera import Camera
from ..raster.arrays import Array
from .bundle_options import BUNDLE
from .tracks import Index, Tracks


@dataclass(frozen=True, eq=False)
class Lenses:
    """Lenses that pictures were taken with, as they were believed before matching.

    of (N,): the lens of each picture; aspect (L,): fy / fx; log_focal, log_sigma (L,): log of px and its standard
    deviation; principal (L, 2), principal_sigma (L,): px; free (L, 3): whether focal length, k1 and principal point may
    change.
    """

    of: Index
    aspect: Array
    log_focal: Array
    log_sigma: Array
    principal: Array
    principal_sigma: Array
    free: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.aspect)


def lenses_of(cameras: Sequence[Camera]) -> Lenses:
    """Cameras of which all the same is believed took their pictures with one lens.

    Of a camera whose whole K is given, distortion is too: points are then free of it.
    """
    keys = [_key(camera) for camera in cameras]
    first = {key: keys.index(key) for key in keys}
    number = {key: k for k, key in enumerate(first)}
    typical = [cameras[k] for k in first.values()]
    sigma = np.array([camera.log_sigma for camera in typical])
    principal_sigma = np.array([camera.principal_sigma * max(camera.size) for camera in typical])
    return Lenses(
        np.array([number[key] for key in keys]),
        np.array([camera.K[1, 1] / camera.K[0, 0] for camera in typical]),
        np.log([camera.focal for camera in typical]),
        sigma,
        np.array([camera.K[:2, 2] for camera in typical]),
        principal_sigma,
        np.column_stack([sigma > 0, (sigma > 0) | (principal_sigma > 0), principal_sigma > 0]),
    )


def _key(camera: Camera) -> tuple[object, ...]:
    return (camera.K.tobytes(), camera.size, camera.source, camera.log_sigma, camera.distortion.tobytes())


@dataclass(frozen=True, eq=False)
class Problem:
    """What is seen, and what is not solved for.

    tracks: observations; lenses: priors; scale: px by which thresholds are multiplied; noise_px: of the pairs'
    matches, px; place (N,): number of the place where each picture was taken, those of one number at one place; held
    (N,): pictures whose pose is given.
    """

    tracks: Tracks
    lenses: Lenses
    scale: float
    noise_px: float
    place: Index
    held: NDArray[np.bool_]

    @property
    def pictures(self) -> int:
        return len(self.place)

    def tied(self, stations: Sequence[Sequence[int]]) -> Problem:
        """The same with the pictures of each station at one place."""
        place = np.arange(self.pictures)
        for station in stations:
            place[list(station)] = min(station)
        return replace(self, place=place)


@dataclass(frozen=True, eq=False)
class Solution:
    """Cameras and points: picture j sees point p at K_j (R_j (r_p − ρ_p c_j)).

    R (N, 3, 3); centres (N, 3); focal, k1 (L,), principal (L, 2): of each lens, px; rays (P, 3), inverse_ranges (P,):
    of points; solved (P,): which points have any; used (O,): observations that are not left out.
    """

    R: Array
    centres: Array
    focal: Array
    k1: Array
    principal: Array
    rays: Array
    inverse_ranges: Array
    solved: NDArray[np.bool_]
    used: NDArray[np.bool_]

    @property
    def t(self) -> Array:
        t: Array = -np.einsum("nij,nj->ni", self.R, self.centres)
        return t

    def rescaled(self) -> Solution:
        """With the largest distance of a place from the origin 1; unchanged where all are there."""
        largest = float(np.linalg.norm(self.centres, axis=1).max())
        if not largest:
            return self
        return replace(self, centres=self.centres / largest, inverse_ranges=self.inverse_ranges * largest)

    def seen_from(self, picture: int) -> Solution:
        """In the frame of a picture: there R = I and its place is the origin."""
        turn, origin = self.R[picture], self.centres[picture]
        moved = (self.rays - self.inverse_ranges[:, None] * origin) @ turn.T
        lengths = np.linalg.norm(moved, axis=1)
        lengths = np.where(lengths > 0, lengths, 1)
        return replace(
            self,
            R=self.R @ turn.T,
            centres=(self.centres - origin) @ turn.T,
            rays=moved / lengths[:, None],
            inverse_ranges=self.inverse_ranges / lengths,
        )


def bearings(problem: Problem, solution: Solution) -> Array:
    """Unit directions (O, 3) of all observations in the frames of their pictures' cameras."""
    tracks = problem.tracks
    lens = problem.lenses.of[tracks.picture]
    focal = solution.focal[lens][:, None] * np.column_stack([np.ones(len(lens)), problem.lenses.aspect[lens]])
    return directions(tracks.pixels, focal, solution.principal[lens], solution.k1[lens])


def directions(pixels: Array, focal: Array, principal: Array, k1: Array) -> Array:
    """Unit directions (O, 3) of pixels (O, 2); focal, principal (O, 2) px, k1 (O,)."""
    raw = (pixels - principal) / focal
    ideal = raw.copy()
    for _ in range(8):
        ideal = raw / stretch_of(ideal, k1)[:, None]
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit


def stretch_of(ideal: Array, k1: Array) -> Array:
    """1 + k1 r² (O,) of ideal normalised points (O, 2); held where the lens would fold, beyond r² = 1 / (3 |k1|)."""
    r2 = (ideal**2).sum(axis=-1)
    stretch: Array = 1 + k1 * np.where(k1 < 0, np.minimum(r2, fold_of(k1)), r2)
    return stretch


def fold_of(k1: Array) -> Array:
    """r² where a lens with k1 < 0 folds."""
    limit: Array = 1 / (3 * np.maximum(np.abs(k1), 1e-12))
    return limit


def free_lens_parameters(lenses: Lenses) -> NDArray[np.bool_]:
    """Which of log f, k1 and the two coordinates of the principal point may change (L, 4)."""
    return lenses.free[:, [0, 1, 2, 2]]


def lens_priors(lenses: Lenses, scale: float) -> tuple[Array, Array]:
    """Means and weights (L, 4) of log f, k1 and principal point in a cost of px²; weight 0 where nothing is free."""
    mean = np.column_stack([lenses.log_focal, np.zeros(len(lenses)), lenses.principal])
    sigma = np.column_stack(
        [lenses.log_sigma, np.full(len(lenses), BUNDLE.k1_sigma), lenses.principal_sigma, lenses.principal_sigma]
    )
    free = free_lens_parameters(lenses)
    weight = np.where(free, (BUNDLE.prior_noise_px * scale) ** 2 / np.where(free, sigma, 1) ** 2, 0)
    return mean, weight


def lens_values(solution: Solution) -> Array:
    """log f, k1 and principal point (L, 4)."""
    return np.column_stack([np.log(solution.focal), solution.k1, solution.principal])
