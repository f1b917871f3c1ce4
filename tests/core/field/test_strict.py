"""The strict field: depths along epipolar lines, the plane, the spline on it, what it drops and how it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import (
    distance_to_line,
    fundamental_from_pose,
    homogeneous,
    infinite_homography,
    project,
    rotation_from_vector,
)
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.field.options import STRICT
from edf_stitch.core.field.plane import fit_plane
from edf_stitch.core.field.spline import SmoothingProblem
from edf_stitch.core.field.strict import StrictField, _supported, fit_strict
from edf_stitch.core.field.transfer import inverse_depths, target_points
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.system.errors import DegenerateGeometry
from hypothesis import given, settings
from hypothesis import strategies as st

SIZE = (1200, 900)
Depths = Callable[[np.ndarray], np.ndarray]
properties = settings(max_examples=30)


def view(R: np.ndarray, t: tuple[float, ...], focals: tuple[float, float] = (1000.0, 1000.0)) -> TwoView:
    K, K_prime = (np.array([[f, 0, 599.5], [0, f, 449.5], [0, 0, 1]]) for f in focals)
    direction = np.array(t) / np.linalg.norm(t)
    return TwoView(
        K, K_prime, R, direction, fundamental_from_pose(K, K_prime, R, direction),
        infinite_homography(K, K_prime, R), K_prime @ direction, np.ones(0, bool), 0.5, "general", "", "", 0.0, 0.0,
    )  # fmt: skip


VIEWS = {
    "to the side, turned": view(rotation_from_vector(np.radians([2.0, -12, 3])), (1, 0.1, 0.15), (1000.0, 1100.0)),
    "epipole at infinity": view(np.eye(3), (1, 0, 0)),
    "epipole in the picture": view(rotation_from_vector(np.radians([0.5, -1, 0.5])), (0.05, 0.02, -1)),
}
every_view = pytest.mark.parametrize("two_view", VIEWS.values(), ids=VIEWS.keys())
SIDE = VIEWS["to the side, turned"]
PLANE = np.array([3e-5, -5e-5, 0.12])


def planar(points: np.ndarray) -> np.ndarray:
    return points @ PLANE[:2] + PLANE[2]


def curved(points: np.ndarray) -> np.ndarray:
    """A hill of some thirty pixels on a wall, in the middle of the overlap of SIDE."""
    return 0.12 + 0.03 * np.exp(-((points - (700, 450)) ** 2).sum(axis=-1) / (2 * 200**2))


def some_matches(
    two_view: TwoView, depths: Depths, count: int = 400, noise: float = 0.0, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, y and true d of points seen in both pictures; noise in px of each coordinate of y."""
    random = np.random.default_rng(seed)
    x = random.uniform((0, 0), (SIZE[0] - 1, SIZE[1] - 1), (8 * count, 2))
    d = depths(x)
    y = target_points(two_view, x, d)
    with np.errstate(invalid="ignore"):
        ok = (y >= 0).all(axis=1) & (y <= np.array(SIZE) - 1).all(axis=1)
    x, y, d = x[ok][:count], y[ok][:count], d[ok][:count]
    assert len(x) == count
    return x, y + random.normal(0, noise, y.shape), d


def overlap(field: StrictField, points: np.ndarray) -> np.ndarray:
    """Which points (…, 2) lie in the reference and, where the field sends them, in the target."""
    with np.errstate(invalid="ignore"):
        target = field.predict(points.reshape(-1, 2)).reshape(points.shape)
        inside = (target >= 0).all(axis=-1) & (target <= np.array(SIZE) - 1).all(axis=-1)
    return inside & (points >= 0).all(axis=-1) & (points <= np.array(SIZE) - 1).all(axis=-1)


def error_px(field: StrictField, x: np.ndarray, depths: Depths) -> np.ndarray:
    """How far the field sends points of the overlap from their true target pixels."""
    true = target_points(field.two_view, x, depths(x))
    return np.linalg.norm(target_points(field.two_view, x, field.at(x)) - true, axis=1)


# --- where a point goes --------------------------------------------------------------------------------------------


@every_view
def test_target_points_are_the_pictures_of_the_points(two_view: TwoView) -> None:
    random = np.random.default_rng(0)
    x = random.uniform((0, 0), SIZE, (30, 20, 2))
    Z = random.uniform(0.4, 12, (30, 20))
    there = homogeneous(x) @ np.linalg.inv(two_view.K).T * Z[..., None] @ two_view.R.T + two_view.t
    expected = project(there @ two_view.K_prime.T)
    expected[there[..., 2] <= 0] = np.nan
    found = target_points(two_view, x, 1 / Z)
    assert found.shape == (30, 20, 2)
    assert np.allclose(found, expected, rtol=1e-9, atol=1e-6, equal_nan=True)
    # whatever d is, a point stays on its epipolar line
    moved = target_points(two_view, x, random.normal(size=Z.shape)).reshape(-1, 2)
    seen = np.isfinite(moved).all(axis=1)
    assert distance_to_line(two_view.F, x.reshape(-1, 2)[seen], moved[seen]).max() < 1e-4


def test_behind_the_target_camera_there_is_no_pixel() -> None:
    forward = view(np.eye(3), (0, 0, -1))
    x = np.array([[300.0, 200], [900, 700]])
    # the target stands one baseline ahead: what is nearer than that lies behind it
    assert np.isfinite(target_points(forward, x, np.array([0.9, -5.0]))).all()
    assert np.isnan(target_points(forward, x, np.array([1.1, 50.0]))).all()
    assert np.isnan(target_points(forward, x, np.array([1.0, 1.0]))).all()


# --- depths of matches ---------------------------------------------------------------------------------------------


@every_view
def test_depths_of_clean_matches_are_exact(two_view: TwoView) -> None:
    random = np.random.default_rng(1)
    x = random.uniform((0, 0), SIZE, (500, 2))
    d = random.uniform(-0.1, 0.45, 500)  # also beyond infinity: nothing is clamped
    y = target_points(two_view, x, d)
    assert np.isfinite(y).all()
    found, sensitivity = inverse_depths(two_view, x, y)
    assert np.abs(sensitivity * (found - d)).max() < 1e-6
    assert (found[d < 0] < 0).all()
    h = 1e-6
    numeric = np.linalg.norm(target_points(two_view, x, d + h) - target_points(two_view, x, d - h), axis=1) / (2 * h)
    assert np.allclose(sensitivity, numeric, rtol=1e-6, atol=1e-6 * numeric.max())


@every_view
def test_depths_of_noisy_matches_are_the_nearest_on_the_line(two_view: TwoView) -> None:
    x, y, _ = some_matches(two_view, lambda p: np.random.default_rng(5).uniform(0.02, 0.4, len(p)), 60, noise=1.5)
    found, sensitivity = inverse_depths(two_view, x, y)
    clear = sensitivity > 50  # beside the epipole a pixel of noise is any depth
    assert clear.sum() > 40
    x, y, found, sensitivity = x[clear], y[clear], found[clear], sensitivity[clear]
    least = np.linalg.norm(target_points(two_view, x, found) - y, axis=1)
    # no other depth is nearer: a fine comb of ± 20 px around
    for px in np.linspace(-20, 20, 161):
        there = np.linalg.norm(target_points(two_view, x, found + px / sensitivity) - y, axis=1)
        assert (there >= least - 1e-9).all()
    assert np.allclose(least, distance_to_line(two_view.F, x, y), atol=1e-9)


def test_a_match_on_the_wrong_side_of_the_epipole_tells_no_depth() -> None:
    """The target moved straight on: points flow away from the epipole and never to its other side."""
    forward = view(np.eye(3), (0, 0, -1))
    centre = np.array([599.5, 449.5])
    x = centre + np.array([[100.0, 50], [100, 50]])
    y = centre + np.array([[140.0, 70], [-140, -70]])
    d, sensitivity = inverse_depths(forward, x, y)
    # 140 / 100 = 1 / (1 − d)
    assert d[0] == pytest.approx(1 - 100 / 140) and np.isfinite(sensitivity[0])
    assert np.isnan(d[1]) and np.isnan(sensitivity[1])


# --- the plane -----------------------------------------------------------------------------------------------------


@properties
@given(st.integers(0, 2**32 - 1))
def test_a_plane_is_found_exactly(seed: int) -> None:
    random = np.random.default_rng(seed)
    x = random.uniform((0, 0), SIZE, (40, 2))
    m = np.array([*random.normal(0, 1e-4, 2), random.normal(0, 0.3)])
    d = x @ m[:2] + m[2]
    found = fit_plane(x, d, random.uniform(200, 2000, 40), 0.5)
    assert np.abs(x @ found[:2] + found[2] - d).max() < 1e-10


@pytest.mark.parametrize("seed", range(4))
def test_a_third_of_wrong_depths_does_not_tilt_the_plane(seed: int) -> None:
    random = np.random.default_rng(seed)
    x = random.uniform((0, 0), SIZE, (400, 2))
    sensitivity = random.uniform(500, 1500, 400)
    d = planar(x) + random.normal(0, 0.5, 400) / sensitivity
    wrong = random.permutation(400)[:120]
    d[wrong] += random.uniform(10, 300, 120) * random.choice([-1, 1], 120) / sensitivity[wrong]
    found = fit_plane(x, d, sensitivity, 0.5)
    corners = np.array([[0.0, 0], [1199, 0], [0, 899], [1199, 899]])
    off = 1000 * np.abs(corners @ found[:2] + found[2] - planar(corners))
    # what 280 measurements of 0.5 px allow at a corner: √(7 / 280) of it, times four; squared errors would be tens off
    assert off.max() < 4 * 0.5 * np.sqrt(7 / 280)


def test_sure_depths_count_for_more() -> None:
    """Half the points say one depth, half another: the plane goes with those that see it ten times better."""
    x = np.random.default_rng(0).uniform((0, 0), SIZE, (200, 2))
    sensitivity = np.where(np.arange(200) % 2, 1000.0, 100.0)
    d = np.where(np.arange(200) % 2, 0.1, 0.1 + 1e-3)
    found = fit_plane(x, d, sensitivity, 10.0)
    assert np.abs(x @ found[:2] + found[2] - 0.1).max() < 0.03e-3


# --- a planar scene ------------------------------------------------------------------------------------------------


@every_view
def test_a_planar_scene_gives_its_plane_and_its_homography(two_view: TwoView) -> None:
    x, y, _ = some_matches(two_view, planar)
    field = fit_strict(two_view, Matches(x, y), SIZE, SIZE)
    assert np.allclose(field.plane, PLANE, rtol=0, atol=(1e-11, 1e-11, 1e-8))
    H = two_view.H_inf + np.outer(two_view.e_prime, PLANE)
    grid = Grid.over(-300, -200, 1800, 1300)
    rays = homogeneous(grid.points) @ H.T
    found = target_points(two_view, grid.points, field.on_grid(grid).inverse_depth)
    seen = rays[..., 2] > 0.05
    assert seen.mean() > 0.9
    assert np.abs(found - project(rays))[seen].max() < 1e-4
    assert field.fit.residual_px < 1e-6 and field.fit.held_out_px < 1e-5
    assert field.fit.negative_share == 0 and field.name == "strict"


def test_a_noisy_planar_scene_stays_a_plane() -> None:
    x, y, _ = some_matches(SIDE, planar, 400, 0.5)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert field.fit.smoothing >= 1e-2  # cross-validation sees nothing to bend for
    assert field.fit.residual_px == pytest.approx(0.5, rel=0.15)
    assert field.fit.held_out_px == pytest.approx(0.5, rel=0.15)
    # a plane of 400 matches is known to 0.5 √(3/400) = 0.04 px; a hardly bending spline to a few times that
    assert np.sqrt((error_px(field, x, planar) ** 2).mean()) < 0.15


# --- a curved scene ------------------------------------------------------------------------------------------------


def test_a_curved_scene_is_followed() -> None:
    x, y, _ = some_matches(SIDE, curved, 400)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    probe, _, _ = some_matches(SIDE, curved, 400, seed=9)
    # 30 px of relief; between points some 40 px apart a hill 200 px wide is known to a hundredth of that
    assert error_px(field, probe, curved).max() < 0.3
    assert np.sqrt((error_px(field, probe, curved) ** 2).mean()) < 0.05
    assert field.fit.held_out_px < 0.3 and field.fit.inliers_used.mean() > 0.97


@pytest.mark.parametrize("noise", [0.1, 0.5, 1.0])
def test_a_noisy_curved_scene_is_followed_within_its_noise(noise: float) -> None:
    x, y, _ = some_matches(SIDE, curved, 500, noise, seed=1)
    field = fit_strict(replace(SIDE, sigma=noise), Matches(x, y), SIZE, SIZE)
    probe, _, _ = some_matches(SIDE, curved, 400, seed=9)
    error = error_px(field, probe, curved)
    # averaging helps: well below the noise of a single match
    assert np.sqrt((error**2).mean()) < 0.5 * noise + 0.02
    # what a match left out is missed by: its own noise and a little more
    assert noise * 0.9 < field.fit.held_out_px < 1.3 * noise
    assert field.fit.residual_px < field.fit.held_out_px
    assert field.fit.inliers_used.mean() > 0.97
    assert field.fit.smoothing in STRICT.smoothing_ladder


def test_what_is_said_of_the_fit_is_so() -> None:
    """residual_px and held_out_px, recomputed from the matches kept."""
    x, y, _ = some_matches(SIDE, curved, 60, 0.5, seed=2)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    x, y = x[field.fit.inliers_used], y[field.fit.inliers_used]
    d, s = inverse_depths(SIDE, x, y)
    assert field.fit.residual_px == pytest.approx(np.sqrt(np.mean((s * (d - field.at(x))) ** 2)), rel=1e-6)
    g = d - homogeneous(x) @ field.plane
    left_out = []
    for i in range(len(x)):
        rest = np.arange(len(x)) != i
        problem = SmoothingProblem.build(x[rest], np.median(s) / s[rest], float(np.sqrt(SIZE[0] * SIZE[1])))
        left_out.append(s[i] * (g[i] - problem.solve(g[rest], field.fit.smoothing)[0].at(x[i : i + 1])[0]))
    assert field.fit.held_out_px == pytest.approx(np.sqrt(np.mean(np.square(left_out))), rel=1e-4)


def test_the_spline_bends_where_matches_ask_and_the_plane_is_what_is_left() -> None:
    x, y, _ = some_matches(SIDE, curved, 400, 0.3)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert field.at(np.array([[700.0, 450]]))[0] == pytest.approx(0.15, abs=1e-3)
    assert field.at(np.array([[1150.0, 60]]))[0] == pytest.approx(curved(np.array([1150.0, 60])), abs=1e-3)
    assert field.fit.fade_px == pytest.approx(5 * 1000 * np.percentile(np.abs(
        curved(x) - homogeneous(x) @ field.plane), 98), rel=0.15)  # fmt: skip


def test_at_most_a_thousand_centres_spread_over_the_picture() -> None:
    x, y, _ = some_matches(SIDE, curved, 3000, 0.5)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    used = field.fit.inliers_used
    assert 0.4 * STRICT.max_centres < used.sum() <= STRICT.max_centres and used.shape == (3000,)
    kept = x[used]
    counts = np.histogram2d(kept[:, 0], kept[:, 1], bins=(3, 3), range=((350, 1200), (0, 900)))[0]
    assert counts.min() > 0.5 * counts.mean()


# --- outliers along the lines --------------------------------------------------------------------------------------


@pytest.mark.parametrize("depths", [planar, curved])
@pytest.mark.parametrize("share", [0.05, 0.15])
def test_outliers_along_their_epipolar_lines_are_dropped(depths: Depths, share: float) -> None:
    """They pass every test of the geometry; only their neighbours give them away."""
    x, y, d = some_matches(SIDE, depths, 400, 0.5, seed=2)
    clean = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    random = np.random.default_rng(5)
    wrong = random.permutation(400)[: int(400 * share)]
    _, s = inverse_depths(SIDE, x, y)
    off = random.uniform(15, 80, len(wrong)) * random.choice([-1, 1], len(wrong)) / s[wrong]
    y[wrong] = target_points(SIDE, x[wrong], d[wrong] + off)
    assert distance_to_line(SIDE.F, x[wrong], y[wrong]).max() < 1e-4
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert field.fit.inliers_used[wrong].sum() == 0
    assert np.delete(field.fit.inliers_used, wrong).mean() > 0.95
    harm = 1000 * np.abs(field.at(x) - clean.at(x))
    # losing a share of the matches is all that happened
    assert np.sqrt((harm**2).mean()) < 0.2 and harm.max() < 1.0
    assert np.sqrt((error_px(field, x, depths) ** 2).mean()) < 0.3


def test_small_errors_along_the_lines_are_dropped_too() -> None:
    """Six to nine times the noise: nothing gross, and yet no chance."""
    x, y, d = some_matches(SIDE, planar, 400, 0.5, seed=2)
    random = np.random.default_rng(6)
    wrong = random.permutation(400)[:16]
    _, s = inverse_depths(SIDE, x, y)
    y[wrong] = target_points(SIDE, x[wrong], d[wrong] + random.uniform(3.0, 4.5, 16) / s[wrong])
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert field.fit.inliers_used[wrong].sum() == 0
    assert np.delete(field.fit.inliers_used, wrong).mean() > 0.95


def test_a_thing_in_front_of_the_wall_is_no_outlier() -> None:
    """A box 20 px nearer by parallax with a thirtieth of the matches: it stands out, but not alone."""

    def box(points: np.ndarray) -> np.ndarray:
        return 0.12 + 0.02 * (np.abs(points - (700, 450)) < 110).all(axis=-1)

    x, y, _ = some_matches(SIDE, box, 1500, 0.3, seed=3)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    inner = (np.abs(x - (700, 450)) < 70).all(axis=1)
    assert inner.sum() > 20
    assert field.fit.inliers_used[inner].mean() > 0.5
    assert np.median(error_px(field, x[inner], box)) < 1.0
    away = (np.abs(x - (700, 450)) > 250).any(axis=1)
    assert np.sqrt((error_px(field, x[away], box) ** 2).mean()) < 0.3


# --- matches from the user -----------------------------------------------------------------------------------------


def test_given_matches_are_all_kept_whatever_they_say() -> None:
    """Outliers along their lines, a lone thing of one point, two points side by side: the user has decided."""
    x, y, d = some_matches(SIDE, curved, 300)
    x[:2] = (700.5, 450.5), (700.8, 450.8)
    d[:2] = curved(x[:2])
    wrong = np.arange(2, 300, 12)
    d[wrong] += 0.05
    y = target_points(SIDE, x, d)
    found, given_ones = (fit_strict(SIDE, Matches(x, y, given=given), SIZE, SIZE) for given in (False, True))
    assert given_ones.fit.inliers_used.all()
    assert not found.fit.inliers_used[wrong].any() and not found.fit.inliers_used[:2].all(), "others are chosen from"
    # and what they say is done: 50 px off are followed by more than half
    assert (given_ones.at(x[wrong]) - curved(x[wrong])).mean() > 0.5 * 0.05


def test_more_given_matches_than_centres_are_thinned() -> None:
    x, y, _ = some_matches(SIDE, curved, 1500)
    kept = fit_strict(SIDE, Matches(x, y, given=True), SIZE, SIZE).fit.inliers_used
    assert 0.4 * STRICT.max_centres < kept.sum() <= STRICT.max_centres


def test_a_match_of_more_weight_pulls_harder() -> None:
    x, y, d = some_matches(SIDE, planar, 200)
    there = int(np.argmin(np.linalg.norm(x - (750, 450), axis=1)))
    d[there] += 0.01
    y = target_points(SIDE, x, d)
    pulls = []
    for heavy in (0.1, 1.0, 10.0):
        weight = np.ones(len(x))
        weight[there] = heavy
        field = fit_strict(SIDE, Matches(x, y, weight=weight, given=True), SIZE, SIZE)
        problem = replace(field, fit=replace(field.fit, smoothing=1e-2)).refitted(Matches(x, y, weight=weight))
        pulls.append(problem.at(x[there : there + 1])[0] - planar(x[there]))
    assert 0 < pulls[0] < pulls[1] / 3 and pulls[1] < pulls[2] < 0.0101


def test_heavier_matches_decide_where_the_plane_lies() -> None:
    """Two walls, one behind the other: the plane is that of the heavy matches."""
    x, _, _ = some_matches(SIDE, planar, 200)
    d = np.where(np.arange(200) % 2, 0.1, 0.14)
    y = target_points(SIDE, x, d)
    for heavy, expected in ((1, 0.1), (0, 0.14)):
        weight = np.where(np.arange(200) % 2 == heavy, 100.0, 0.01)
        plane = fit_strict(SIDE, Matches(x, y, weight=weight), SIZE, SIZE).plane
        assert np.abs(x @ plane[:2] + plane[2] - expected).max() < 1e-3


# --- odd cases -----------------------------------------------------------------------------------------------------


def test_with_the_epipole_in_the_picture_the_field_is_whole() -> None:
    forward = VIEWS["epipole in the picture"]
    x, y, _ = some_matches(forward, curved, 500, 0.3, seed=4)
    epipole = project(np.linalg.inv(forward.K_prime @ forward.R @ np.linalg.inv(forward.K)) @ forward.e_prime)
    assert (0 < epipole).all() and (epipole < SIZE).all()
    x = np.vstack([x, epipole, epipole + (0.01, 0)])  # matches that say nothing of depth
    y = np.vstack([y, project(forward.e_prime), project(forward.e_prime)])
    field = fit_strict(forward, Matches(x, y), SIZE, SIZE)
    assert not field.fit.inliers_used[-2:].any()
    grid = Grid.over(0, 0, *SIZE)
    assert np.isfinite(field.on_grid(grid).inverse_depth).all()
    inside = overlap(field, grid.points)
    depths = (field.on_grid(grid).inverse_depth, curved(grid.points))
    found, true = (target_points(forward, grid.points, d) for d in depths)
    error = np.linalg.norm(found - true, axis=-1)
    assert inside.mean() > 0.5
    assert np.sqrt((error[inside] ** 2).mean()) < 0.3
    # beside the epipole a wrong depth moves nothing
    near = np.linalg.norm(grid.points - epipole, axis=-1) < 40
    assert near.sum() > 20 and error[near].max() < 0.3


def test_depths_beyond_infinity_are_kept_as_they_are() -> None:
    """An approximate focal length gives a few d < 0; clamped, straight lines would bend."""

    def tilted(points: np.ndarray) -> np.ndarray:
        return (points[..., 0] - 800) * 1e-4

    x, y, d = some_matches(SIDE, tilted, 400, 0.3)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert field.fit.negative_share == pytest.approx((d[field.fit.inliers_used] < 0).mean(), abs=0.02)
    assert field.fit.negative_share > 0.2
    assert np.sqrt((error_px(field, x, tilted) ** 2).mean()) < 0.15
    grid = Grid.over(0, 0, *SIZE)
    assert field.on_grid(grid).inverse_depth.min() < -0.04


def test_the_same_matches_give_the_same_bytes() -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.5)
    one, other = (fit_strict(SIDE, Matches(x.copy(), y.copy()), SIZE, SIZE) for _ in range(2))
    grid = Grid.over(-200, -100, 1500, 1100)
    assert one.on_grid(grid).inverse_depth.tobytes() == other.on_grid(grid).inverse_depth.tobytes()
    assert one.fit.inliers_used.tobytes() == other.fit.inliers_used.tobytes()


def test_coarser_pictures_are_judged_in_their_own_pixels() -> None:
    """The same scene at twice the size, noise and all, keeps the same matches and the same depths."""
    x, y, _ = some_matches(SIDE, curved, 300, 0.5)
    one = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    twice = np.diag([2.0, 2, 1])
    large = replace(
        SIDE, K=twice @ SIDE.K, K_prime=twice @ SIDE.K_prime, H_inf=twice @ SIDE.H_inf @ np.linalg.inv(twice),
        e_prime=twice @ SIDE.e_prime, sigma=1.0,
    )  # fmt: skip
    other = fit_strict(large, Matches(2 * x, 2 * y, 2.0), (2400, 1800), (2400, 1800))
    assert np.array_equal(one.fit.inliers_used, other.fit.inliers_used) and one.fit.smoothing == other.fit.smoothing
    assert np.allclose(other.at(2 * x), one.at(x), rtol=0, atol=1e-7)
    # the target's outermost pixel centres do not scale along, and with them the matches' weights for the plane
    assert other.fit.fade_px == pytest.approx(2 * one.fit.fade_px, rel=1e-4)
    assert other.fit.residual_px == pytest.approx(2 * one.fit.residual_px)


def test_too_few_depths_are_refused() -> None:
    x, y, _ = some_matches(SIDE, planar, STRICT.min_centres - 1)
    with pytest.raises(DegenerateGeometry, match=f"only {STRICT.min_centres - 1} of {STRICT.min_centres - 1}"):
        fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    forward = view(np.eye(3), (0, 0, -1))
    centre = np.array([599.5, 449.5])
    away = np.random.default_rng(0).uniform(50, 300, (30, 2))
    with pytest.raises(DegenerateGeometry, match="only 0 of 30"):
        fit_strict(forward, Matches(centre + away, centre - 1.5 * away), SIZE, SIZE)


@pytest.mark.parametrize("count", [STRICT.min_centres, STRICT.min_centres + 2])
def test_a_handful_of_matches_makes_a_field(count: int) -> None:
    x, y, _ = some_matches(SIDE, planar, count, 0.2, seed=6)
    field = fit_strict(SIDE, Matches(x, y), SIZE, SIZE)
    assert np.isfinite(field.on_grid(Grid.over(0, 0, *SIZE)).inverse_depth).all()
    assert error_px(field, x, planar).max() < 1.5


@pytest.mark.parametrize("together, kept", [(4, True), (3, False)])
def test_three_of_the_eight_nearest_that_agree_protect_a_point(together: int, kept: bool) -> None:
    """A few points close together before a wall: each has one neighbour fewer than they are."""
    wall = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0)), axis=-1).reshape(-1, 2) * 10
    thing = np.array([[45.0, 45], [46, 45], [45, 46], [46, 46]])[:together]
    x, g = np.vstack([wall, thing]), np.r_[np.zeros(100), np.full(together, 0.02)]
    sensitivity = np.full(len(x), 1000.0)  # so 20 px before it
    found = _supported(x, g, sensitivity, 1.0)
    assert (found[100:] == kept).all() and found[:100].all()
    assert _supported(x, g, sensitivity, 30.0).all(), "within the tolerance all agree"
    assert _supported(x, g, 0.01 * sensitivity, 1.0).all(), "as it is seen, not in depth"
    assert not _supported(x[:8], g[:8], sensitivity[:8], 1.0).any(), "eight have no eight neighbours"
