"""Where a map turns over: areas by hand, which way each pixel is turned, and what share goes the other way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.field import folding
from edf_stitch.core.field.folding import NO_TURN, cell_areas, folds, jacobian, turned_over, turning
from edf_stitch.core.raster.picture_map import PictureMap

WIDTH, HEIGHT = 30, 20


def affine(a: float, b: float, c: float, d: float, start: tuple[float, float] = (0.0, 0.0)) -> tuple:
    """x' = a x + b y, y' = c x + d y from a start, float32."""
    x, y = np.meshgrid(np.arange(WIDTH, dtype=np.float64), np.arange(HEIGHT, dtype=np.float64))
    return tuple((v + s).astype(np.float32) for v, s in zip((a * x + b * y, c * x + d * y), start, strict=True))


@pytest.mark.parametrize("matrix", [(1, 0, 0, 1), (2, 0.5, -0.25, 3), (-1, 0, 0, 1), (1, 2, 3, -1)])
def test_an_affine_map_has_the_area_of_its_determinant_everywhere(matrix: tuple[float, float, float, float]) -> None:
    x, y = affine(*matrix)
    determinant = matrix[0] * matrix[3] - matrix[1] * matrix[2]
    assert np.allclose(jacobian(x, y), determinant) and jacobian(x, y).shape == x.shape
    assert np.allclose(cell_areas(x, y), determinant) and cell_areas(x, y).shape == (HEIGHT - 1, WIDTH - 1)


def test_the_area_of_a_cell_is_that_between_a_pixel_and_its_right_and_lower_neighbours() -> None:
    x, y = np.array([[0.0, 2, 9], [1, 7, 5]]), np.array([[0.0, 1, 4], [3, 8, 6]])
    assert np.array_equal(cell_areas(x, y), [[2 * 3 - 1 * 1, 7 * 7 - 5 * 3]])


def test_beside_what_is_not_finite_nothing_is_known() -> None:
    x, y = affine(1, 0, 0, 1)
    x[5, 7] = np.nan
    unknown = np.argwhere(np.isnan(cell_areas(x, y))).tolist()
    assert unknown == [[4, 7], [5, 6], [5, 7]]
    assert np.isnan(jacobian(x, y)[[4, 5, 5, 6], [7, 6, 8, 7]]).all()


@pytest.mark.parametrize("strip", [1, 100, 2_000_000])
def test_each_pixel_that_shows_the_target_is_turned_one_way(strip: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As it is in the first ten columns, pressed flat in the next ten, mirrored in the rest; at any size of strips."""
    monkeypatch.setattr(folding, "FOLDING", replace(folding.FOLDING, strip_pixels=strip))
    x, y = affine(1, 0, 0, 1, (5.0, 3.0))
    column = np.arange(WIDTH)
    x[:] = np.where(column < 10, column, np.where(column < 20, 9, 28 - column)) + 5
    turns = turning(PictureMap(x, y, (100, 100)))
    assert turns.shape == x.shape
    assert (turns[:-1, :9] == 1).all() and (turns[:-1, 9:19] == 0).all() and (turns[:-1, 19:29] == -1).all()
    assert (turns[-1] == NO_TURN).all() and (turns[:, -1] == NO_TURN).all()
    shown = turning(PictureMap(x, y, (13, 18))) != NO_TURN
    assert np.array_equal(shown[:-1, :-1], ((x <= 12) & (y <= 17))[:-1, :-1])


def test_the_share_of_folds_is_that_of_the_pixels_that_go_the_rarer_ways() -> None:
    turns = np.full((20, 20), NO_TURN, np.int8)
    assert folds(turns) == 0
    turns[:10] = 1
    assert folds(turns) == 0
    turns[:2, :5] = -1
    turns[2, :10] = 0
    assert folds(turns) == pytest.approx(20 / 200)
    assert folds(-turns * (turns != NO_TURN) + NO_TURN * (turns == NO_TURN)) == pytest.approx(20 / 200), "mirrored"
    flat = np.zeros((10, 10), np.int8)
    flat[:, :3], flat[:, 3:5] = 1, -1
    assert folds(flat) == pytest.approx(0.5)


def test_what_the_target_cannot_see_and_its_rim_of_three_px_are_no_folds() -> None:
    turns = np.ones((30, 40), np.int8)
    turns[10:20, 15:25] = -1
    hidden = np.zeros(turns.shape, bool)
    assert folds(turns, hidden) == pytest.approx(100 / 1200)
    hidden[13:17, 18:22] = True
    assert folds(turns, hidden) == 0
    hidden[:] = False
    hidden[14:17, 18:22] = True  # a pixel less: one line of ten is left, of all but 9 × 10
    assert folds(turns, hidden) == pytest.approx(10 / (1200 - 90))


def test_what_is_turned_over_is_what_goes_the_rarer_way() -> None:
    turns = np.full((10, 10), NO_TURN, np.int8)
    turns[:6] = 1
    turns[:2, :3] = -1
    assert np.array_equal(turned_over(turns), turns == -1)
    turns[:6] *= -1
    assert np.array_equal(turned_over(turns), turns == 1), "the whole picture is mirrored"
    assert not turned_over(np.zeros((5, 5), np.int8)).any()
