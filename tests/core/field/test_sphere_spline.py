"""Splines on the sphere: what they reproduce, how they predict, and that small angles give the planar spline."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from edf_stitch.core.field.sphere_options import SPHERE
from edf_stitch.core.field.sphere_spline import SphereSpline, problem_on_sphere, solved_on_sphere, squared_chords
from edf_stitch.core.field.spline import SmoothingProblem, kernel
from edf_stitch.core.field.strict import best_smoothing
from hypothesis import given, settings
from hypothesis import strategies as st

from .sphere_scenes import room, unit_rays

properties = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 10)
UNIT = 0.9


def fitted(rays: np.ndarray, values: np.ndarray, smoothing: float, noise: np.ndarray | None = None) -> SphereSpline:
    noise = np.ones(len(rays)) if noise is None else noise
    return solved_on_sphere(problem_on_sphere(rays, noise, UNIT), values[:, None], smoothing)[0]


@properties
@given(seeds, st.integers(8, 120), st.floats(-7, 2))
def test_planes_and_spheres_about_the_viewpoint_are_reproduced_at_any_smoothing(
    seed: int, count: int, exponent: float
) -> None:
    """d = n·r + b, for any n and b: a plane's inverse range is n·r, that of a sphere b."""
    random = np.random.default_rng(seed)
    normal, level = random.normal(size=3), random.normal()
    rays, elsewhere = unit_rays(seed + 1, count), unit_rays(seed + 2, 200)
    noise = 2.0 ** random.uniform(-1, 1, count)
    spline = fitted(rays, rays @ normal + level, 10.0**exponent, noise)
    assert spline.at(elsewhere)[:, 0] == pytest.approx(elsewhere @ normal + level, abs=2e-7)


@properties
@given(seeds)
def test_values_are_those_of_the_kernel_of_chords(seed: int) -> None:
    rays, elsewhere = unit_rays(seed, 60), unit_rays(seed + 1, 70)
    spline = fitted(rays, room(rays), 1e-4)
    exact = kernel(elsewhere / UNIT, rays / UNIT) @ spline.weights + elsewhere / UNIT @ spline.affine[:-1]
    assert spline.at(elsewhere) == pytest.approx(exact + spline.affine[-1], abs=1e-5)
    assert squared_chords(rays / UNIT, rays / UNIT, UNIT).diagonal() == pytest.approx(np.zeros(60), abs=1e-14)


def test_values_do_not_depend_on_the_threads_or_on_what_else_is_asked_for() -> None:
    rays = unit_rays(0, 400)
    spline = fitted(rays, room(rays), 1e-4)
    elsewhere = unit_rays(1, 2500)
    threads = cv2.getNumThreads()
    try:
        cv2.setNumThreads(1)
        alone = spline.at(elsewhere)
        cv2.setNumThreads(4)
        assert np.array_equal(spline.at(elsewhere), alone)
    finally:
        cv2.setNumThreads(threads)
    assert spline.at(elsewhere.reshape(50, 50, 3)).shape == (50, 50, 1)
    assert np.array_equal(spline.at(elsewhere.reshape(50, 50, 3)).reshape(-1, 1), alone)


def test_small_angles_give_the_planar_spline() -> None:
    """Three degrees across: what differs is the curvature of the sphere alone."""
    plane = np.random.default_rng(3).uniform(-1, 1, (80, 2))
    reach = 0.03
    rays = np.column_stack([reach * plane, np.ones(80)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    values = np.sin(3 * plane[:, 0]) + np.cos(2 * plane[:, 1] + plane[:, 0])
    problem = SmoothingProblem.build(plane, np.ones(80), 1.0)
    on_sphere = problem_on_sphere(rays, np.ones(80), reach)
    for smoothing in (1e-6, 1e-4):
        flat = problem.solve(values, smoothing)[0].at(0.8 * plane)
        inner = np.column_stack([0.8 * reach * plane, np.ones(80)])
        inner /= np.linalg.norm(inner, axis=1, keepdims=True)
        curved = solved_on_sphere(on_sphere, values[:, None], smoothing)[0].at(inner)[:, 0]
        assert np.abs(curved - flat).max() < 0.03 * np.ptp(values)


def test_leaving_out_is_what_refitting_without_a_point_gives() -> None:
    rays = unit_rays(5, 40)
    values, noise = room(rays), 2.0 ** np.random.default_rng(6).uniform(-1, 1, 40)
    problem = problem_on_sphere(rays, noise, UNIT)
    (by_ladder,) = problem.held_out(values, np.array([1e-3]))
    by_inverse = problem.inverse(1e-3).held_out(values)
    for i in range(40):
        rest = np.arange(40) != i
        without = fitted(rays[rest], values[rest], 1e-3, noise[rest])
        refitted = values[i] - without.at(rays[i : i + 1])[0, 0]
        assert by_ladder[i] == pytest.approx(refitted, abs=2e-6)
        assert by_inverse[i] == pytest.approx(refitted, abs=2e-6)


def test_more_noise_is_smoothed_more() -> None:
    rays = unit_rays(7, 500)
    chosen = []
    for noise in (0.0, 0.003, 0.03):
        values = room(rays) + noise * np.random.default_rng(8).normal(size=500)
        problem = problem_on_sphere(rays, np.ones(500), UNIT)
        chosen.append(best_smoothing(problem, values, np.ones(500), SPHERE.smoothing_ladder))
    assert chosen[0] < chosen[1] < chosen[2]
    assert chosen[0] == pytest.approx(SPHERE.smoothing_ladder[0])
