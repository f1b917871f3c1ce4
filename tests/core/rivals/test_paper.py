"""The paper's field: the least squares it claims to solve, what it depends on and what not, and how it ends."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import distance_to_line
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.field.options import STRICT
from edf_stitch.core.field.spline import ThinPlateSpline, kernel
from edf_stitch.core.field.strict import fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.rivals.paper import PaperField, fit_paper, solve_paper
from edf_stitch.core.system.errors import DegenerateGeometry
from hypothesis import given, settings
from hypothesis import strategies as st

from ..field.test_strict import SIDE, SIZE, VIEWS, curved, every_view, planar, some_matches

properties = settings(max_examples=25)


def paper_of(two_view: TwoView, matches: Matches, fade: str = "plane") -> PaperField:
    return fit_paper(fit_strict(two_view, matches, SIZE, SIZE, fade), matches)


# --- the least squares ----------------------------------------------------------------------------------------------


class Problem:
    """A small problem in raw px, as docs/method.md writes it down."""

    def __init__(self, seed: int, count: int, smoothing: float = 1e-3) -> None:
        random = np.random.default_rng(seed)
        self.c = random.uniform((0, 0), SIZE, (count, 2))
        self.g = random.normal(0, 20, (count, 2)) + 40 * np.sin(self.c / 300)
        self.noise = random.uniform(0.3, 3, count)
        self.u = np.array([np.cos(seed), np.sin(seed)])
        self.smoothing = smoothing * SIZE[0] * SIZE[1]
        self.S = kernel(self.c, self.c) + 8 * np.pi * self.smoothing * np.diag(self.noise)
        self.M = np.column_stack([self.c, np.ones(count)])

    def solve(self) -> tuple[ThinPlateSpline, np.ndarray]:
        return solve_paper(self.c, self.g, self.u, self.smoothing, self.noise)

    def design(self) -> tuple[np.ndarray, np.ndarray]:
        """2N equations in 2 (N − 3) + 3 unknowns, w and w' in a basis Z of what Mᵀw = 0 allows; and Z."""
        Z = np.linalg.svd(self.M.T)[2][3:].T
        none = np.zeros_like(self.S @ Z)
        return np.block([[self.S @ Z, none, self.u[0] * self.M], [none, self.S @ Z, self.u[1] * self.M]]), Z

    def brute_force(self) -> tuple[np.ndarray, np.ndarray]:
        """w (N, 2) in raw px and m (3,) from the whole system at once."""
        A, Z = self.design()
        unit = np.linalg.norm(A, axis=0)
        z = np.linalg.lstsq(A / unit, self.g.T.ravel(), rcond=1e-15)[0] / unit
        k = Z.shape[1]
        return np.column_stack([Z @ z[:k], Z @ z[k : 2 * k]]), z[2 * k :]

    def residual(self, w: np.ndarray, m: np.ndarray) -> np.ndarray:
        return self.S @ w + np.outer(self.M @ m, self.u) - self.g


@properties
@given(st.integers(0, 10_000), st.integers(8, 30), st.floats(-5, 1))
def test_it_equals_brute_force(seed: int, count: int, exponent: float) -> None:
    problem = Problem(seed, count, 10.0**exponent)
    radial, m = problem.solve()
    w, m_brute = problem.brute_force()
    probe = np.random.default_rng(seed + 1).uniform((-300, -300), (1500, 1200), (40, 2))
    ours = radial.at(probe) + np.outer(probe @ m[:2] + m[2], problem.u)
    theirs = kernel(probe, problem.c) @ w + np.outer(probe @ m_brute[:2] + m_brute[2], problem.u)
    assert np.abs(ours - theirs).max() < 1e-6
    assert np.abs(radial.at(probe) - kernel(probe, problem.c) @ w).max() < 1e-6, "part by part too"


@pytest.mark.parametrize("smoothing", [1e-5, 1e-3, 1.0])
def test_it_meets_its_own_normal_equations(smoothing: float) -> None:
    problem = Problem(3, 40, smoothing)
    radial, m = problem.solve()
    w = radial.weights / radial.scale**2
    # the side conditions, exactly: no part of the radial functions is affine
    assert np.abs(problem.M.T @ w).max() < 1e-9 * (np.abs(problem.M).T @ np.abs(w)).max()
    left = problem.residual(w, m)
    A, Z = problem.design()
    gradient = A.T @ left.T.ravel()
    assert np.abs(gradient / np.linalg.norm(A, axis=0)).max() < 1e-8 * np.linalg.norm(problem.g)
    least, random = np.sum(left**2), np.random.default_rng(0)
    assert least > 1, "2 (N − 3) + 3 unknowns do not meet 2N equations"
    for _ in range(50):
        dw = Z @ random.normal(size=(Z.shape[1], 2)) * 1e-3 * np.abs(w).max()
        dm = random.normal(size=3) * (1e-6, 1e-6, 1e-3)
        assert np.sum(problem.residual(w + dw, m + dm) ** 2) > least


def test_without_smoothing_it_goes_through_what_one_direction_of_affine_can_reach() -> None:
    """λ → 0: the radial parts interpolate, but affine is left to u alone: what lies across it stays."""
    u, slope = np.array([0.8, 0.6]), np.array([0.03, -0.02, 5.0])
    problem = Problem(5, 40)
    M = problem.M
    bend = kernel(problem.c, problem.c) @ (np.eye(40) - M @ np.linalg.pinv(M)) @ problem.g * 1e-7
    g, none = bend + np.outer(M @ slope, u), np.zeros(40)
    radial, m = solve_paper(problem.c, g, u, 0.0, none)
    assert np.abs(radial.at(problem.c) + np.outer(M @ m, u) - g).max() < 1e-6 * np.abs(g).max()
    assert np.allclose(M @ m, M @ slope, atol=1e-5)
    across = np.outer(M @ slope, (-0.6, 0.8))
    radial, m = solve_paper(problem.c, across, u, 0.0, none)
    left = radial.at(problem.c) + np.outer(M @ m, u) - across
    assert np.abs(left).max() > 0.1 * np.abs(across).max()


def test_with_all_smoothing_only_the_affine_part_is_left() -> None:
    problem = replaced_noise(Problem(6, 40, 1e9))
    radial, m = problem.solve()
    assert np.abs(radial.at(problem.c)).max() < 1e-4
    along = problem.g @ problem.u
    assert np.allclose(problem.M @ m, problem.M @ np.linalg.lstsq(problem.M, along, rcond=None)[0], atol=1e-4)


def replaced_noise(problem: Problem) -> Problem:
    """Even noise: then the limit is plain least squares."""
    problem.noise = np.ones_like(problem.noise)
    return problem


# --- on matches -----------------------------------------------------------------------------------------------------


@every_view
def test_exact_matches_are_met(two_view: TwoView) -> None:
    """The epipole at infinity (e'₃ = 0) and in the picture too."""
    depths = planar if two_view is VIEWS["epipole in the picture"] else curved
    x, y, _ = some_matches(two_view, depths, 400)
    field = paper_of(two_view, Matches(x, y))
    probe, true, _ = some_matches(two_view, depths, 300, seed=9)
    error = np.linalg.norm(field.predict(probe) - true, axis=1)
    assert np.isfinite(error).all() and np.median(error) < 0.5
    assert field.fit.smoothing in STRICT.smoothing_ladder and field.name == "paper"
    left = np.linalg.norm(y - field.predict(x), axis=1)[field.fit.inliers_used]
    assert field.fit.residual_px == pytest.approx(np.sqrt((left**2).mean()), rel=1e-6)


def test_it_stands_on_the_strict_fields_matches() -> None:
    x, y, d = some_matches(SIDE, curved, 400)
    wrong = np.random.default_rng(5).permutation(400)[:20]
    y[wrong] = target_points(SIDE, x[wrong], d[wrong] + 0.05)
    field = paper_of(SIDE, Matches(x, y))
    used = field.fit.inliers_used
    assert np.array_equal(used, field.strict.fit.inliers_used) and not used[wrong].any()
    assert np.array_equal(field.plane, field.strict.plane)
    probe, true, _ = some_matches(SIDE, curved, 300, seed=9)
    assert np.median(np.linalg.norm(field.predict(probe) - true, axis=1)) < 0.5


def test_it_leaves_the_epipolar_lines() -> None:
    """That is what its tables measured; strict never does."""
    x, y, _ = some_matches(SIDE, curved, 400, 0.7)
    field = paper_of(SIDE, Matches(x, y))
    assert distance_to_line(SIDE.F, x, field.strict.predict(x)).max() < 1e-4
    assert distance_to_line(SIDE.F, x, field.predict(x)).max() > 0.2


def test_heavy_matches_are_followed_more() -> None:
    x, y, _ = some_matches(SIDE, curved, 200)
    there = np.argmin(np.linalg.norm(x - (750, 450), axis=1))
    y[there, 1] += 1.5  # across its line, where the strict field sees nothing to drop
    left = []
    for heavy in (0.1, 1.0, 10.0):
        weight = np.ones(len(x))
        weight[there] = heavy
        strict = fit_strict(SIDE, Matches(x, y, weight=weight), SIZE, SIZE)
        field = fit_paper(strict, Matches(x, y, weight=weight), 1e-3)
        left.append(np.linalg.norm(y[there] - field.predict(x[there : there + 1])[0]))
    assert left[0] > left[1] > left[2]


def moved(two_view: TwoView, by: tuple[float, float]) -> TwoView:
    """The same pair with the target's pixels counted from another origin."""
    T = np.array([[1, 0, by[0]], [0, 1, by[1]], [0, 0, 1.0]])
    F = np.linalg.inv(T).T @ two_view.F
    return replace(two_view, K_prime=T @ two_view.K_prime, H_inf=T @ two_view.H_inf, e_prime=T @ two_view.e_prime, F=F)


def test_it_depends_on_where_the_targets_origin_lies() -> None:
    """u = (e'₁, e'₂) does, unless e'₃ = 0: why docs/method.md fixes the origin. Strict does not."""
    by = np.array([900.0, -2500.0])
    for name, depends in (("to the side, turned", True), ("epipole at infinity", False)):
        x, y, _ = some_matches(VIEWS[name], curved, 300, 0.5)
        one, other = (fit_strict(v, Matches(x, t), SIZE, SIZE)
                      for v, t in ((VIEWS[name], y), (moved(VIEWS[name], tuple(by)), y + by)))  # fmt: skip
        assert np.abs(other.predict(x) - by - one.predict(x)).max() < 1e-3
        papers = (fit_paper(one, Matches(x, y), 1e-2), fit_paper(other, Matches(x, y + by), 1e-2))
        off = np.abs(papers[1].predict(x) - by - papers[0].predict(x)).max()
        assert off > 0.1 if depends else off < 1e-3


def test_the_same_matches_give_the_same_bytes() -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.5)
    one, other = (paper_of(SIDE, Matches(x.copy(), y.copy())) for _ in range(2))
    grid = Grid.over(-200, -100, 1500, 1100)
    ours, theirs = one.on_grid(grid).shift, other.on_grid(grid).shift
    assert ours is not None and theirs is not None and ours.tobytes() == theirs.tobytes()
    assert one.slope.tobytes() == other.slope.tobytes()


# --- how it ends ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fade", ["plane", "infinity"])
def test_outside_the_overlap_its_radial_part_fades_and_its_affine_part_as_asked(fade: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    field = paper_of(SIDE, Matches(x, y), fade)
    grid = Grid((-3200, -2400), 25, 304, 224)
    values = field.on_grid(grid)
    assert values.shift is not None and not values.inverse_depth.any(), "it knows no depth"
    points = grid.points.reshape(-1, 2)
    c = target_points(SIDE, points, np.zeros(len(points)))
    sent = (c + values.shift.reshape(-1, 2)).reshape(*grid.points.shape)
    unfaded = field.predict(points).reshape(grid.points.shape)
    with np.errstate(invalid="ignore"):
        inside = (grid.points >= 0).all(axis=-1) & (grid.points <= np.array(SIZE) - 1).all(axis=-1)
        inside &= (unfaded >= 0).all(axis=-1) & (unfaded <= np.array(SIZE) - 1).all(axis=-1)
    assert inside.mean() > 0.01 and np.abs(sent - unfaded)[inside].max() < 1e-9
    distance = grid.step * cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    far = (distance > field.fit.fade_px + 3 * grid.step) & np.isfinite(c[:, 0]).reshape(inside.shape)
    assert far.mean() > 0.1
    affine = np.outer(c @ field.slope[:2] + field.slope[2], field.direction).reshape(grid.points.shape)
    assert np.abs(values.shift - (0 if fade == "infinity" else affine))[far].max() < 1e-9
    assert np.abs(affine[far]).max() > 50
    # what fades counts five times
    kept = field.fit.inliers_used
    radial = field.radial.at(target_points(SIDE, x[kept], np.zeros(kept.sum())))
    moves = y[kept] - target_points(SIDE, x[kept], np.zeros(kept.sum())) if fade == "infinity" else radial
    assert field.fit.fade_px == pytest.approx(max(5 * np.percentile(np.linalg.norm(moves, axis=1), 98), 8), rel=1e-6)


def test_behind_the_target_camera_it_sends_nothing_and_spoils_nothing() -> None:
    x, y, _ = some_matches(SIDE, curved, 300)
    field = paper_of(SIDE, Matches(x, y))
    behind = np.array([[-20_000.0, 400.0]])
    assert np.isnan(target_points(SIDE, behind, np.zeros(1))).all() and np.isnan(field.predict(behind)).all()
    values = field.on_grid(Grid((-21_000, 0), 100, 220, 9))
    assert values.shift is not None and np.isfinite(values.shift).all()


def test_where_infinity_lies_behind_the_target_it_is_refused_with_advice() -> None:
    x, y, _ = some_matches(SIDE, curved, 100)
    strict = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    turned = replace(strict, two_view=replace(SIDE, H_inf=-SIDE.H_inf))
    with pytest.raises(DegenerateGeometry, match="use strict"):
        fit_paper(turned, Matches(x, y))


def test_without_parallax_it_is_the_homography_and_radial_parts() -> None:
    view = replace(SIDE, t=np.zeros(3), e_prime=np.zeros(3), F=np.full((3, 3), np.nan), model="rotation")
    x, y, _ = some_matches(view, planar, 200)
    field = paper_of(view, Matches(x, y))
    assert np.abs(field.predict(x) - y).max() < 1e-6 and not field.direction.any()
