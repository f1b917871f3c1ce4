"""A field that several maps share works out its values on a grid once."""

from __future__ import annotations

import numpy as np
from edf_stitch.core.field.field import FieldValues
from edf_stitch.core.field.remembered import Remembered
from edf_stitch.core.raster.grid import Grid


class Counting:
    """A field that counts how often it is asked."""

    name = "counting"
    asked = 0

    def on_grid(self, grid: Grid, ideal: np.ndarray | None = None) -> FieldValues:
        self.asked += 1
        return FieldValues(np.full((grid.rows, grid.columns), float(grid.step)), None)


def test_each_grid_is_worked_out_once() -> None:
    counting = Counting()
    field = Remembered(counting)
    coarse, fine = Grid.over(0, 0, 400, 300, 50), Grid.over(0, 0, 400, 300, 500)
    for grid in (coarse, fine, Grid.over(0, 0, 400, 300, 50), fine):
        values = field.on_grid(grid)
        assert values.inverse_depth.shape == (grid.rows, grid.columns)
        assert (values.inverse_depth == grid.step).all()
    assert counting.asked == 2
    assert field.name == "counting"
