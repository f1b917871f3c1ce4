"""What the bundle solves for, and what it is given, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...cameras.bodies import Bodies
from ...cameras.camera import Camera
from ...raster.arrays import Array
from .bundle_options import BUNDLE
from .tracks import Index, Tracks

# What is solved for of a lens: log of a factor on the believed focal lengths, k1, shift of the principal point in px.
LENS = 4


@dataclass(frozen=True, eq=False)
class Lenses:
    """Lenses that pictures were taken with, as they were believed before matching.

    of (N,): the lens of each picture; focal, aspect (N,), principal (N, 2): believed of each picture, px, fy / fx;
    sigma (L, LENS): standard deviations of what is solved for, whose mean is 0; free (L, LENS): what may change.
    """

    of: Index
    focal: Array
    aspect: Array
    principal: Array
    sigma: Array
    free: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.sigma)

    @property
    def first(self) -> Index:
        """The first picture of each lens (L,)."""
        return np.unique(self.of, return_index=True)[1]

    def weights(self, scale: float) -> Array:
        """Of the priors (L, LENS) in a cost of px²; 0 where nothing is free."""
        noise = BUNDLE.prior_noise_px * scale
        weights: Array = np.where(self.free, noise**2 / np.where(self.free, self.sigma, 1) ** 2, 0)
        return weights


def lenses_of(cameras: Sequence[Camera]) -> Lenses:
    """Cameras of which all the same is believed took their pictures with one lens. A picture of another size may have
    been cropped, which moves its principal point.

    Of a camera whose whole K is given, distortion is too: its points are free of it.
    """
    keys = [(c.K.tobytes(), c.size, c.source, c.log_sigma, c.principal_sigma, c.lens) for c in cameras]
    first = [k for k, key in enumerate(keys) if keys.index(key) == k]
    of = [first.index(keys.index(key)) for key in keys]
    sigma = [_sigma_of(cameras[k]) for k in first]
    return Lenses(
        np.array(of),
        np.array([camera.focal for camera in cameras]),
        np.array([camera.K[1, 1] / camera.K[0, 0] for camera in cameras]),
        np.array([camera.K[:2, 2] for camera in cameras]),
        np.array(sigma),
        np.array(sigma) > 0,
    )


def _sigma_of(camera: Camera) -> tuple[float, ...]:
    shift = camera.principal_sigma * max(camera.size)
    bends = bool(camera.log_sigma or shift) and not camera.lens_known
    return camera.log_sigma, BUNDLE.k1_sigma if bends else 0.0, shift, shift


def with_lens(camera: Camera, change: Array) -> Camera:
    """The camera with what was solved for of its lens (LENS,); what was given stays to the last bit."""
    log_factor, k1, *shift = change
    zoomed = camera.zoomed(float(np.exp(log_factor)))
    K = zoomed.K
    K[:2, 2] += shift
    distortion = zoomed.distortion if camera.lens_known else np.array([k1, 0, 0, 0, 0])
    return replace(zoomed, K=K, distortion=distortion)


@dataclass(frozen=True, eq=False)
class Problem:
    """What is seen, and what is not solved for.

    tracks: observations; lenses: priors; scale: px by which thresholds are multiplied; noise_px: of the pairs'
    matches, px; place (N,): number of the place where each picture was taken, those of one number at one place; held
    (N,): pictures whose pose is given; bodies: which pictures turn and move as one, those of one body at one place.
    """

    tracks: Tracks
    lenses: Lenses
    scale: float
    noise_px: float
    place: Index
    held: NDArray[np.bool_]
    bodies: Bodies

    @property
    def pictures(self) -> int:
        return len(self.place)

    def with_stations(self, stations: Sequence[Sequence[int]]) -> Problem:
        """The same with the pictures of each station at one place."""
        place = self.bodies.of.copy()
        for station in stations:
            together = np.isin(place, place[list(station)])
            place[together] = place[together].min()
        return replace(self, place=place)


@dataclass(frozen=True, eq=False)
class Solution:
    """Cameras and points: picture j sees point p at K_j (R_j (r_p − ρ_p c_j)).

    R (N, 3, 3); centres (N, 3); lens (L, LENS): changes of each; rays (P, 3), inverse_ranges (P,): of points; solved
    (P,): which points have any; used (O,): observations that are not left out.
    """

    R: Array
    centres: Array
    lens: Array
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


@dataclass(frozen=True, eq=False)
class LensOfPictures:
    """For each of some pictures: focal, aspect, k1 (M,), principal (M, 2)."""

    focal: Array
    aspect: Array
    k1: Array
    principal: Array


def lens_of(problem: Problem, solution: Solution, picture: Index) -> LensOfPictures:
    """The lenses of pictures (M,), as solved."""
    lenses = problem.lenses
    change = solution.lens[lenses.of[picture]]
    return LensOfPictures(
        lenses.focal[picture] * np.exp(change[:, 0]), lenses.aspect[picture], change[:, 1],
        lenses.principal[picture] + change[:, 2:],
    )  # fmt: skip


def bearings(problem: Problem, solution: Solution) -> Array:
    """Unit directions (O, 3) of all observations in the frames of their pictures' cameras."""
    lens = lens_of(problem, solution, problem.tracks.picture)
    raw = (problem.tracks.pixels - lens.principal) / lens.focal[:, None]
    raw[:, 1] /= lens.aspect
    ideal = raw.copy()
    for _ in range(BUNDLE.undistorting):
        ideal = raw / stretch_of(ideal, lens.k1)[:, None]
    rays = np.column_stack([ideal, np.ones(len(ideal))])
    unit: Array = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit


def stretch_of(ideal: Array, k1: Array) -> Array:
    """1 + k1 r² (O,) of ideal normalised points (O, 2); held where the lens would fold."""
    stretch: Array = 1 + k1 * bending_of(ideal, k1)
    return stretch


def bending_of(ideal: Array, k1: Array) -> Array:
    """r² (O,), no more than where the lens folds."""
    r2 = (ideal**2).sum(axis=-1)
    bending: Array = np.where(k1 < 0, np.minimum(r2, fold_of(k1)), r2)
    return bending


def fold_of(k1: Array) -> Array:
    """r² where a lens with k1 < 0 folds."""
    limit: Array = 1 / (3 * np.maximum(np.abs(k1), 1e-12))
    return limit
