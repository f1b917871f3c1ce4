"""Other minima along an unsure focal length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.rig.bundling import valley
from edf_stitch.core.rig.bundling.polishing import Polished, polish
from edf_stitch.core.rig.bundling.reprojection import reproject
from edf_stitch.core.rig.bundling.solution import LENS, Problem, Solution
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


@pytest.mark.parametrize(("bottom", "found_at"), [(-0.07, -0.06), (0.04, 0.03), (0.4, 0.09), (0.01, 0.0)])
def test_it_goes_down_the_valley(monkeypatch: pytest.MonkeyPatch, bottom: float, found_at: float) -> None:
    """In steps of .03, three at most each way, from where the bundle ended."""
    problem, true = _far()
    found = _found(problem, true)
    begun = replace(found, solution=replace(true, lens=np.zeros((1, LENS))), behind=0.0)
    monkeypatch.setattr(valley, "_unsure", lambda _: True)
    monkeypatch.setattr(
        valley, "polished_on", lambda problem, solution, tick: replace(begun, problem=problem, solution=solution)
    )
    monkeypatch.setattr(valley, "_cost", lambda found: 1 + (found.solution.lens[0, 0] - bottom) ** 2 * 1e3)
    assert lowest(begun, lambda: None).solution.lens[0, 0] == pytest.approx(found_at)


def test_what_puts_points_beyond_infinity_is_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is tried again with points anew; here that changes nothing."""
    begun = _found(*_far())
    monkeypatch.setattr(valley, "_unsure", lambda _: True)
    for name in ("polished_on", "polish"):
        monkeypatch.setattr(
            valley, name, lambda problem, solution, tick: replace(begun, solution=solution, behind=begun.behind + 0.3)
        )
    monkeypatch.setattr(valley, "_cost", lambda found: 1 + abs(found.solution.lens[0, 0] - 1))
    assert lowest(begun, lambda: None) is begun


def test_few_pictures_of_what_is_far_are_unsure_and_near_ones_are_not() -> None:
    far = _found(*_far())
    near, true = bundled_scene(6, pictures=8, points=400, noise_px=0.05)
    assert valley._unsure(far) and not valley._unsure(polish(near, true, lambda: None))


def test_nothing_is_tried_where_the_focal_length_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, true = _far(log_sigma=0.0)
    found = _found(problem, true)
    monkeypatch.setattr(valley, "polished_on", lambda *_: pytest.fail("tried"))
    assert lowest(found, lambda: None) is found
