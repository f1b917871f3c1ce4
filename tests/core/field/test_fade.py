"""How a field fades: where the overlap ends, how smoothly, over how many px."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.field.fade import fade_width, fading, on_nodes, outside_overlap
from edf_stitch.core.field.spline import SmoothingProblem
from edf_stitch.core.raster.grid import Grid

# Cells of one pixel: nodes lie on whole pixels from (−2, −3) on.
PIXELS = Grid((-2, -3), 1, 14, 13)


def test_it_is_whole_at_the_overlap_and_gone_at_its_width_and_smooth_at_both() -> None:
    assert np.allclose(
        fading(np.array([0.0, 2.5, 5.0, 7.5, 10.0, 99.0, np.inf]), 10.0), [1, 27 / 32, 0.5, 5 / 32, 0, 0, 0]
    )
    at, h = np.array([0.0, 10.0]), 1e-4
    slope = (fading(at + h, 10.0) - fading(np.maximum(at - h, 0), 10.0)) / (2 * h)
    assert np.abs(slope).max() < 1e-4


def test_a_node_belongs_to_the_overlap_where_both_pictures_have_it_borders_included() -> None:
    """The reference is 10 × 8 px; the target, as large, shows what lies four px further right and one further down."""
    target = PIXELS.points + (-4, -1)
    away = outside_overlap(PIXELS, target, (10, 8), (10, 8))
    x, y = PIXELS.points[..., 0], PIXELS.points[..., 1]
    inside = (x >= 4) & (x <= 9) & (y >= 1) & (y <= 7)
    assert not away[inside].any()
    # distances count from one cell on: a cell beside the last inside one may still touch the overlap
    dx = np.maximum(np.maximum(4 - x, x - 9), 0)
    dy = np.maximum(np.maximum(1 - y, y - 7), 0)
    assert np.allclose(away, np.maximum(np.hypot(dx, dy) - 1, 0))


@pytest.mark.parametrize(("size", "target_size", "last"), [((10, 8), (6, 5), (5, 4)), ((6, 5), (10, 8), (5, 4))])
def test_each_picture_ends_at_its_own_size(size: tuple[int, int], target_size: tuple[int, int], last: tuple) -> None:
    """The same place in both pictures, of which one is smaller: the overlap is the smaller one."""
    away = outside_overlap(PIXELS, PIXELS.points, size, target_size)
    columns, rows = np.flatnonzero((away == 0).any(axis=0)), np.flatnonzero((away == 0).any(axis=1))
    # one cell more on every side still counts as touching it
    assert (PIXELS.xs[columns[0]], PIXELS.xs[columns[-1]]) == (-1, last[0] + 1)
    assert (PIXELS.ys[rows[0]], PIXELS.ys[rows[-1]]) == (-1, last[1] + 1)


def test_what_lies_behind_the_target_is_outside_and_with_no_overlap_all_is() -> None:
    behind = PIXELS.points.copy()
    behind[:, :7] = np.nan
    away = outside_overlap(PIXELS, behind, (10, 8), (10, 8))
    assert np.isfinite(away).all() and (away[5, :5] > 0).all()
    assert np.isinf(outside_overlap(PIXELS, PIXELS.points + 100, (10, 8), (10, 8))).all()


def test_distances_are_in_pixels_whatever_the_cells() -> None:
    coarse = Grid((-12, -18), 6, 14, 13)
    away = outside_overlap(coarse, coarse.points, (48, 30), (48, 30))
    assert away.max() > 12 and np.allclose(away[away > 0].min(), 6 * (np.sqrt(2) - 1))


def test_its_width_is_five_times_what_nearly_all_matches_are_moved_by_but_eight_of_their_unit() -> None:
    moved = np.r_[np.full(99, 20.0), 1e4]  # one that is wrong does not count
    assert fade_width(moved, 1.0) == pytest.approx(100)
    assert fade_width(np.zeros(50), 1.0) == 8 and fade_width(np.full(50, 1.0), 3.0) == 24


def test_a_spline_on_nodes_is_the_spline_at_their_pixels() -> None:
    random = np.random.default_rng(0)
    points = random.uniform(0, 10, (20, 2))
    for values in (random.normal(size=20), random.normal(size=(20, 3))):
        spline, _ = SmoothingProblem.build(points, np.ones(20), 10.0).solve(values, 1e-4)
        expected = spline.at(PIXELS.points.reshape(-1, 2)).reshape(13, 14, *values.shape[1:])
        assert np.abs(on_nodes(spline, PIXELS, None) - expected).max() < 1e-4
        bent = PIXELS.points + (0.5, -0.25)
        moved = spline.at(bent.reshape(-1, 2)).reshape(13, 14, *values.shape[1:])
        assert np.array_equal(on_nodes(spline, PIXELS, bent), moved)
