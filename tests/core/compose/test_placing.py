"""By how much pictures are expected to be misplaced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.compose import placing as placing_module
from edf_stitch.core.compose.options import PLACING
from edf_stitch.core.compose.placing import Placing, adding_order
from edf_stitch.core.compose.window import window_of
from hypothesis import given, settings
from hypothesis import strategies as st

from .rings import CANVAS, FOCAL, HEIGHT, RING, SPHERE, WIDTH, layers_of, views_at, wall, warp_of

COORDINATE = st.floats(-1, 1)


@settings(deadline=None, max_examples=30)
@given(st.tuples(COORDINATE, COORDINATE, COORDINATE), st.integers(0, WIDTH - 1), st.integers(60, HEIGHT - 60))
def test_what_is_expected_is_what_an_error_of_inverse_range_does(
    centre: tuple[float, float, float], column: int, row: int
) -> None:
    """The picture is fetched where it would see a ray at inverse range d. What it sees there lies at d + δ: by how many
    px of the canvas beside the ray, seen at a right angle?"""
    d, error, c = 0.2, 1e-4, np.array(centre)
    ray = SPHERE.rays(np.array([CANVAS.xs[column], CANVAS.ys[row]]))
    sight = ray / d - c
    sight /= np.linalg.norm(sight)
    along = -sight @ c + np.sqrt((sight @ c) ** 2 - c @ c + 1 / (d + error) ** 2)
    seen = c + along * sight
    moved = FOCAL * np.linalg.norm(seen / np.linalg.norm(seen) - ray) * (sight @ ray)
    placing = Placing(warp_of(depth=d, deviation=error), views_at([c]))
    found = float(placing.at(0, (slice(row, row + 1), slice(column, column + 1)))[0, 0])
    assert found == pytest.approx(moved, rel=0.01, abs=1e-5)


def test_the_nearest_to_the_viewpoint_comes_first() -> None:
    away = [0.3, 0.0, 0.9, 0.1, 0.5, 0.0, 0.2]
    views = views_at([[0, size, 0] for size in away])
    layers = layers_of([wall()] * 7)
    for deviation in (None, 0.01):
        placing = Placing(warp_of(deviation=deviation), views)
        windows = [window_of(CANVAS, layer.alpha) for layer in layers]
        assert adding_order(placing, layers, windows) == [1, 5, 3, 6, 0, 4, 2]
        assert adding_order(placing, layers, [*windows[:3], None, *windows[4:]]) == [1, 5, 6, 0, 4, 2]


def test_what_is_looked_at_more_coarsely_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    placing = Placing(warp_of(depth=0.2, deviation=0.01), views_at([[0.3, 0.2, 0.1]]))
    part = slice(100, 203), slice(50, 333)
    whole = placing.at(0, part, 8)
    assert np.allclose(whole, placing.at(0, part)[::8, ::8], rtol=1e-5)
    monkeypatch.setattr(placing_module, "PLACING", replace(PLACING, whole_px=0))
    assert np.array_equal(placing.at(0, part, 8), whole), "line by line"


def test_a_step_towards_what_is_seen_misplaces_nothing() -> None:
    first, width = RING[3]
    column, row = first + width // 2, HEIGHT // 2
    ahead = SPHERE.rays(np.array([CANVAS.xs[column], CANVAS.ys[row]]))
    placing = Placing(warp_of(depth=0.1, deviation=1.0), views_at([0.5 * ahead, [0, 0.5, 0]]))
    here = (slice(row, row + 1), slice(column, column + 1))
    assert placing.at(0, here)[0, 0] < 0.01 * placing.at(1, here)[0, 0]
