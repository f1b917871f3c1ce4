"""A field that is asked for its values on the same grids again and again, as for the maps of one stitch."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from ..cameras.matches import Matches
from ..cameras.two_view import TwoView
from ..raster.arrays import Array
from ..raster.grid import Grid
from .field import Field, FieldValues, Fit


@dataclass(frozen=True, eq=False)
class Remembered:
    """A field that works out its values on a grid once; `ideal` has to be of one camera, always."""

    field: Field
    found: dict[Grid, FieldValues] = dataclasses.field(default_factory=dict)

    @property
    def name(self) -> str:
        """See `Field`."""
        return self.field.name

    @property
    def two_view(self) -> TwoView:
        """See `Field`."""
        return self.field.two_view

    @property
    def plane(self) -> Array:
        """See `Field`."""
        return self.field.plane

    @property
    def fit(self) -> Fit:
        """See `Field`."""
        return self.field.fit

    def on_grid(self, grid: Grid, ideal: Array | None = None) -> FieldValues:
        """See `Field`."""
        if grid not in self.found:
            self.found[grid] = self.field.on_grid(grid, ideal)
        return self.found[grid]

    def predict(self, points: Array) -> Array:
        """See `Field`."""
        return self.field.predict(points)

    def refitted(self, matches: Matches) -> Field:
        """See `Field`."""
        return self.field.refitted(matches)
