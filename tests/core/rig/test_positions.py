"""Places from directions alone, and points from places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.bodies import Bodies
from edf_stitch.core.rig.averaging.averaged import PairGeometry
from edf_stitch.core.rig.averaging.turns import rotations
from edf_stitch.core.rig.bundling.polishing import start, total_cost
from edf_stitch.core.rig.bundling.positions import place_pictures
from edf_stitch.core.rig.bundling.reprojection import lengths_of_errors
from edf_stitch.core.rig.bundling.solution import LENS, Problem, Solution, lenses_of
from edf_stitch.core.rig.bundling.tracks import build_tracks
from edf_stitch.core.rig.bundling.triangulation import triangulate

from .rigs import SyntheticRig, make_rig


def problem_of(rig: SyntheticRig) -> tuple[Problem, Solution]:
    """With the right matches alone, and the true rotations and lens."""
    count = len(rig.cameras)
    pairs = [
        PairGeometry(
            pair.i, pair.j, rig.true_matches(pair), len(pair), len(pair), np.eye(3), np.array([1.0, 0, 0]),
            np.eye(3) * 1e6, 0.5, 5.0, -1.0, False, 0.0,
        )
        for pair in rig.matches
    ]  # fmt: skip
    tracks = build_tracks(pairs, rig.points, range(count))
    held, alone = np.zeros(count, bool), Bodies.alone(count)
    problem = Problem(tracks, lenses_of(rig.cameras), 1.0, 0.5, np.arange(count), held, alone)
    lens = np.zeros((1, LENS))
    lens[0, 0] = np.log(rig.focal / rig.cameras[0].focal)
    return problem, start(problem, rig.R, lens)


def off(found: np.ndarray, rig: SyntheticRig) -> np.ndarray:
    """Metres between places after the best shift and scale: rotations are true."""
    true = rig.centres - rig.centres.mean(axis=0)
    mine = found - found.mean(axis=0)
    return np.linalg.norm(mine * (mine * true).sum() / (mine**2).sum() - true, axis=1)


@pytest.mark.parametrize("kind", ["ring", "street", "grid", "mixed"])
def test_places_come_from_nothing(kind: str) -> None:
    rig = make_rig(kind, 5, points=4000)
    problem, begun = problem_of(rig)
    assert not begun.centres.any()
    placed = place_pictures(problem, begun)
    assert off(placed.centres, rig).max() < 0.08 * rig.extent
    assert placed.behind < 0.02


def test_rotations_may_be_off() -> None:
    rig = make_rig("ring", 6)
    problem, begun = problem_of(rig)
    turned = rotations(np.random.default_rng(0).normal(0, np.radians(0.15), (11, 3)))
    placed = place_pictures(problem, replace(begun, R=turned @ begun.R))
    assert off(placed.centres, rig).max() < 0.2 * rig.extent


def test_pictures_of_one_place_get_one() -> None:
    rig = make_rig("half", 2, points=4000)
    problem, begun = problem_of(rig)
    placed = place_pictures(problem.with_stations([tuple(range(6))]), begun).centres
    np.testing.assert_allclose(placed[:6], np.tile(placed[0], (6, 1)), atol=1e-9)
    assert off(placed, rig).max() < 0.2 * rig.extent


@pytest.mark.parametrize("seed", [2, 3])
def test_points_that_one_place_sees_measure_no_depth_though_its_rotations_are_off(seed: int) -> None:
    rig = make_rig("half", seed, points=4000)
    problem, begun = problem_of(rig)
    turned = rotations(np.random.default_rng(seed).normal(0, np.radians(0.15), (11, 3)))
    placed = place_pictures(problem.with_stations([tuple(range(6))]), replace(begun, R=turned @ begun.R))
    assert off(placed.centres, rig).max() < 0.12 * rig.extent


def test_triangulation_finds_what_was_seen() -> None:
    rig = make_rig("ring", 0, points=3000, noise_px=0.0)
    problem, begun = problem_of(rig)
    placed = replace(begun, centres=rig.centres).seen_from(0).rescaled()
    assert np.nanmax(lengths_of_errors(problem, triangulate(problem, placed))) < 1e-3


def test_points_behind_start_at_infinity() -> None:
    """Noise puts points behind cameras that are next to each other; the bundle would not bring them all back."""
    rig = make_rig("half", 1, points=2000)
    problem, begun = problem_of(rig)
    found = triangulate(problem, replace(begun, centres=rig.centres).seen_from(8).rescaled())
    assert (found.inverse_ranges[found.solved] >= 0).all()
    assert (found.inverse_ranges[found.solved] == 0).mean() > 0.1


def test_a_point_needs_two_views() -> None:
    rig = make_rig("ring", 0, points=2000)
    problem, begun = problem_of(rig)
    used = begun.used.copy()
    used[problem.tracks.starts[0]] = problem.tracks.starts[1] - problem.tracks.starts[0] != 2
    found = triangulate(problem, replace(begun, centres=rig.centres, used=used))
    assert found.solved[0] == used[problem.tracks.starts[0]] and found.solved[1:].all()


def test_a_wrong_view_does_not_draw_a_point_away_that_one_place_sees() -> None:
    """Of three views two agree."""
    rig = make_rig("tripod", 0, points=1500, noise_px=0.0, outliers=0.0)
    problem, begun = problem_of(rig)
    problem = problem.with_stations([tuple(range(problem.pictures))])
    tracks = problem.tracks
    k = int(np.flatnonzero(np.diff(tracks.starts) == 3)[0])
    pixels = tracks.pixels.copy()
    pixels[tracks.starts[k]] += 150.0
    disturbed = replace(problem, tracks=replace(tracks, pixels=pixels))
    true, found = (triangulate(one, begun).rays[k] for one in (problem, disturbed))
    assert np.degrees(np.arccos(min(1.0, float(true @ found)))) < 0.1


def test_places_that_are_one_but_for_rounding_measure_no_depth() -> None:
    rig = make_rig("tripod", 0, points=1500)
    problem, begun = problem_of(rig)
    centres = rig.centres - rig.centres[0]
    centres[:4] = centres[0] + 1e-9 * np.arange(12).reshape(4, 3)
    centres[4:] += [[1.0, 0, 0]]
    found = triangulate(problem, replace(begun, centres=centres))
    assert found.inverse_ranges.max() < 1e5


def test_a_view_far_off_costs_the_same_whether_its_point_is_solved_or_not() -> None:
    rig = make_rig("tripod", 0, points=1500, noise_px=0.0, outliers=0.0)
    problem, begun = problem_of(rig)
    problem = problem.with_stations([tuple(range(problem.pictures))])
    tracks = problem.tracks
    k = int(tracks.starts[np.flatnonzero(np.diff(tracks.starts) == 3)[0]])
    pixels = tracks.pixels.copy()
    pixels[k] += 150.0
    disturbed = replace(problem, tracks=replace(tracks, pixels=pixels))
    of_this = tracks.point == tracks.point[k]
    whole, solved, unsolved = (
        total_cost(one, triangulate(one, replace(begun, used=begun.used & used)))
        for one, used in ((problem, True), (disturbed, True), (disturbed, ~of_this))
    )
    assert solved - whole > 1 and unsolved - whole == pytest.approx(3 * (solved - whole), rel=0.02)
