"""The end of polishing: a kernel as wide as the noise, and where it is not taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from edf_stitch.core.rig.averaging.turns import degrees_between
from edf_stitch.core.rig.bundling.polishing import Polished, polish, sharpened
from edf_stitch.core.rig.bundling.solution import Problem, Solution

from .bundle_scenes import bundled_scene, disturbed


def _polished(shifted_px: float, share: float, of: int) -> tuple[Problem, Solution, Polished]:
    """The problem, the truth, and what is found where a share of what the pictures from a number on see is shifted."""
    problem, true = bundled_scene(4, points=300, noise_px=0.05, k1=0.0)
    tracks = problem.tracks
    wrong = (tracks.picture >= of) & (np.random.default_rng(1).random(len(tracks.point)) < share)
    problem = replace(problem, tracks=replace(tracks, pixels=tracks.pixels + wrong[:, None] * [0, shifted_px]))
    return problem, true, polish(problem, disturbed(true, 4, 0.002), lambda: None)


def _off(found: Polished, true: Solution) -> float:
    """The most that pictures are turned, degrees, by the first one."""
    solution = found.solution.seen_from(0)
    return float(degrees_between(solution.R, true.R).max())


def test_matches_that_are_a_little_wrong_turn_nothing() -> None:
    _, true, wide = _polished(1.6, 0.3, 2)
    assert _off(sharpened(wide, lambda: None), true) < 0.3 * _off(wide, true)


def test_a_narrow_kernel_that_loses_a_part_of_a_picture_is_not_taken() -> None:
    """Half of what some pictures show says that they stand otherwise: in the middle between all of it fits."""
    _, _, wide = _polished(2.4, 0.5, 2)
    assert sharpened(wide, lambda: None) is wide


def test_a_picture_that_fitted_nothing_before_loses_nothing() -> None:
    problem, _, wide = _polished(0.0, 0.0, 4)
    tracks = problem.tracks
    pixels = tracks.pixels + np.where(tracks.picture == 3, 1e3, 0)[:, None]
    found = replace(wide, problem=replace(problem, tracks=replace(tracks, pixels=pixels)))
    assert sharpened(found, lambda: None) is not found


def test_what_has_no_observations_stays() -> None:
    problem, _, wide = _polished(0.0, 0.0, 4)
    unseen = replace(wide, solution=replace(wide.solution, used=np.zeros(len(problem.tracks.point), bool)))
    assert sharpened(unseen, lambda: None) is unseen
