"""What arrays are asked for, whatever their memory looks like."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.raster.arrays import angle_of, cut, eroded
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_an_angle_has_the_same_bytes_from_call_to_call(kind: type) -> None:
    random = np.random.default_rng(0)
    rays = random.normal(size=(40_000, 3)).astype(kind)
    between: list[np.ndarray] = []  # so that memory is another one from call to call
    found = set()
    for _ in range(200):
        between = [*between[-20:], np.empty(random.integers(1, 60_000))]
        x, _, z = rays.copy().T
        found.add(angle_of(x, z).tobytes())
    assert len(found) == 1
    (angles,) = (np.frombuffer(one, kind) for one in found)
    np.testing.assert_allclose(np.tan(angles), rays[:, 0] / rays[:, 2], rtol=1e-2 if kind is np.float32 else 1e-6)


def test_an_angle_of_single_numbers_is_one() -> None:
    assert angle_of(np.float64(1), np.float64(-1)) == pytest.approx(0.75 * np.pi)


def test_a_part_of_a_canvas_takes_no_memory_unless_it_reaches_over_the_edges() -> None:
    canvas = np.arange(60.0).reshape(6, 10)
    part = cut(canvas, (2, 1, 5, 4))
    assert np.shares_memory(part, canvas) and (part == canvas[1:5, 2:7]).all()
    wider = cut(canvas, (8, -1, 4, 3), beyond=-7)
    assert (wider[1:, :2] == canvas[:2, 8:]).all() and (wider[0] == -7).all() and (wider[:, 2:] == -7).all()


@given(seed=st.integers(0, 2**16), margin=st.integers(0, 4))
def test_a_mask_is_eroded_by_what_lies_outside_it_and_by_the_edges(seed: int, margin: int) -> None:
    mask = np.random.default_rng(seed).random((9, 12)) < 0.9
    padded = np.pad(mask, margin)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (2 * margin + 1,) * 2)
    assert np.array_equal(eroded(mask, margin), windows.all(axis=(2, 3)))
