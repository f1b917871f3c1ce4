"""One picture's camera as it is known before matching."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..raster.resizing import size_change
from .lens_models import Lens


class Knowledge(StrEnum):
    """How a focal length is known."""

    GIVEN = "given"  # by the user, a camera file or Blender: exact
    EXIF = "exif"  # from the picture's metadata: to some per cent
    EDGES = "edges"  # by straight edges of both pictures: to ten per cent, where matches are further off
    ASSUMED = "assumed"  # not known at all: a usual focal length


@dataclass(frozen=True, eq=False)
class ViewOf:
    """That a picture is a view of a sphere: the sphere's number among the pictures given and its name, and the
    rotation R (3, 3) from its axes to the view's."""

    sphere: int
    name: str
    R: NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """One picture's camera as known before matching.

    Attributes
    ----------
    K : (3, 3)
        Intrinsics in px; pixel centres are integers.
    size : (int, int)
        (W, H) px.
    source : str
        Where the focal length comes from, in words.
    log_sigma : float
        Standard deviation of log f; 0 for a fixed focal length.
    distortion : (5,)
        k1, k2, p1, p2, k3 as in OpenCV; all 0 where there is a `lens`.
    pose : (R, t), optional
        World to camera: x ~ K (R X + t).
    principal_sigma : float
        Standard deviation of the principal point in units of the longer side; 0 if it is fixed.
    knowledge : Knowledge
        How the focal length is known.
    lens_of : str
        Name of the picture whose focal length was taken, this one's own not being known; empty where it is.
    in_metres : bool
        Whether the pose is in metres, and not in a unit of its own.
    lens : Lens, optional
        A lens of another kind, which then is known; None where `distortion` says all.
    start : (3, 3), optional
        A rotation, world to camera, to begin with: nothing is held by it.
    view_of : ViewOf, optional
        Where the picture is a view of a sphere, whose views turn and move as one.
    """

    K: NDArray[np.float64]
    size: tuple[int, int]
    source: str
    log_sigma: float
    distortion: NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    pose: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    principal_sigma: float = 0.0
    knowledge: Knowledge = Knowledge.GIVEN
    lens_of: str = ""
    in_metres: bool = False
    lens: Lens | None = None
    start: NDArray[np.float64] | None = None
    view_of: ViewOf | None = None

    @property
    def focal(self) -> float:
        """Horizontal focal length in px."""
        return float(self.K[0, 0])

    @property
    def fixed(self) -> bool:
        """Whether the focal length may not be changed by the matches."""
        return self.log_sigma == 0

    @property
    def assumed(self) -> bool:
        """Whether nothing was known of the focal length."""
        return self.knowledge == Knowledge.ASSUMED

    @property
    def bent(self) -> bool:
        """Whether its picture shows anything else than a pinhole would."""
        return bool(self.distortion.any()) or (self.lens is not None and self.lens.bends)

    @property
    def lens_known(self) -> bool:
        """Whether its distortion is known, or that it has none, and not to be sought."""
        return self.lens is not None or bool(self.distortion.any())

    def without_lens(self) -> Camera:
        """The camera of the same points free of distortion; where that was known, it is known that none is left."""
        return replace(self, distortion=np.zeros(5), lens=Lens() if self.lens_known else None)

    def zoomed(self, factor: float) -> Camera:
        """The camera with its focal length called so many times as long; a known lens moves the same pixels."""
        lens = None if self.lens is None else self.lens.zoomed(factor)
        distortion = self.distortion * factor ** np.array([2.0, 4, 1, 1, 6])
        return replace(self, K=self.scaled(factor), distortion=distortion, lens=lens)

    def scaled(self, factor: float) -> NDArray[np.float64]:
        """K with its focal length times `factor`."""
        return zoomed(self.K, factor)

    def with_focal_held(self) -> Camera:
        """The camera with its focal length taken as given, however it is known."""
        return replace(self, log_sigma=0.0, knowledge=Knowledge.GIVEN)

    def resized(self, size: tuple[int, int]) -> Camera:
        """The camera of its picture resized to (W, H) px."""
        factor, shift = size_change(self.size, size)
        K = self.K.copy()
        K[:2] *= factor[:, None]
        K[:2, 2] += shift
        return replace(self, K=K, size=size)


def zoomed(K: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    """K (3, 3) with its focal length times `factor`."""
    out = K.copy()
    out[0, 0] *= factor
    out[1, 1] *= factor
    return out
