"""The bundle: its derivatives, what it holds, where it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.raster.arrays import Array
from edf_stitch.core.rig.averaging.turns import degrees_between, rotations
from edf_stitch.core.rig.bundling import bundle as bundling
from edf_stitch.core.rig.bundling.bundle import DepthPrior, Settings, bundle
from edf_stitch.core.rig.bundling.bundle_options import BUNDLE
from edf_stitch.core.rig.bundling.reprojection import CAMERA, derivatives, lengths_of_errors, reproject, tangents
from edf_stitch.core.rig.bundling.solution import LENS
from hypothesis import given, settings
from hypothesis import strategies as st

from .bundle_scenes import believed_cameras, bundled_scene, disturbed

SEEDS = st.integers(0, 10_000)


@settings(max_examples=20)
@given(SEEDS)
def test_derivatives_are_those_of_finite_differences(seed: int) -> None:
    problem, true = bundled_scene(seed, k1=0.08 * (-1) ** seed)
    at = disturbed(true, seed)
    everything = np.arange(len(problem.tracks.point))
    bases = tangents(at.rays)
    seen = reproject(problem, at, everything)
    by_camera, by_point = derivatives(problem, at, seen, bases)
    step = 1e-6
    for parameter in range(CAMERA):
        change = np.zeros((problem.pictures, CAMERA))
        change[:, parameter] = step
        moved = replace(
            at, R=rotations(change[:, :3]) @ at.R, centres=at.centres + change[:, 3:6], lens=at.lens + change[:1, 6:]
        )
        by_steps = (reproject(problem, moved, everything).errors - seen.errors) / step
        np.testing.assert_allclose(by_camera[:, :, parameter], by_steps, atol=2e-2, rtol=1e-4)
    for parameter in range(3):
        change = np.zeros(3)
        change[parameter] = step
        rays = at.rays + bases @ change[:2]
        moved = replace(at, rays=rays, inverse_ranges=at.inverse_ranges + change[2])
        by_steps = (reproject(problem, moved, everything).errors - seen.errors) / step
        np.testing.assert_allclose(by_point[:, :, parameter], by_steps, atol=2e-2, rtol=1e-4)


@settings(max_examples=20)
@given(SEEDS, st.integers(3, 6))
def test_without_noise_the_truth_is_found(seed: int, pictures: int) -> None:
    # k1 and the principal point are drawn to 0 by their priors: here they are
    problem, true = bundled_scene(seed, pictures, k1=0.0)
    true = replace(true, lens=np.zeros((1, LENS)))
    pixels = problem.tracks.pixels + reproject(problem, true, np.arange(len(problem.tracks.point))).errors
    problem = replace(problem, tracks=replace(problem.tracks, pixels=pixels))
    found = bundle(problem, disturbed(true, seed), Settings(iterations=100, tolerance=1e-14), 0).solution.rescaled()
    assert np.nanmax(lengths_of_errors(problem, found)) < 1e-3
    assert degrees_between(found.R, true.R).max() < 1e-3


def test_what_lies_behind_pulls_nothing() -> None:
    problem, true = bundled_scene(3, noise_px=0.3)
    behind = replace(true, rays=true.rays * np.where(np.arange(60) == 7, -1.0, 1.0)[:, None])
    seen = reproject(problem, behind, np.arange(len(problem.tracks.point)))
    assert seen.behind.reshape(60, -1)[7].all() and seen.behind.sum() == problem.pictures
    apart = replace(behind, used=problem.tracks.point != 7)
    with_it, without = (bundle(problem, s, Settings(), 0).solution for s in (behind, apart))
    np.testing.assert_allclose(with_it.R, without.R, atol=1e-7)


def test_outliers_move_little() -> None:
    """Without the robust cost, a tenth of the observations 60 px off turn cameras by degrees."""
    problem, true = bundled_scene(5, points=200, noise_px=0.3)
    rng = np.random.default_rng(0)
    wrong = rng.random(len(problem.tracks.point)) < 0.1
    pixels = problem.tracks.pixels + np.where(wrong[:, None], rng.uniform(-60, 60, problem.tracks.pixels.shape), 0)
    spoilt = replace(problem, tracks=replace(problem.tracks, pixels=pixels))
    clean, found = (bundle(p, true, Settings(), 0).solution for p in (problem, spoilt))
    assert degrees_between(clean.R, found.R).max() < 0.15
    least_squares = bundle(spoilt, true, Settings(kernel_px=1e4), 0).solution
    assert degrees_between(clean.R, least_squares.R).max() > 0.3


def test_a_fixed_focal_length_stays() -> None:
    problem, true = bundled_scene(2, noise_px=0.3, cameras=believed_cameras(4, log_sigma=0.0))
    found = bundle(problem, disturbed(true, 2), Settings(), 0).solution
    assert found.lens[0, 0] == 0
    assert found.lens[0, 1] != 0


def test_a_whole_camera_that_is_given_stays() -> None:
    cameras = [replace(camera, principal_sigma=0.0) for camera in believed_cameras(4, log_sigma=0.0)]
    problem, true = bundled_scene(2, noise_px=0.3, cameras=cameras)
    found = bundle(problem, disturbed(true, 2), Settings(), 0).solution
    assert not found.lens.any()


def test_each_lens_has_its_own_focal_length() -> None:
    cameras = believed_cameras(2) + believed_cameras(2, focal=900.0)
    problem, true = bundled_scene(4, points=200, noise_px=0.2, cameras=cameras)
    assert problem.lenses.of.tolist() == [0, 0, 1, 1]
    off = np.array([[0.03, 0, 0, 0], [-0.03, 0, 0, 0]])
    found = bundle(problem, replace(disturbed(true, 4), lens=true.lens + off), Settings(), 0).solution
    np.testing.assert_allclose(found.lens[:, 0], true.lens[:, 0], atol=0.01)


def test_given_poses_stay() -> None:
    held = np.array([True, False, True, False])
    problem, true = bundled_scene(6, noise_px=0.3, held=held)
    start_at = disturbed(true, 6)
    found = bundle(problem, start_at, Settings(), 0).solution
    np.testing.assert_array_equal(found.R[held], start_at.R[held])
    np.testing.assert_array_equal(found.centres[held], start_at.centres[held])
    assert (found.centres[~held] != start_at.centres[~held]).all()


def test_pictures_of_one_place_stay_together() -> None:
    problem, true = bundled_scene(7, noise_px=0.3)
    tied = problem.with_stations([(1, 3)])
    centres = true.centres.copy()
    centres[3] = centres[1]
    found = bundle(tied, replace(true, centres=centres), Settings(), 0).solution
    np.testing.assert_array_equal(found.centres[1], found.centres[3])
    assert (found.centres[1] != centres[1]).any()


def test_rotations_alone_leave_all_at_one_place_and_at_infinity() -> None:
    problem, true = bundled_scene(8, noise_px=0.3)
    far = replace(true, centres=np.zeros_like(true.centres), inverse_ranges=np.zeros(60))
    found = bundle(problem, far, Settings(depths=False), 0).solution
    assert not found.centres.any() and not found.inverse_ranges.any()
    assert degrees_between(found.R, true.R)[1:].max() > 0


def test_the_scale_does_not_drift() -> None:
    """A prior of ρ would be the cheaper the larger all places are, at no cost of the observations."""
    problem, true = bundled_scene(9, noise_px=0.3)
    prior = DepthPrior(np.zeros(60), np.full(60, 0.05))
    found = bundle(problem, true, Settings(iterations=30, tolerance=0), 0, prior).solution
    np.testing.assert_allclose(np.linalg.norm(found.centres), np.linalg.norm(true.centres), rtol=0.05)


@pytest.mark.parametrize("sign", [-1, 1])
def test_depths_may_be_negative_on_the_way(sign: int) -> None:
    """ρ is not clamped: from behind infinity a point comes back by itself."""
    problem, true = bundled_scene(10)
    begun = replace(true, inverse_ranges=np.where(np.arange(60) == 5, sign * -0.03, true.inverse_ranges))
    found = bundle(problem, begun, Settings(), 0).solution
    np.testing.assert_allclose(found.inverse_ranges[5], true.inverse_ranges[5], atol=5e-3)


def test_equations_that_are_singular_to_rounding_are_damped(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, true = bundled_scene(0)
    solve = np.linalg.solve
    tried = []

    def singular_once(left: Array, right: Array) -> Array:
        tried.append(len(left))
        if len(tried) == 1:
            raise np.linalg.LinAlgError("Singular matrix")
        return solve(left, right)

    begun = disturbed(true, 0), Settings(2.0, 30, 1e-10), 0
    usual = bundle(problem, *begun)
    monkeypatch.setattr(np.linalg, "solve", singular_once)
    assert bundle(problem, *begun).cost == pytest.approx(usual.cost, rel=1e-6)
    assert len(tried) > 2


def test_whether_to_go_on_is_asked_at_every_step_that_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last iteration tries many that are no better."""
    problem, true = bundled_scene(0, noise_px=0.3)
    tried, asked = [], []

    def no_better(*args: object) -> float:
        tried.append(1)
        return float(len(tried))

    monkeypatch.setattr(bundling, "_cost", no_better)
    bundle(problem, true, Settings(), 0, None, lambda: asked.append(1))
    assert len(asked) >= len(tried) > BUNDLE.tries
