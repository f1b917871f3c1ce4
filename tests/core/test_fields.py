"""The fields by name, side by side: what all of them owe, and how they end outside the overlap."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.projective import distance_to_line, homogeneous, project
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.choices import FADES, FIELDS, RIVALS
from edf_stitch.core.field.field import Field
from edf_stitch.core.field.slack import SlackField
from edf_stitch.core.field.strict import StrictField, fit_strict
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.warp import build_map
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.rivals.paper import PaperField
from edf_stitch.core.system.errors import DegenerateGeometry

from .field.test_strict import SIDE, SIZE, VIEWS, curved, overlap, planar, some_matches

OURS = tuple(name for name in FIELDS if name not in RIVALS)  # the others: rivals/test_rivals.py
every_field = pytest.mark.parametrize("name", OURS)
every_fade = pytest.mark.parametrize("fade", FADES)
CAMERAS = (Camera(SIDE.K, SIZE, "test", 0.0), Camera(SIDE.K_prime, SIZE, "test", 0.0))


def field_of(name: str, fade: str = "plane", two_view: TwoView = SIDE, noise: float = 0.3, seed: int = 0) -> Field:
    x, y, _ = some_matches(two_view, curved, 200, noise, seed)
    return fit_field(name, fade, two_view, Matches(x, y), SIZE, SIZE)


def test_each_name_makes_its_field() -> None:
    assert FIELDS == ("slack", "strict", "paper", "rew", "apap", "spw", "lpc", "homography")
    assert FADES == ("continue", "plane", "infinity")
    for name, kind in zip(OURS, (SlackField, StrictField, PaperField), strict=True):
        field = field_of(name, "infinity")
        assert isinstance(field, kind) and field.name == name
        strict = field if isinstance(field, StrictField) else field.strict
        assert strict.fade == "infinity" and strict.size == strict.target_size == SIZE


@every_field
def test_every_field_meets_what_it_never_saw(name: str) -> None:
    field = field_of(name)
    probe, true, _ = some_matches(SIDE, curved, 300, seed=9)
    error = np.linalg.norm(field.predict(probe) - true, axis=1)
    # 0.3 px of noise in each coordinate of every match; the paper's affine part knows one direction only
    assert np.sqrt((error**2).mean()) < (1.0 if name == "paper" else 0.5)


@every_field
def test_what_it_sends_is_what_its_grid_says_in_the_overlap(name: str) -> None:
    field = field_of(name)
    grid = Grid.over(400, 100, 600, 600)
    values = field.on_grid(grid)
    sent = target_points(SIDE, grid.points, values.inverse_depth) + (0 if values.shift is None else values.shift)
    expected = field.predict(grid.points.reshape(-1, 2)).reshape(grid.points.shape)
    inside = overlap(field, grid.points)
    assert inside.mean() > 0.5 and np.abs(sent - expected)[inside].max() < 1e-3


@every_field
def test_a_field_fitted_again_to_its_own_matches_is_the_same(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    matches = Matches(x, y, weight=np.random.default_rng(1).uniform(0.5, 2, 300))
    field = fit_field(name, "plane", SIDE, matches, SIZE, SIZE)
    again = field.refitted(matches.subset(field.fit.inliers_used))
    assert again.name == name and again.fit.inliers_used.all() and again.fit.smoothing == field.fit.smoothing
    assert np.abs(again.predict(x) - field.predict(x)).max() < 1e-6


@every_field
def test_a_field_fitted_again_knows_only_what_it_is_given(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    field = fit_field(name, "plane", SIDE, Matches(x, y), SIZE, SIZE)
    hill = np.linalg.norm(x - (700, 450), axis=1) < 200
    assert hill.sum() > 20
    rest = Matches(x[~hill], y[~hill])
    without = field.refitted(rest)
    used = without.fit.inliers_used
    assert len(used) == len(rest) and used.all(), "all are kept, outliers are not sought"
    for points, least, most in ((x[hill], 2.0, 50.0), (x[~hill], 0.0, 1.5)):
        off = np.linalg.norm(without.predict(points) - field.predict(points), axis=1)
        assert least < np.median(off) < most
    with pytest.raises(DegenerateGeometry):
        field.refitted(Matches(x[:5], y[:5]))
    with pytest.raises(DegenerateGeometry):
        field.refitted(Matches(np.linspace((400, 100), (900, 600), 40), np.linspace((300, 100), (700, 600), 40)))


@every_field
def test_without_parallax_every_field_is_the_homography(name: str) -> None:
    still = replace(SIDE, t=np.zeros(3), e_prime=np.zeros(3), F=np.full((3, 3), np.nan), model="rotation")
    x, y, _ = some_matches(still, planar, 200)
    for fade in FADES:
        field = fit_field(name, fade, still, Matches(x, y), SIZE, SIZE)
        canvas = Canvas(900, 650, (300, 200))
        warp = build_map(field, views_of(still, CAMERAS), canvas)
        points = np.stack(np.meshgrid(np.arange(900.0), np.arange(650.0)), axis=-1) - canvas.offset
        expected = target_points(still, points, np.zeros(points.shape[:2]))
        assert np.nanmax(np.abs(np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1) - expected)) < 1e-3
        assert not warp.inverse_depth.any()
        again = field.refitted(Matches(x[::2], y[::2]))
        assert np.abs(again.predict(x) - y).max() < 1e-6


# --- the strict field's inverse depth outside the overlap -----------------------------------------------------------


def wide_grid(step: int = 16) -> Grid:
    return Grid((-1600, -1200), step, 4400 // step, 3300 // step)


def whole_and_end(field: StrictField, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Inverse depth where nothing fades, and where all that fades has gone."""
    plane = homogeneous(grid.points) @ field.plane
    bend = field.spline.on_axes(grid.xs, grid.ys)
    # what goes on beyond the rim is not the field's: by itself it fades to its plane
    return plane + bend, np.zeros_like(plane) if field.fade == "infinity" else plane


def strict_of(fade: str, two_view: TwoView = SIDE) -> StrictField:
    x, y, _ = some_matches(two_view, curved, 200, 0.3)
    return fit_strict(two_view, Matches(x, y), SIZE, SIZE, fade)


@every_fade
def test_in_the_overlap_nothing_fades_and_far_away_only_the_end_is_left(fade: str) -> None:
    field, grid = strict_of(fade), Grid((-2600, -2000), 20, 340, 250)
    d = field.on_grid(grid).inverse_depth
    whole, end = whole_and_end(field, grid)
    inside = overlap(field, grid.points)
    assert 0.01 < inside.mean() < 0.5
    assert 1000 * np.abs(d - field.at(grid.points.reshape(-1, 2)).reshape(d.shape))[inside].max() < 1e-3
    distance = grid.step * cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    far = distance > field.fit.fade_px + 2 * grid.step
    assert far.mean() > 0.1
    np.testing.assert_allclose(d[far], end[far], rtol=1e-12)
    # in between it never leaves the range between the two; where they meet, nothing can be told
    apart = 1000 * np.abs(whole - end) > 0.1
    share = (d - end)[apart] / (whole - end)[apart]
    assert share.min() > -1e-9 and share.max() < 1 + 1e-6
    # and falls with the distance, which a grid knows to a cell or two
    u = distance[apart] / field.fit.fade_px
    slack = 2 * grid.step / field.fit.fade_px
    least, most = (1 - v * v * (3 - 2 * v) for v in (np.clip(u + e, 0, 1) for e in (slack, -slack)))
    assert (share >= least - 1e-6).all() and (share <= most + 1e-6).all()


@every_fade
@pytest.mark.parametrize("two_view", [SIDE, VIEWS["epipole in the picture"]], ids=["side", "forward"])
def test_the_fade_has_no_seam(two_view: TwoView, fade: str) -> None:
    """Between neighbours d changes by what plane, spline and the slope of the fade (3/2 over its width) allow."""
    field, grid = strict_of(fade, two_view), wide_grid(8)
    whole, end = whole_and_end(field, grid)
    faded, whole = field.on_grid(grid).inverse_depth - end, whole - end
    for axis in (0, 1):
        near = np.maximum(*(np.abs(np.take(whole, range(k, whole.shape[axis] - 1 + k), axis=axis)) for k in (0, 1)))
        # the distance to a pixelated region may itself step by √2 cells where the fade moves by one
        allowed = np.abs(np.diff(whole, axis=axis)) + 1.5 * np.sqrt(2) * grid.step / field.fit.fade_px * near
        assert (np.abs(np.diff(faded, axis=axis)) <= allowed + 1e-9).all()


@every_fade
def test_the_field_hardly_depends_on_the_grid(fade: str) -> None:
    field = strict_of(fade)
    rectangle = (-1200, -900, 3600, 2600)
    a, b = (grid.to_pixels(field.on_grid(grid).inverse_depth, *rectangle) for grid in (wide_grid(), wide_grid(8)))
    whole, end = whole_and_end(field, wide_grid())
    largest = 1000 * np.abs(whole - end).max()
    assert 1000 * np.abs(a - b).max() < 1.5 * 2 * 16 / field.fit.fade_px * largest


@every_fade
def test_where_the_grid_misses_the_overlap_the_end_is_all(fade: str) -> None:
    field, grid = strict_of(fade), Grid((-9000, -9000), 10, 30, 30)
    # summed in another order, and with fused multiply-add on some processors
    np.testing.assert_allclose(field.on_grid(grid).inverse_depth, whole_and_end(field, grid)[1], rtol=1e-12)


def test_it_fades_over_five_times_what_fades() -> None:
    x, y, _ = some_matches(SIDE, curved, 200)
    plane, infinity = (fit_strict(SIDE, Matches(x, y), SIZE, SIZE, fade) for fade in ("plane", "infinity"))
    bend, whole = (np.linalg.norm(y - target_points(SIDE, x, d), axis=1)
                   for d in (homogeneous(x) @ plane.plane, np.zeros(len(x))))  # fmt: skip
    assert plane.fit.fade_px == pytest.approx(5 * np.percentile(bend, 98), rel=0.1)
    assert infinity.fit.fade_px == pytest.approx(5 * np.percentile(whole, 98), rel=0.1)
    assert infinity.fit.fade_px > 3 * plane.fit.fade_px


# --- every field's map outside the overlap --------------------------------------------------------------------------


def map_of(field: Field, canvas: Canvas) -> tuple[np.ndarray, np.ndarray]:
    """Target pixels (H, W, 2) of a canvas, and its points in the reference's plane."""
    warp = build_map(field, views_of(SIDE, CAMERAS), canvas)
    points = np.stack(np.meshgrid(np.arange(float(canvas.width)), np.arange(float(canvas.height))), axis=-1)
    return np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1).astype(float), points - canvas.offset


@every_field
def test_far_away_the_map_is_that_of_infinity(name: str) -> None:
    """d → 0: x' = π(H_inf p)."""
    field = field_of(name, "infinity")
    beyond = 1200 + int(field.fit.fade_px) + 80
    mapped, points = map_of(field, Canvas(400, 600, (-beyond, 0)))
    expected = target_points(SIDE, points, np.zeros(points.shape[:2]))
    assert np.isfinite(expected).mean() > 0.9
    # float32
    assert np.nanmax(np.abs(mapped - expected) / np.maximum(np.abs(expected), 1000)) < 1e-6


@pytest.mark.parametrize("name", ["slack", "strict"])
def test_far_away_the_map_is_that_of_the_plane(name: str) -> None:
    """x' = π((H_inf + e' mᵀ) p)."""
    field = field_of(name, "plane")
    beyond = 1200 + int(field.fit.fade_px) + 80
    mapped, points = map_of(field, Canvas(400, 600, (-beyond, 0)))
    rays = homogeneous(points) @ (SIDE.H_inf + np.outer(SIDE.e_prime, field.plane)).T
    assert (rays[..., 2] > 0.05).mean() > 0.9
    expected = np.where(rays[..., 2:] > 0.05, project(rays), np.nan)
    assert np.nanmax(np.abs(mapped - expected) / np.maximum(np.abs(expected), 1000)) < 1e-6


@every_field
@every_fade
def test_the_map_is_continuous_across_the_border_of_the_overlap(name: str, fade: str) -> None:
    """A fade to infinity that starts at the border, as the paper has it, jumps by a hundred px here."""
    mapped, points = map_of(field_of(name, fade), Canvas(700, 600, (-200, 150)))
    inside = (points[..., 1] >= 0) & (mapped >= 0).all(axis=-1) & (mapped <= np.array(SIZE) - 1).all(axis=-1)
    border = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((25, 25), np.uint8)) > 0
    assert 0.1 < inside.mean() < 0.9
    for axis in (0, 1):
        step = np.linalg.norm(np.diff(mapped, axis=axis), axis=-1)
        # what fades loses at most 3/2 of itself over five times its largest: 0.3 px a pixel
        near = np.take(border, range(step.shape[axis]), axis=axis)
        assert np.abs(step - np.median(step))[near].max() < 0.6
        near = np.take(border, range(1, step.shape[axis]), axis=axis)
        assert np.linalg.norm(np.diff(mapped, 2, axis=axis), axis=-1)[near].max() < 0.1


@every_fade
def test_a_strict_map_never_leaves_its_lines(fade: str) -> None:
    mapped, points = map_of(field_of("strict", fade), Canvas(1500, 1100, (200, 300)))
    seen = np.isfinite(mapped).all(axis=-1)
    off = distance_to_line(SIDE.F, points[seen], mapped[seen])
    assert seen.mean() > 0.9 and (off < 1e-6 * np.maximum(np.abs(mapped[seen]).max(axis=1), 1000)).all()
