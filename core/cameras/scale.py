"""How long a baseline is: depth is found in baselines, and only what was measured besides tells metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..pictures.naming import number_of
from ..raster.arrays import Array
from ..system.errors import BadRequest, DegenerateGeometry, NoOverlap
from .camera import Camera

# Two pictures, each by its number, counted from 1, or its name; and the distance of their places in metres.
ScaleMetres = tuple[int | str, int | str, float]
# The shortest distance of two places that tells a scale, in baselines: below, rounding does.
LEAST_DISTANCE = 1e-6


@dataclass(frozen=True)
class Scale:
    """The unit of depth.

    Attributes
    ----------
    metres : float or None
        Of one baseline; None where it is not known. A baseline is the distance of the two places of a pair, and of more
        pictures that of the first one's place, which is the viewpoint's, from the one farthest from it.
    source : str
        How it is known, in words.
    """

    metres: float | None = None
    source: str = "pictures alone do not tell it"

    @property
    def unit(self) -> str:
        """In what ranges are told."""
        return "baselines" if self.metres is None else "metres"

    @property
    def factor(self) -> float:
        """By which ranges in baselines are multiplied."""
        return 1.0 if self.metres is None else self.metres


@dataclass(frozen=True)
class Places:
    """Where the pictures of a panorama stand.

    names : of all pictures that were given; shown_by : of each the number of the one that is used for it, if copies
    were given; numbers : which of these the panorama is made of; centres (N, 3) : their places, baselines.
    """

    names: Sequence[str]
    shown_by: Sequence[int]
    numbers: Sequence[int]
    centres: Array

    def of(self, asked: int | str) -> Array:
        """The place (3,) of a picture, by its number, counted from 1, or its name. Raises BadRequest, NoOverlap."""
        if isinstance(asked, int):
            shown_by = self.shown_by or range(len(self.names))
            if not 1 <= asked <= len(shown_by):
                raise BadRequest(f"--scale-metres names picture {asked}, and only {len(shown_by)} are given")
            number = shown_by[asked - 1]
        else:
            number = number_of(asked, self.names, "--scale-metres")
        if number not in self.numbers:
            raise NoOverlap(
                f"--scale-metres names {self.names[number]}, which is left out: name two pictures that connect"
            )
        place: Array = self.centres[list(self.numbers).index(number)]
        return place


def scale_for(asked: ScaleMetres | None, cameras: Sequence[Camera], places: Places) -> Scale:
    """How long a baseline is, by what was asked for, or by given cameras.

    Parameters
    ----------
    asked : ScaleMetres or None
        Two pictures and their distance.
    cameras : sequence of Camera
        Of all pictures that were given, as they were given.
    places : Places

    Returns
    -------
    Scale

    Raises
    ------
    BadRequest, NoOverlap
        There is no such picture, or it is left out.
    DegenerateGeometry
        The two were taken from one place, or the geometry knows no places.
    """
    if asked is not None:
        one, other, metres = asked
        apart = float(np.linalg.norm(places.of(one) - places.of(other)))
        if not apart > LEAST_DISTANCE:  # NaN too
            raise DegenerateGeometry(
                f"--scale-metres: the distance of {one} and {other} tells no scale, since the pictures show no "
                "parallax between them: name two that were taken from different places, or leave it out"
            )
        return Scale(metres / apart, f"{one} and {other} are {metres:g} m apart")
    factors = []
    given = [
        (place, number) for place, number in enumerate(places.numbers)
        if cameras[number].pose is not None and cameras[number].in_metres
    ]  # fmt: skip
    for (first, i), (second, j) in combinations(given, 2):
        apart = float(np.linalg.norm(places.centres[first] - places.centres[second]))
        if apart > LEAST_DISTANCE:
            factors.append(float(np.linalg.norm(_centre(cameras[i]) - _centre(cameras[j]))) / apart)
    if not factors or not np.median(factors) > 0:
        return Scale()
    return Scale(float(np.median(factors)), "the cameras that were given are in metres")


def _centre(camera: Camera) -> Array:
    """Where a given camera stands."""
    assert camera.pose is not None
    R, t = camera.pose
    centre: Array = -R.T @ t
    return centre
