"""All pictures' cameras together, as data: where they stand and look, and the points that several of them see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array
from .camera import Camera
from .projective import inverse_intrinsics
from .view import View


@dataclass(frozen=True, eq=False)
class PictureMatches:
    """Which features of pictures number i and j (i < j) match: index (M, 2), into the features of each."""

    i: int
    j: int
    index: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)


@dataclass(frozen=True, eq=False)
class Observations:
    """Where points are seen.

    picture, point (O,): numbers of both; pixels (O, 2): raw px of the picture; used (O,): whether the bundle kept it.
    """

    picture: NDArray[np.intp]
    point: NDArray[np.intp]
    pixels: Array
    used: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RigEdge:
    """What is known between pictures i and j of a rig (i < j).

    matches: how many were found; inliers: how many the geometry of the pair explains; noise_px: their Sampson noise;
    parallax_px: their median parallax off a pure rotation; off_degrees: between the pair's own rotation and the rig's;
    baseline: how the length between the two is known, "measured" by points that a third picture sees, by "continuity"
    of depth, or "none".
    """

    i: int
    j: int
    matches: int
    inliers: int
    noise_px: float
    parallax_px: float
    off_degrees: float
    baseline: str = "measured"


@dataclass(frozen=True)
class FocalGuess:
    """A hypothesis of the focal length that was carried to the end: px and k1 of the first lens, and its cost, px² a
    match."""

    focal: float
    k1: float
    cost: float


@dataclass(frozen=True, eq=False)
class Rig:
    """The cameras of N pictures, in the frame of the first: picture j sees the ray r at K_j (R_j r + ρ t_j).

    Attributes
    ----------
    cameras : tuple of Camera
        As estimated: focal length, principal point and distortion.
    R, t : (N, 3, 3), (N, 3)
        R_0 = I and t_0 = 0; the longest t has length 1, or all are 0 if all pictures were taken from one place.
    rays, inverse_ranges, deviations : (P, 3), (P,), (P,)
        Points: unit rays r, ρ = 1 / range in baselines, and the standard deviation of ρ.
    observations : Observations
    edges : tuple of RigEdge
    stations : tuple of tuples of int
        Pictures that were taken from one place, at least two each.
    lenses : tuple of int
        For each picture the number of its lens: those of one number share focal length, distortion, principal point.
    focal_deviation : (N,)
        Standard deviation of log f of each picture; 0 where it was given.
    position_deviation : (N,)
        Standard deviation of each picture's place, in units of the longest t.
    guesses : tuple of FocalGuess
        Hypotheses within five per cent of the least cost, the one that was taken first.
    noise_px : float
        Of the observations that were kept.
    loop_degrees : float
        How far the rotations of pairs around the worst loop are from closing; NaN without a loop.
    """

    cameras: tuple[Camera, ...]
    R: Array
    t: Array
    rays: Array
    inverse_ranges: Array
    deviations: Array
    observations: Observations
    edges: tuple[RigEdge, ...] = ()
    stations: tuple[tuple[int, ...], ...] = ()
    lenses: tuple[int, ...] = ()
    focal_deviation: Array = field(default_factory=lambda: np.zeros(0))
    position_deviation: Array = field(default_factory=lambda: np.zeros(0))
    guesses: tuple[FocalGuess, ...] = ()
    noise_px: float = float("nan")
    loop_degrees: float = float("nan")

    def __len__(self) -> int:
        return len(self.cameras)

    @property
    def centres(self) -> Array:
        """The pictures' places (N, 3)."""
        centres: Array = -np.einsum("nji,nj->ni", self.R, self.t)
        return centres

    @property
    def own_order(self) -> list[int]:
        """The numbers of its pictures in an order of its own, whatever order they were given in: the first, whose frame
        it is, then the others by how they look and stand."""
        stands = [(*turn.ravel().tolist(), *shift.tolist()) for turn, shift in zip(self.R, self.t, strict=True)]
        return [0, *sorted(range(1, len(self)), key=stands.__getitem__)]

    def renumbered(self, order: Sequence[int]) -> Rig:
        """The same with its pictures in another order, to the last bit: the frame stays that of the one that was first
        (see `reframing` for another one's)."""
        new_number = np.argsort(order)
        edges = (_renumbered(edge, new_number) for edge in self.edges)
        return replace(
            self,
            cameras=tuple(self.cameras[number] for number in order),
            R=self.R[list(order)],
            t=self.t[list(order)],
            observations=replace(self.observations, picture=new_number[self.observations.picture]),
            edges=tuple(sorted(edges, key=lambda edge: (edge.i, edge.j))),
            stations=tuple(tuple(sorted(int(new_number[one]) for one in station)) for station in self.stations),
            lenses=tuple(self.lenses[number] for number in order) if self.lenses else (),
            focal_deviation=_in_order(self.focal_deviation, order),
            position_deviation=_in_order(self.position_deviation, order),
        )

    @property
    def views(self) -> tuple[View, ...]:
        """What warp needs of each picture, for canvas points p = K_0 r."""
        back = inverse_intrinsics(self.cameras[0].K)
        return tuple(
            View(camera, camera.K, R, t, camera.K @ R @ back, camera.K @ t)
            for camera, R, t in zip(self.cameras, self.R, self.t, strict=True)
        )


def _renumbered(edge: RigEdge, new_number: NDArray[np.intp]) -> RigEdge:
    i, j = sorted((int(new_number[edge.i]), int(new_number[edge.j])))
    return replace(edge, i=i, j=j)


def _in_order(values: Array, order: Sequence[int]) -> Array:
    """Values of each picture in another order; as they are where nothing was said."""
    return values[list(order)] if len(values) else values


@dataclass(frozen=True, eq=False)
class Registration:
    """What became of pictures that were to be registered together.

    rig: of those that were; numbers: which of the given pictures they are, in the rig's order;
    left_out: why each other one is not in it, by its number, in words that name its best count of inliers.
    """

    rig: Rig
    numbers: tuple[int, ...]
    left_out: dict[int, str]

    @property
    def focals(self) -> dict[int, float]:
        """Focal lengths, px, of those that were registered, by their numbers among the given pictures."""
        return {number: camera.focal for number, camera in zip(self.numbers, self.rig.cameras, strict=True)}
