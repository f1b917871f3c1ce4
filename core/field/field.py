"""What a displacement field is: the protocol that all fields follow, and its values at nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.grid import Grid


@dataclass(frozen=True)
class FieldValues:
    """A field at nodes: inverse_depth (rows, columns), NaN where it knows none (e' is 0 then), and shift (rows,
    columns, 2), px of picture number `picture` that come on top of π(H_inf p + d e') there, None where the field keeps
    to its lines; far (3,): the plane that inverse_depth ends in beyond the fade, None for a field that means nothing
    off the reference's plane.
    """

    inverse_depth: Array
    shift: Array | None = None
    far: Array | None = None
    picture: int = 1


@dataclass(frozen=True)
class Fit:
    """How a field came about.

    `inliers_used` (N,): the matches (of those given) it stands on; smoothing: λ in units of W·H; fade_px: width of the
    fade outside the overlap; residual_px: RMS along the lines; held_out_px: the same leave-one-out; negative_share:
    share of its matches with d < 0.
    """

    inliers_used: NDArray[np.bool_]
    smoothing: float
    fade_px: float
    residual_px: float
    held_out_px: float
    negative_share: float


class Field(Protocol):
    """A displacement field: where canvas points are seen in the target, in ideal (undistorted) pixels of both."""

    @property
    def name(self) -> str:
        """What `--field` calls it."""
        ...

    @property
    def two_view(self) -> TwoView:
        """The geometry that its values come on top of."""
        ...

    @property
    def plane(self) -> Array:
        """m (3,): the affine part, which it fades to far from the overlap."""
        ...

    @property
    def fit(self) -> Fit:
        """How it came about."""
        ...

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Its values at a grid's nodes; ideal (rows, columns, 2): the nodes' ideal pixels, where they are not the
        canvas's."""
        ...

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) of the overlap, where nothing fades, ideal pixels both; NaN behind the
        target camera."""
        ...

    def refitted(self, matches: Matches) -> Field:
        """The same kind of field on other matches of the pair, all of them kept, at the λ that was found before.

        Raises DegenerateGeometry.
        """
        ...
