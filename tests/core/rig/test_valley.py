"""Other minima along an unsure focal length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.rig.bundling import valley
from edf_stitch.core.rig.bundling.polishing import Polished, polish, total_cost
from edf_stitch.core.rig.bundling.reprojection import reproject
from edf_stitch.core.rig.bundling.solution import Problem, Solution
from edf_stitch.core.rig.bundling.valley import lowest

from .bundle_scenes import believed_cameras, bundled_scene, disturbed


def _far(log_sigma: float = 0.05) -> tuple[Problem, Solution]:
    """Three pictures of what is two hundred times as far as in other scenes, and the truth."""
    cameras = believed_cameras(3, log_sigma)
    problem, near = bundled_scene(6, pictures=3, points=200, k1=-0.05, cameras=cameras)
    true = replace(near, inverse_ranges=near.inverse_ranges * 0.005)
    moved = reproject(problem, true, np.arange(len(problem.tracks.point))).errors
    noise = np.random.default_rng(2).normal(0, 0.42, moved.shape)
    pixels = problem.tracks.pixels + moved + noise
    return replace(problem, tracks=replace(problem.tracks, pixels=pixels)), true


def _found(problem: Problem, true: Solution) -> Polished:
    """From a start with too long a focal length and bent the other way."""
    lens = true.lens + np.where(problem.lenses.free, [0.08, 0.05, 0, 0], 0)
    return polish(problem, replace(disturbed(true, 2, 0.003), lens=lens), lambda: None)


def test_a_deeper_hollow_of_the_valley_is_found() -> None:
    problem, true = _far()
    found = _found(problem, true)
    low = lowest(found, lambda: None)
    before, after = (total_cost(problem, one.solution, 0.5) for one in (found, low))
    assert after < 0.95 * before
    off = [abs(one.solution.lens[0, 0] - true.lens[0, 0]) for one in (found, low)]
    assert off[1] < 0.5 * off[0]


def test_nothing_is_tried_where_the_focal_length_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, true = _far(log_sigma=0.0)
    found = _found(problem, true)
    monkeypatch.setattr(valley, "polished_on", lambda *_: pytest.fail("tried"))
    assert lowest(found, lambda: None) is found
