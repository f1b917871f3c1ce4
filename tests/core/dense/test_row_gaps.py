"""Gaps beside near things are filled from their far side, others are left alone."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.dense.row_gaps import hidden_gaps

NAN = np.nan


def filled(row: list[float], nearer: float = 1.0) -> list[float]:
    given = np.array([row], np.float32)
    values, mask = hidden_gaps(np.nan_to_num(given), np.isfinite(given), nearer)
    assert not mask[np.isfinite(given)].any(), "what was found stays"
    return np.where(mask | np.isfinite(given), values, np.float32(NAN))[0].tolist()


def test_what_a_near_thing_hides_goes_on_from_its_far_side() -> None:
    """As wide as disparity jumps: 8 px for near things that move right, or the other way around."""
    gap = [NAN] * 8
    assert filled([1, 1, *gap, 9, 9]) == [1] * 10 + [9, 9]
    assert filled([1, 1, *gap, 9, 9], nearer=-1.0) == [1, 1] + [9] * 10


@pytest.mark.parametrize("row", [
    [9, 9, *[NAN] * 8, 1, 1],  # the side on which the target shows more, not less
    [1, 1, *[NAN] * 20, 9, 9],  # wider than what could be hidden
    [1, 1, *[NAN] * 4, 2, 2],  # no jump
    [NAN, NAN, 1, 1, NAN],  # the picture's ends
])  # fmt: skip
def test_other_gaps_stay(row: list[float]) -> None:
    np.testing.assert_array_equal(filled(row), row)
