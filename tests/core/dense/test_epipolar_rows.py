"""Epipolar lines become rows, wherever the epipole is."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.dense.epipolar_rows import EpipolarRows
from hypothesis import given
from hypothesis import strategies as st

BOX = np.array([10.0, 20.0, 329.0, 259.0])
EPIPOLES = [(170.0, 140.0, 1.0), (-40.0, 100.0, 1.0), (330.0, 258.0, 1.0), (5e4, -3e4, 1.0), (1.0, 0.2, 0.0),
            (-3.0, 4.0, 1e-12)]  # fmt: skip


def points_of_the_box() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(BOX[0], BOX[2], 23), np.linspace(BOX[1], BOX[3], 19))
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("epipole", EPIPOLES, ids=str)
@pytest.mark.parametrize("step", [1.0, 1.7])
def test_there_and_back(epipole: tuple, step: float) -> None:
    rows = EpipolarRows.over(np.array(epipole), BOX, step, 16.0)
    points = points_of_the_box()
    u, v = rows.column_row(points)
    np.testing.assert_allclose(rows.point(u, v), points, atol=1e-5)
    assert u.min() >= 0 and v.min() >= -1e-6 and u.max() <= rows.shape[1] - 1 and v.max() <= rows.shape[0] - 1
    grid = rows.points(np.arange(8), np.array([3, 4.5]))
    assert grid.shape == (2, 8, 2)
    np.testing.assert_allclose(grid[1, 5], rows.point(np.float64(5), np.float64(4.5)), atol=1e-6)


@pytest.mark.parametrize("epipole", EPIPOLES, ids=str)
def test_a_row_lies_on_a_line_through_the_epipole(epipole: tuple) -> None:
    rows = EpipolarRows.over(np.array(epipole), BOX, 1.0, 16.0)
    e = np.array(epipole) / np.linalg.norm(epipole)
    for row in (0, rows.shape[0] // 3, rows.shape[0] - 1):
        p = np.column_stack([rows.point(np.array([2.0, rows.shape[1] - 1.0]), np.full(2, float(row))), np.ones(2)])
        line = np.cross(p[0], p[1])
        # distance of the line's point nearest to the middle, turned to the epipole: as an angle seen from there
        line /= np.linalg.norm(line[:2])
        middle = np.array([*(BOX[:2] + BOX[2:]) / 2, 1.0])
        away = np.linalg.norm(e[:2] - e[2] * middle[:2])
        assert abs(line @ e) <= 1e-4 * max(away, abs(e[2]))


@given(st.floats(-2e3, 2e3), st.floats(-2e3, 2e3))
def test_neighbours_stay_within_a_pixel(x: float, y: float) -> None:
    rows = EpipolarRows.over(np.array([x, y, 1.0]), BOX, 1.0, 0.0)
    down = np.linalg.norm(np.diff(rows.point(np.full(2, rows.shape[1] - 1.0), np.array([4.0, 5.0])), axis=0))
    along = np.linalg.norm(np.diff(rows.point(np.array([4.0, 5.0]), np.full(2, 3.0)), axis=0))
    assert along == pytest.approx(1.0, abs=1e-6) and down <= 1.1


def test_the_margin_lies_before_and_behind() -> None:
    near, wide = (EpipolarRows.over(np.array([-400.0, 100.0, 1.0]), BOX, 1.0, margin) for margin in (0.0, 40.0))
    assert wide.shape[0] == near.shape[0] and abs(wide.shape[1] - near.shape[1] - 80) <= 1
    assert near.start[0] - wide.start[0] == pytest.approx(40.0)


@pytest.mark.parametrize("far", [2e8, 1e10])
def test_an_epipole_far_away_is_looked_for_from_the_middle_of_the_box(far: float) -> None:
    """Wherever the box lies: rows run from it to the epipole, and are as long as the box is that way."""
    box = BOX + [3e5, 3e5, 3e5, 3e5]
    rows = EpipolarRows.over(np.array([3e5 + 170, 3e5 + 140 - far, 1.0]), box, 1.0, 0.0)
    assert abs(rows.shape[0] - 320) <= 3 and abs(rows.shape[1] - 240) <= 3
    way = np.diff(rows.point(np.array([0.0, 100]), np.full(2, 10.0)), axis=0)[0]
    assert np.abs(way - [0, 100]).max() < 0.01
