"""What is said to be hidden is held against each camera's depth, where that tells."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.synthetic_scenes.sets.set_hidden import certain, hidden_figures
from edf_stitch.synthetic_scenes.sets.set_measures import Found, SetTruth

from .perfect_stitch import analytic_truth, perfect


@pytest.fixture(scope="module")
def truth() -> SetTruth:
    return analytic_truth()


def test_what_is_said_to_be_hidden_is_held_against_each_cameras_depth(truth: SetTruth) -> None:
    result = perfect(truth)
    found = Found.of(result, truth)
    nothing = hidden_figures(found)
    assert np.isnan(nothing["hidden_precision"]) and nothing["hidden_recall"] == nothing["hidden_recall_all"] == 0
    at = np.rint(found.on_maps().reshape(-1, 2)).astype(int)
    for order in range(3):
        seen = truth.seen[order]
        x, y = at[seen.index[~seen.visible]].T
        result.occluded[order][y % 283, x % 565] = True
    figures = hidden_figures(found)
    assert figures["hidden_recall"] > 0.99 and figures["hidden_recall_all"] > 0.99
    assert figures["hidden_precision"] > 0.9
    for order in range(3):
        result.occluded[order][:] = True
    figures = hidden_figures(found)
    assert figures["hidden_recall"] == 1 and figures["hidden_precision"] < 0.2


def test_what_no_other_picture_sees_is_asked_for_apart(truth: SetTruth) -> None:
    result = perfect(truth, numbers=(1,))
    figures = hidden_figures(Found.of(result, truth))
    assert np.isnan(figures["hidden_recall"]) and figures["hidden_recall_all"] == 0


def test_beside_an_outline_the_depth_tells_nothing() -> None:
    depth = np.full((5, 8), 4.0, np.float32)
    depth[:, 3:5] = 2.0
    pixels = np.array([[1.5, 2.0], [2.5, 2.0], [3.5, 2.0], [3.5, 2.0], [4.5, 2.0]])
    hidden, seen = certain(pixels, np.array([4.0, 4.0, 4.0, 2.0, 4.0]), depth)
    assert hidden.tolist() == [False, False, True, False, False], "behind the bar of four pixels alike"
    assert seen.tolist() == [True, False, False, True, False], "beside its outline neither"
