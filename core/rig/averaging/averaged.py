"""Between the halves of registration, as data: pairs whose geometry is known, and rotations that agree with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from ...cameras.camera import Camera
    from ...cameras.rig import PictureMatches
    from ...raster.arrays import Array


@dataclass(frozen=True, eq=False)
class Verified:
    """Matches of pairs that agree with some motion of the camera.

    pairs: of those pairs that do, the strongest first; found: how many matches each of them had before; best (N,): for
    each picture, how many agreed in the best of its pairs, also where those were too few; scale: px by which thresholds
    are multiplied; seed: of every random choice.
    """

    pairs: tuple[PictureMatches, ...]
    found: tuple[int, ...]
    best: NDArray[np.intp]
    scale: float
    seed: int


@dataclass(frozen=True, eq=False)
class PairGeometry:
    """What is known of pictures i and j (i < j) by their matches: a ray b of i points to R b + ρ t of j.

    index (M, 2): features of both that their epipolar geometry explains; verified: how many matches any fundamental
    matrix explained, found: how many there were; R (3, 3), t (3,): the pair's own pose, |t| = 1; information (3, 3): of
    R, 1 / rad², turned by a rotation vector from the left, t eliminated; noise_px: of the Sampson distances;
    parallax_px: the median distance from the best pure rotation; rotation_gain: by how much a pure rotation is the
    better model of a match (GRIC), negative where a pose is; rotates: whether it is by far, and the averaged rotations
    agree with it; off_degrees: of R from the averaged rotations.
    """

    i: int
    j: int
    index: NDArray[np.intp]
    found: int
    verified: int
    R: Array
    t: Array
    information: Array
    noise_px: float
    parallax_px: float
    rotation_gain: float
    rotates: bool
    off_degrees: float

    @property
    def degrees(self) -> float:
        """Standard deviation of the pair's rotation, a mean over its three axes."""
        spread = np.trace(np.linalg.inv(self.information + 1e-6 * np.trace(self.information) * np.eye(3))) / 3
        return float(np.degrees(np.sqrt(spread)))


@dataclass(frozen=True, eq=False)
class Averaged:
    """Rotations of all pictures that connect, and what they were averaged with.

    members: numbers of the pictures, ascending; cameras: of all pictures given, with focal length and k1 as the pairs
    have them; R (N, 3, 3): of all pictures given, NaN for those that are no members; pairs: those between members that
    agree, all with their inliers; noise_px: of all pairs together; loop_degrees: how far the worst loop of pairs is
    from closing, NaN without one; one_place: whether pure rotations explain the pairs together; cost: what is compared
    between starts, the lower the better.
    """

    members: tuple[int, ...]
    cameras: tuple[Camera, ...]
    R: Array
    pairs: tuple[PairGeometry, ...]
    noise_px: float
    loop_degrees: float
    one_place: bool
    cost: float


def first_is(points: Sequence[Array], pair: PictureMatches) -> tuple[int, int]:
    """Columns of `pair.index` so that the picture that comes first does by its points, not by its number.

    What is drawn at random or iterated then comes out the same however the pictures are numbered.
    """
    first, second = (np.sort(points[k][pair.index[:, c]], axis=0).sum(axis=0) for c, k in enumerate((pair.i, pair.j)))
    return (0, 1) if tuple(first) <= tuple(second) else (1, 0)
