"""What a relief says between its nodes, and that it ends in nothing."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.relief import Relief


@pytest.fixture(params=[1.0, 2.75])
def relief(request: pytest.FixtureRequest) -> Relief:
    """7×9 nodes of numbers, 0 at the rim."""
    values = np.random.default_rng(3).normal(size=(7, 9, 4)).astype(np.float32)
    values[[0, -1]] = values[:, [0, -1]] = 0
    start = (-4.0, 10.0) if request.param == 1 else (-4.3, 10.2)
    return Relief(start, (request.param, request.param), values[..., 0], values[..., 1:3], values[..., 3])


def test_a_plane_is_what_its_nodes_say_linear_between_them_and_nothing_outside(relief: Relief) -> None:
    xs, ys = np.arange(-12.0, 40.0), np.arange(0.0, 40.0)
    for part, (values, name) in zip(
        relief.over(xs, ys), ((relief.inverse_depth, "d"), (relief.shift, "s"), (relief.confidence, "c")), strict=True
    ):
        assert part.dtype == np.float32 and part.shape == (len(ys), len(xs), *values.shape[2:])
        for y, line in zip(ys, part, strict=True):
            v = (y - relief.start[1]) / relief.step[1]
            for x, got in zip(xs, line, strict=True):
                u = (x - relief.start[0]) / relief.step[0]
                if not (0 <= u <= 8 and 0 <= v <= 6):
                    assert not np.any(got), name
                    continue
                i, j = min(int(v), 5), min(int(u), 7)
                p, q = v - i, u - j
                expected = (
                    (1 - p) * ((1 - q) * values[i, j] + q * values[i, j + 1])
                    + p * ((1 - q) * values[i + 1, j] + q * values[i + 1, j + 1])
                )  # fmt: skip
                assert got == pytest.approx(expected, abs=1e-5), name


def test_strips_of_a_plane_are_the_plane(relief: Relief) -> None:
    xs, ys = np.arange(-12.0, 40.0), np.arange(0.0, 40.0)
    whole = relief.over(xs, ys)
    for cut in (3, 11, 17):
        for part, first, second in zip(whole, relief.over(xs, ys[:cut]), relief.over(xs, ys[cut:]), strict=True):
            assert np.array_equal(part, np.concatenate([first, second]))


def test_scattered_points_get_the_same(relief: Relief) -> None:
    """To the 1/32 of a node that OpenCV's interpolation is good for."""
    xs, ys = np.arange(-2.0, 15.0), np.arange(12.0, 24.0)
    for plane, points in zip(relief.over(xs, ys), relief.at(*np.meshgrid(xs, ys)), strict=True):
        assert np.abs(plane - points).max() < (1e-6 if relief.step[0] == 1 else 0.15)
