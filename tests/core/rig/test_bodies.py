"""Views of a sphere turn and move as one in every stage of a rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.bodies import Bodies, bodies_of
from edf_stitch.core.cameras.camera import Camera, ViewOf
from edf_stitch.core.rig.averaging.graph import components, heaviest_component
from edf_stitch.core.rig.averaging.turns import degrees_between, rotations
from edf_stitch.core.rig.bundling.bundle import Settings, bundle
from edf_stitch.core.rig.bundling.reprojection import reproject
from edf_stitch.core.rig.bundling.solution import Problem, Solution

from .bundle_scenes import bundled_scene, disturbed


def scene_with_a_body() -> tuple[Problem, Solution]:
    """Pictures 1 and 2 are views from one place; the solution is true."""
    problem, solution = bundled_scene(3, pictures=5)
    R = np.tile(np.eye(3), (5, 1, 1))
    R[2] = solution.R[2] @ solution.R[1].T
    bodies = Bodies(np.array([0, 1, 1, 3, 4]), R)
    centres = solution.centres.copy()
    centres[2] = centres[1]
    solution = replace(solution, centres=centres)
    problem = replace(problem, place=bodies.of, bodies=bodies)
    pixels = problem.tracks.pixels
    errors = reproject(problem, solution, np.arange(len(pixels))).errors
    return replace(problem, tracks=replace(problem.tracks, pixels=pixels + errors)), solution


@pytest.mark.parametrize("reference", [0, 2])
def test_the_bundle_keeps_a_body_rigid_and_finds_the_truth(reference: int) -> None:
    problem, true = scene_with_a_body()
    begun = disturbed(true, 5)
    # the reference's pose is held where it is: there the start is the truth
    turned = problem.bodies.made_rigid(begun.R)
    centres = begun.centres.copy()
    centres[2] = centres[1]
    still = problem.bodies.members(reference)
    turned[still], centres[still] = true.R[still], true.centres[still]
    found = bundle(problem, replace(begun, R=turned, centres=centres), Settings(), reference).solution
    assert np.allclose(found.R[2] @ found.R[1].T, problem.bodies.between(1, 2), atol=1e-12)
    assert np.array_equal(found.centres[1], found.centres[2])
    scale = np.linalg.norm(true.centres[4] - true.centres[1]) / np.linalg.norm(found.centres[4] - found.centres[1])
    assert degrees_between(found.R, true.R).max() < 0.03, "what priors of the lens bend"
    off = scale * (found.centres - found.centres[reference]) - (true.centres - true.centres[reference])
    assert np.abs(off).max() < 2e-3


def test_stations_take_whole_bodies() -> None:
    problem, _ = scene_with_a_body()
    assert problem.with_stations([]).place.tolist() == [0, 1, 1, 3, 4]
    assert problem.with_stations([(2, 4)]).place.tolist() == [0, 1, 1, 3, 1]
    assert problem.with_stations([(0, 1), (2, 4)]).place.tolist() == [0, 0, 0, 3, 0]


def test_a_body_hangs_together_and_counts_as_one() -> None:
    bodies = [0, 0, 0, 0, 4, 5]
    assert components(6, [(4, 5)], bodies) == [[4, 5], [0, 1, 2, 3]]
    assert components(6, [(1, 4), (3, 5)], bodies)[0] == [0, 1, 2, 3, 4, 5]
    assert heaviest_component(6, [(4, 5)], [30.0], bodies) == [4, 5]


def test_rotations_of_a_body_are_brought_together() -> None:
    rng = np.random.default_rng(0)
    known, world = rotations(rng.normal(0, 1, (4, 3))), rotations(rng.normal(0, 1, 3))
    cameras = [Camera(np.eye(3), (9, 9), "", 0.0, view_of=ViewOf(7, "s", R)) for R in known[:3]]
    bodies = bodies_of([*cameras, Camera(np.eye(3), (9, 9), "", 0.0)])
    assert bodies.of.tolist() == [0, 0, 0, 3] and bodies.pairs == [(0, 1), (0, 2), (1, 2)]
    seen = np.concatenate([rotations(rng.normal(0, 1e-3, (3, 3))) @ known[:3] @ world, known[3:]])
    rigid = bodies.made_rigid(seen)
    assert np.allclose(rigid[1] @ rigid[0].T, known[1] @ known[0].T) and np.array_equal(rigid[3], seen[3])
    assert degrees_between(rigid[:3], known[:3] @ world).max() < np.degrees(2e-3)
