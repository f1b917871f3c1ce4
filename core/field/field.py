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
    """A field at the nodes of a grid.

    inverse_depth (rows, columns): d, NaN for fields without depth (their e' is 0). shift (rows, columns, 2): px of
    picture number `picture` added to π(H_inf p + d e'), None for fields that stay on the epipolar lines. far (3,): the
    plane that d equals beyond the fade, None for fields that are defined on the reference's plane only.
    """

    inverse_depth: Array
    shift: Array | None = None
    far: Array | None = None
    picture: int = 1


@dataclass(frozen=True)
class Fit:
    """How a field was fitted.

    inliers_used (N,): which of the given matches the field is fitted to; smoothing: λ in units of W·H; fade_px: width
    of the fade outside the overlap; residual_px: RMS residual along the epipolar lines, target px; held_out_px: the
    same, each match predicted without itself; negative_share: share of the matches with d < 0.
    """

    inliers_used: NDArray[np.bool_]
    smoothing: float
    fade_px: float
    residual_px: float
    held_out_px: float
    negative_share: float


class Field(Protocol):
    """Maps points of the reference's plane to target pixels, both ideal (undistorted)."""

    @property
    def name(self) -> str:
        """Its name for `--field`."""
        ...

    @property
    def two_view(self) -> TwoView:
        """The geometry that its values are added to."""
        ...

    @property
    def plane(self) -> Array:
        """m (3,): the affine part of d, on homogeneous reference pixels, that it fades to outside the overlap."""
        ...

    @property
    def fit(self) -> Fit:
        """How it was fitted."""
        ...

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """Its values at a grid's nodes.

        Parameters
        ----------
        grid : Grid
            Nodes on the reference's plane.
        ideal : (rows, columns, 2) array, optional
            The nodes' undistorted pixels; the nodes themselves if not given.

        Returns
        -------
        FieldValues
        """
        ...

    def predict(self, points: Array) -> Array:
        """Target pixels (N, 2) of points (N, 2) in the overlap, where no field fades, both ideal px; NaN behind the
        target camera."""
        ...

    def refitted(self, matches: Matches) -> Field:
        """The same kind of field fitted to other matches of the pair, none dropped, with the same λ.

        Raises
        ------
        DegenerateGeometry
            The matches do not determine a field.
        """
        ...
