"""Thin-plate splines: what they reproduce, and cross-validation against refitting point by point."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.field.options import SPLINE
from edf_stitch.core.field.spline import SmoothingProblem, ThinPlateSpline, kernel, spread_points
from edf_stitch.core.system.errors import Cancelled
from edf_stitch.core.system.threads import asking
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

properties = settings(max_examples=30)
seeds = st.integers(0, 2**32 - 1)
WIDTH, HEIGHT = 1200.0, 900.0
UNIT = float(np.sqrt(WIDTH * HEIGHT))
LADDER = 10.0 ** np.arange(-7.0, 2.01, 1.0)


def some_points(seed: int, count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform((0, 0), (WIDTH, HEIGHT), (count, 2))


def some_noise(seed: int, count: int) -> np.ndarray:
    """Relative noise from a half to two."""
    return 2.0 ** np.random.default_rng(seed + 1).uniform(-1, 1, count)


def wavy(points: np.ndarray) -> np.ndarray:
    return np.sin(points[:, 0] / 200) + np.cos(points[:, 1] / 150 + points[:, 0] / 400)


def brute_force(points: np.ndarray, noise: np.ndarray, values: np.ndarray, smoothing: float) -> np.ndarray:
    """Leave-one-out residuals by leaving out one point after the other."""
    out = np.empty(len(points))
    for i in range(len(points)):
        rest = np.arange(len(points)) != i
        spline, _ = SmoothingProblem.build(points[rest], noise[rest], UNIT).solve(values[rest], smoothing)
        out[i] = values[i] - spline.at(points[i : i + 1])[0]
    return out


def test_the_kernel_is_the_thin_plates_with_zero_at_zero() -> None:
    p = np.array([[0.0, 0], [3, 4], [0.1, 0]])
    found = kernel(p, p)
    assert np.array_equal(np.diag(found), np.zeros(3))
    assert found[0, 1] == found[1, 0] == pytest.approx(0.5 * 25 * np.log(25))
    assert found[0, 2] == pytest.approx(0.5 * 0.01 * np.log(0.01))
    assert kernel(p, p[:2]).shape == (3, 2)


@properties
@given(seeds, st.integers(3, 60), st.floats(-7, 4))
def test_a_plane_is_reproduced_at_any_smoothing(seed: int, count: int, exponent: float) -> None:
    points, noise = some_points(seed, count), some_noise(seed, count)
    a, b, c = np.random.default_rng(seed + 2).normal(size=3)
    values = a * points[:, 0] / WIDTH + b * points[:, 1] / HEIGHT + c
    spline, residual = SmoothingProblem.build(points, noise, UNIT).solve(values, 10.0**exponent)
    size = np.abs((a, b, c)).sum()
    # three points may lie nearly on a line, and then the plane is theirs alone
    spread = np.linalg.svd(points - points.mean(axis=0))[1][-1] / UNIT
    assert np.abs(residual).max() < 1e-9 * size
    far = some_points(seed + 3, 20) * 3 - (WIDTH, HEIGHT)
    expected = a * far[:, 0] / WIDTH + b * far[:, 1] / HEIGHT + c
    assert np.abs(spline.at(far) - expected).max() < 1e-9 * size / spread


def test_without_smoothing_it_goes_through_the_values() -> None:
    points, noise = some_points(0, 80), some_noise(0, 80)
    values = wavy(points)
    problem = SmoothingProblem.build(points, noise, UNIT)
    errors = [np.abs(problem.solve(values, smoothing)[0].at(points) - values).max() for smoothing in (1e-4, 1e-6, 1e-8)]
    assert errors[2] < 1e-4 and errors[0] > errors[1] > errors[2]
    assert np.abs(problem.solve(values, 0.0)[0].at(points) - values).max() < 1e-9


def test_with_all_smoothing_it_is_the_weighted_plane() -> None:
    points, noise = some_points(0, 80), some_noise(0, 80)
    values = wavy(points)
    spline, _ = SmoothingProblem.build(points, noise, UNIT).solve(values, 1e6)
    design = np.column_stack([points, np.ones(80)])
    plane = np.linalg.lstsq(design / noise[:, None], values / noise, rcond=None)[0]
    assert np.allclose(spline.at(points), design @ plane, atol=1e-5)


@properties
@given(seeds, st.integers(4, 80), st.floats(-6, 2))
def test_the_residual_is_the_value_minus_the_spline(seed: int, count: int, exponent: float) -> None:
    points, noise = some_points(seed, count), some_noise(seed, count)
    values = wavy(points) + np.random.default_rng(seed).normal(size=count)
    spline, residual = SmoothingProblem.build(points, noise, UNIT).solve(values, 10.0**exponent)
    assert np.allclose(residual, values - spline.at(points), atol=1e-8)
    # the side conditions: no part of the bend is a plane
    assert np.abs(spline.weights.sum()) < 1e-8 * np.abs(spline.weights).sum() + 1e-12
    assert np.abs(spline.centres.T @ spline.weights).max() < 1e-8 * np.abs(spline.weights).sum() + 1e-12


def test_it_is_the_minimum_it_claims_to_be() -> None:
    """Σ ((g − f)/√D)² + 8πλ wᵀΦw is least at the solution, among splines on the same centres."""
    points, noise = some_points(4, 40), some_noise(4, 40)
    values, smoothing = wavy(points), 1e-3
    problem = SmoothingProblem.build(points, noise, UNIT)
    spline, _ = problem.solve(values, smoothing)
    Phi = kernel(problem.centres, problem.centres)
    M = np.column_stack([problem.centres, np.ones(40)])

    def objective(w: np.ndarray, a: np.ndarray) -> float:
        misfit = (values - Phi @ w - M @ a) / noise
        return float(misfit @ misfit + 8 * np.pi * smoothing * w @ Phi @ w)

    least = objective(spline.weights, spline.affine)
    random = np.random.default_rng(0)
    for _ in range(50):
        dw = random.normal(size=40)
        dw -= M @ np.linalg.lstsq(M, dw, rcond=None)[0]
        step = 1e-3 * np.abs(spline.weights).max()
        assert objective(spline.weights + step * dw, spline.affine + step * random.normal(size=3)) > least


@pytest.mark.parametrize("even", [True, False])
def test_leave_one_out_is_what_leaving_out_gives(even: bool) -> None:
    points = some_points(1, 30)
    noise = np.ones(30) if even else some_noise(1, 30)
    values = wavy(points) + 0.1 * np.random.default_rng(1).normal(size=30)
    problem = SmoothingProblem.build(points, noise, UNIT)
    ladder = LADDER[1:]
    on_ladder = problem.held_out(values, ladder)
    assert on_ladder.shape == (len(ladder), 30)
    for smoothing, row in zip(ladder, on_ladder, strict=True):
        expected = brute_force(points, noise, values, smoothing)
        assert np.allclose(problem.inverse(smoothing).held_out(values), expected, rtol=1e-6, atol=1e-8)
        assert np.allclose(row, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("smoothing", [1e-6, 1e-3, 1.0])
def test_the_inverse_makes_what_the_system_makes_also_of_fewer_points(smoothing: float) -> None:
    points, noise = some_points(5, 80), some_noise(5, 80)
    values = wavy(points) + 0.1 * np.random.default_rng(5).normal(size=80)
    problem = SmoothingProblem.build(points, noise, UNIT)
    inverse, left = problem.inverse(smoothing), np.full(80, True)
    for gone in ([], [3], [0, 40, 41, 78], list(range(5, 30))):  # each among those that are left
        keep = np.full(int(left.sum()), True)
        keep[gone] = False
        inverse = inverse.subset(keep)
        left[left] = keep
        few = problem.subset(left)
        spline, residual = few.solve(values[left], smoothing)
        assert np.allclose(inverse.matrix @ values[left], spline.weights, rtol=1e-7, atol=1e-7)
        assert np.allclose(inverse.residual(values[left]), residual, rtol=1e-7, atol=1e-9)
        whole = np.linalg.inv(few.system(smoothing))[: len(residual), : len(residual)]
        assert np.allclose(inverse.matrix, whole, rtol=1e-6, atol=1e-9 * np.abs(whole).max())


def test_whether_to_go_on_is_asked_while_eigenvalues_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """They take most of a second of a large field."""
    problem, eigh = SmoothingProblem.build(some_points(1, 30), np.ones(30), UNIT), np.linalg.eigh
    since = time.monotonic()

    def slow(matrix: np.ndarray) -> Any:
        time.sleep(0.6)
        return eigh(matrix)

    monkeypatch.setattr(np.linalg, "eigh", slow)
    with pytest.raises(Cancelled), asking(lambda: time.monotonic() > since + 0.1):
        problem.held_out(np.zeros(30), LADDER)
    assert time.monotonic() < since + 0.4


def test_functions_held_out_together_are_those_held_out_alone() -> None:
    points, noise = some_points(6, 50), some_noise(6, 50)
    values = np.column_stack([wavy(points), np.random.default_rng(6).normal(size=50)])
    problem = SmoothingProblem.build(points, noise, UNIT)
    together = problem.held_out(values, LADDER)
    assert together.shape == (len(LADDER), 50, 2)
    for k in range(2):
        assert np.allclose(together[..., k], problem.held_out(values[:, k], LADDER), rtol=1e-9, atol=1e-12)


def test_cross_validation_recognises_noise_and_bends() -> None:
    """More smoothing for noisy values, less for exact ones; and the chosen one is near the truth."""
    points = some_points(2, 300)
    random = np.random.default_rng(2)
    problem = SmoothingProblem.build(points, np.ones(300), UNIT)
    best = []
    for sigma in (0.0, 0.05, 0.5):
        values = wavy(points) + sigma * random.normal(size=300)
        score = (problem.held_out(values, LADDER) ** 2).mean(axis=1)
        best.append(int(np.argmin(score)))
        # no prediction is better than the noise; a good one is hardly worse
        assert 0.9 * sigma**2 < score.min() < 1.5 * sigma**2 + 1e-3
    assert best[0] <= best[1] < best[2]


@pytest.mark.parametrize("smoothing", [1e-1, 1e-3, 1e-5])
def test_the_quick_way_over_a_grid_agrees(smoothing: float) -> None:
    points, noise = some_points(3, 400), some_noise(3, 400)
    values = wavy(points) + 0.02 * np.random.default_rng(3).normal(size=400)
    spline, _ = SmoothingProblem.build(points, noise, UNIT).solve(values, smoothing)
    xs, ys = np.linspace(-400, WIDTH + 400, 77), np.linspace(-300, HEIGHT + 300, 59)
    nodes = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    quick = spline.on_axes(xs, ys)
    assert quick.shape == (59, 77) and quick.dtype == np.float64
    error = np.abs(quick.ravel() - spline.at(nodes))
    # float32 rounds each term of the sum by 6e-8 of it a few times; where λ is so small that noise is interpolated the
    # terms are far larger than their sum
    terms = np.abs(kernel((nodes - spline.centre) / spline.scale, spline.centres)) @ np.abs(spline.weights)
    assert (error < 4 * 6e-8 * terms).all()
    if smoothing >= 1e-3:
        assert error.max() < 1e-5 * np.ptp(quick)


def test_the_quick_way_is_exact_on_the_centres() -> None:
    """r² ln r² at r = 0 and around it: nodes that lie on centres."""
    points = np.stack(np.meshgrid(np.arange(8) * 100.0, np.arange(6) * 100.0), axis=-1).reshape(-1, 2)
    spline, _ = SmoothingProblem.build(points, np.ones(48), UNIT).solve(wavy(points), 1e-4)
    quick = spline.on_axes(np.arange(8) * 100.0, np.arange(6) * 100.0)
    assert np.abs(quick.ravel() - spline.at(points)).max() < 1e-5 * np.ptp(quick)


def test_slabs_make_no_difference() -> None:
    points = some_points(5, 1000)
    spline, _ = SmoothingProblem.build(points, np.ones(1000), UNIT).solve(wavy(points), 1e-3)
    xs, ys = np.linspace(0, WIDTH, 130), np.linspace(0, HEIGHT, 45)
    assert len(xs) * len(ys) * 1000 > 2 * SPLINE.kernel_values_at_once  # several slabs of both kinds
    whole = spline.on_axes(xs, ys)
    grid = np.stack(np.meshgrid(xs, ys), axis=-1)
    single = np.array([spline.at(row) for row in grid])
    assert np.allclose(spline.at(grid.reshape(-1, 2)).reshape(45, 130), single, rtol=0, atol=1e-12)
    assert np.allclose(np.vstack([spline.on_axes(xs, ys[k : k + 1]) for k in range(45)]), whole, rtol=0, atol=1e-6)


@properties
@given(seeds, st.floats(-2, 2), st.floats(-5, 1))
def test_pixels_of_another_size_give_the_same_spline(seed: int, exponent: float, smoothing: float) -> None:
    """A picture in other units, moved: same values at the same places, as λ is counted in units of `scale`."""
    factor, shift = 10.0**exponent, np.array([300.0, -70])
    points, noise = some_points(seed, 40), some_noise(seed, 40)
    values = wavy(points)
    one, left = SmoothingProblem.build(points, noise, UNIT).solve(values, 10.0**smoothing)
    problem = SmoothingProblem.build(factor * points + shift, noise, factor * UNIT)
    other, left_too = problem.solve(values, 10.0**smoothing)
    probe = some_points(seed + 1, 30) * 1.5
    assert np.allclose(one.at(probe), other.at(factor * probe + shift), atol=1e-6)
    assert np.allclose(left, left_too, atol=1e-7)


def test_smoothing_is_counted_in_square_units_of_the_scale() -> None:
    """λ·scale² is what counts: the method's λ = 0.001·W·H px² is 0.001 with √(W·H) as the unit."""
    points, noise = some_points(6, 50), some_noise(6, 50)
    values = wavy(points)
    in_units = SmoothingProblem.build(points, noise, UNIT).solve(values, 1e-3)[0]
    # raw pixels make a system of condition 1e14, so by a smaller unit instead
    in_others = SmoothingProblem.build(points, noise, 100.0).solve(values, 1e-3 * (UNIT / 100) ** 2)[0]
    probe = some_points(7, 30)
    assert np.allclose(in_units.at(probe), in_others.at(probe), atol=1e-7)


def test_noisier_points_are_followed_less() -> None:
    points = some_points(8, 60)
    values = np.zeros(60)
    values[10] = 1.0
    pulls = []
    for noise_there in (0.3, 1.0, 3.0):
        noise = np.ones(60)
        noise[10] = noise_there
        pulls.append(SmoothingProblem.build(points, noise, UNIT).solve(values, 1e-3)[0].at(points[10:11])[0])
    assert pulls[0] > 2 * pulls[1] > 4 * pulls[2] > 0


# --- centres -------------------------------------------------------------------------------------------------------


@properties
@given(seeds, st.integers(1, 1500), st.integers(5, 300), st.floats(1, 200))
def test_spread_points_keep_budget_and_cells(seed: int, count: int, budget: int, spacing: float) -> None:
    points = some_points(seed, count) - 300  # cells reach below zero too
    quality = np.random.default_rng(seed).random(count)
    chosen = spread_points(points, quality, budget, spacing)
    assert 0 < len(chosen) <= budget and (np.diff(chosen) > 0).all()
    assert np.array_equal(chosen, spread_points(points, quality, budget, spacing))
    cells = np.unique(np.floor(points / spacing), axis=0)
    if len(cells) <= budget:  # every cell gives one, its best
        assert len(chosen) == len(cells)
        where = {tuple(c): i for c, i in zip(np.floor(points[chosen] / spacing), chosen, strict=True)}
        assert len(where) == len(cells)
        for i, cell in enumerate(np.floor(points / spacing)):
            assert quality[where[tuple(cell)]] <= quality[i]


def test_of_no_points_none_are_spread() -> None:
    assert spread_points(np.zeros((0, 3)), np.zeros(0), 5, 0.1).size == 0


def test_a_budget_that_is_too_small_coarsens_the_cells_but_not_too_much() -> None:
    points = some_points(9, 5000)
    chosen = points[spread_points(points, np.ones(5000), 400, 5.0)]
    assert 200 < len(chosen) <= 400
    counts = np.histogram2d(chosen[:, 0], chosen[:, 1], bins=(4, 3))[0]
    assert counts.min() > 0.6 * counts.mean()
    # far more than were they drawn by lot, points keep their distance
    gap = cKDTree(chosen).query(chosen, 2)[0][:, 1]
    assert np.median(gap) > 0.5 * np.sqrt(WIDTH * HEIGHT / len(chosen))


# --- several functions at once -------------------------------------------------------------------------------------


def test_functions_solved_together_are_those_solved_alone() -> None:
    points, noise = some_points(10, 60), some_noise(10, 60)
    values = np.column_stack([wavy(points), points[:, 0] / 300, np.random.default_rng(1).normal(size=60)])
    problem = SmoothingProblem.build(points, noise, UNIT)
    together, left = problem.solve(values, 1e-3)
    assert left.shape == (60, 3) and together.weights.shape == (60, 3) and together.affine.shape == (3, 3)
    probe = some_points(11, 40) * 1.4 - 200
    xs, ys = np.linspace(-100, 1300, 31), np.linspace(-50, 900, 23)
    assert together.at(probe).shape == (40, 3) and together.on_axes(xs, ys).shape == (23, 31, 3)
    for k in range(3):
        alone, left_alone = problem.solve(values[:, k], 1e-3)
        assert np.allclose(left[:, k], left_alone, atol=1e-10)
        assert np.allclose(together.at(probe)[:, k], alone.at(probe), atol=1e-9)
        assert np.allclose(together.on_axes(xs, ys)[..., k], alone.on_axes(xs, ys), atol=1e-4)
    one, left = problem.solve(values[:, :1], 1e-3)
    assert left.shape == (60, 1) and one.at(probe).shape == (40, 1) and one.on_axes(xs, ys).shape == (23, 31, 1)


def test_slabs_make_no_difference_to_several_functions() -> None:
    points = some_points(12, 1000)
    values = np.column_stack([wavy(points), -points[:, 1] / 500])
    spline, _ = SmoothingProblem.build(points, np.ones(1000), UNIT).solve(values, 1e-3)
    xs, ys = np.linspace(0, WIDTH, 90), np.linspace(0, HEIGHT, 50)
    assert len(xs) * len(ys) * 1000 > 2 * SPLINE.kernel_values_at_once
    grid = np.stack(np.meshgrid(xs, ys), axis=-1)
    assert np.allclose(spline.on_axes(xs, ys), spline.at(grid.reshape(-1, 2)).reshape(50, 90, 2), atol=1e-4)


def test_without_centres_it_is_affine() -> None:
    for affine, shape in ((np.array([1.0, 2, 3]), (2, 3)), (np.arange(6.0).reshape(3, 2), (2, 3, 2))):
        spline = ThinPlateSpline(np.empty((0, 2)), np.empty((0, *affine.shape[1:])), affine, np.zeros(2), 1.0)
        xs, ys = np.arange(3.0), np.arange(2.0)
        nodes = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        assert spline.on_axes(xs, ys).shape == shape
        assert np.allclose(spline.at(nodes).reshape(shape), spline.on_axes(xs, ys))
        assert np.allclose(spline.at(nodes), nodes @ affine[:2] + affine[2])
