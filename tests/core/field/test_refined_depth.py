"""What dense refinement adds: exact on its nodes, linear between them, nothing beyond them."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.field import refined_depth
from edf_stitch.core.field.options import RefinedOptions
from edf_stitch.core.field.refined_depth import RefinedDepth

START, STEP = (3.0, -4.0), (2.0, 2.5)  # px of the first node, px from each to the next
COLUMNS, ROWS = 7, 5


def random_depth(start: tuple[float, float] = START, step: tuple[float, float] = STEP) -> RefinedDepth:
    random = np.random.default_rng(0)
    depth, confidence = random.uniform(0.5, 1, (2, ROWS, COLUMNS)).astype(np.float32)
    return RefinedDepth(start, step, depth, random.uniform(1, 2, (ROWS, COLUMNS, 2)).astype(np.float32), confidence)


def sloping(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.5 * x - 0.2 * y + 3.0


def sloping_depth() -> RefinedDepth:
    """A function of reference px that is affine, so that linear interpolation has it exactly."""
    x, y = np.meshgrid(START[0] + STEP[0] * np.arange(COLUMNS), START[1] + STEP[1] * np.arange(ROWS))
    d = sloping(x, y).astype(np.float32)
    return RefinedDepth(START, STEP, d, np.stack([2 * d, -d], axis=-1), 3 * d)


def crossings(refined: RefinedDepth, xs: np.ndarray, ys: np.ndarray) -> tuple[np.ndarray, ...]:
    """Both ways to ask, which have to agree; OpenCV rounds places to 1/32 of a node."""
    at, over = refined.at(*np.meshgrid(xs, ys)), refined.over(xs, ys)
    for one, other in zip(at, over, strict=True):
        assert one.shape == other.shape and np.abs(one - other).max() < 0.1
    return over


def test_on_its_nodes_it_is_what_they_say() -> None:
    refined = random_depth()
    xs, ys = START[0] + STEP[0] * np.arange(COLUMNS), START[1] + STEP[1] * np.arange(ROWS)
    depth, shift, confidence = crossings(refined, xs, ys)
    assert np.array_equal(depth, refined.inverse_depth)
    assert np.array_equal(shift, refined.shift) and np.array_equal(confidence, refined.confidence)


def test_where_nodes_are_pixels_a_part_is_cut_out() -> None:
    refined = random_depth((10.0, 20.0), (1.0, 1.0))
    depth, shift, confidence = crossings(refined, np.arange(12.0, 16), np.arange(21.0, 23))
    assert np.array_equal(depth, refined.inverse_depth[1:3, 2:6])
    assert np.array_equal(shift, refined.shift[1:3, 2:6]) and np.array_equal(confidence, refined.confidence[1:3, 2:6])


@pytest.mark.parametrize("spacing", [0.3, 1.0, 3.1])
def test_between_its_nodes_it_is_linear(spacing: float) -> None:
    xs = np.arange(START[0], START[0] + STEP[0] * (COLUMNS - 1), spacing)
    ys = np.arange(START[1] + 0.7, START[1] + STEP[1] * (ROWS - 1), spacing)
    depth, shift, confidence = crossings(sloping_depth(), xs, ys)
    expected = sloping(xs[None, :], ys[:, None])
    assert np.abs(depth - expected).max() < 1e-5
    assert np.abs(shift - np.stack([2 * expected, -expected], axis=-1)).max() < 1e-5
    assert np.abs(confidence - 3 * expected).max() < 1e-5


@pytest.mark.parametrize("beside", [(1, 0), (-1, 0), (0, 1), (0, -1)], ids=["right", "left", "below", "above"])
def test_beyond_its_nodes_nothing_is_added(beside: tuple[int, int]) -> None:
    """Half of what is asked for lies on the nodes, half beside them; further away there is nothing at all."""
    refined = random_depth()
    wide, high = STEP[0] * (COLUMNS - 1), STEP[1] * (ROWS - 1)
    xs = START[0] + beside[0] * wide / 2 + np.linspace(0, wide, 13)
    ys = START[1] + beside[1] * high / 2 + np.linspace(0, high, 11)
    inside = ((xs >= START[0]) & (xs <= START[0] + wide)) & ((ys >= START[1]) & (ys <= START[1] + high))[:, None]
    assert 0 < inside.sum() < inside.size
    for part in crossings(refined, xs, ys):
        shown = part if part.ndim == 2 else part.all(axis=-1)
        assert np.array_equal(shown != 0, inside)
    for part in crossings(refined, xs + 2 * beside[0] * wide, ys + 2 * beside[1] * high):
        assert not part.any()


def test_one_line_or_one_column_of_nodes_is_enough() -> None:
    """At their own px; beside them there is nothing to be linear between."""
    refined = random_depth()
    line = RefinedDepth(START, STEP, refined.inverse_depth[:1], refined.shift[:1], refined.confidence[:1])
    xs = START[0] + STEP[0] * np.arange(COLUMNS)
    assert np.array_equal(line.at(xs[None], np.full((1, COLUMNS), START[1]))[0], refined.inverse_depth[:1])


def test_many_nodes_are_sampled_value_by_value_and_just_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    refined = random_depth()
    places = np.meshgrid(np.linspace(2.0, 16.0, 29), np.linspace(-5.0, 7.0, 23))
    together = refined.at(*places)
    monkeypatch.setattr(refined_depth, "REFINED", RefinedOptions(together_nodes=0))
    for one, other in zip(together, refined.at(*places), strict=True):
        assert one.shape == other.shape and np.array_equal(one, other)
