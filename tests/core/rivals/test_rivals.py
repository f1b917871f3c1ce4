"""What all rivals owe: a map of the overlap that meets the matches, no depth, and an end beyond the overlap."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.choices import LINE_FIELDS, RIVALS
from edf_stitch.core.field.field import Field
from edf_stitch.core.field.transfer import target_points
from edf_stitch.core.fields import fit_field
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.warp_file import warp_bytes
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.warp import build_map
from edf_stitch.core.pipeline import stitch
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.system.errors import DegenerateGeometry
from edf_stitch.synthetic_scenes.two_planes import Pair

from ..field.test_strict import SIDE, SIZE, curved, overlap, planar, some_matches

every_rival = pytest.mark.parametrize("name", RIVALS)
CAMERAS = (Camera(SIDE.K, SIZE, "test", 0.0), Camera(SIDE.K_prime, SIZE, "test", 0.0))
STILL = replace(SIDE, t=np.zeros(3), e_prime=np.zeros(3), F=np.full((3, 3), np.nan), model="rotation")


def rival(name: str, noise: float = 0.3, count: int = 200) -> Field:
    x, y, _ = some_matches(SIDE, curved, count, noise)
    return fit_field(name, "plane", SIDE, Matches(x, y), SIZE, SIZE)


@pytest.mark.parametrize(
    ("name", "most"), [("rew", 0.6), ("apap", 1.5), ("spw", 6.0), ("lpc", 6.0), ("homography", 15.0)]
)
def test_it_meets_what_it_never_saw_as_well_as_it_can(name: str, most: float) -> None:
    """A hill of thirty px: one homography misses it, the others follow, with lines as far as slopes may change."""
    probe, true, _ = some_matches(SIDE, curved, 300, seed=9)
    error = np.linalg.norm(rival(name).predict(probe) - true, axis=1)
    assert np.sqrt((error**2).mean()) < most
    assert name in LINE_FIELDS or (name == "homography") == (np.percentile(error, 95) > 5)


@every_rival
def test_it_knows_no_depth_and_no_cameras(name: str) -> None:
    field = rival(name)
    view = field.two_view
    assert np.isnan(view.F).all() and np.isnan(view.R).all() and np.isnan(view.t).all() and not view.e_prime.any()
    assert np.isnan(field.on_grid(Grid.over(0, 0, 900, 600, 500)).inverse_depth).all()
    warp = build_map(field, views_of(view, CAMERAS), Canvas(300, 200, (0, 0)))
    assert np.isnan(warp.inverse_depth).all() and np.isfinite(warp.maps[1].x).all()


@every_rival
def test_what_it_sends_is_what_its_map_says_in_the_overlap(name: str) -> None:
    field = rival(name)
    canvas = Canvas(600, 500, (-450, -150))
    warp = build_map(field, views_of(field.two_view, CAMERAS), canvas)
    points = np.stack(np.meshgrid(np.arange(0.0, 600, 7), np.arange(0.0, 500, 7)), axis=-1)
    sent = field.predict((points - canvas.offset).reshape(-1, 2)).reshape(points.shape)
    inside = overlap(field, points - canvas.offset)
    column, row = np.moveaxis(points.astype(int), -1, 0)
    mapped = np.stack([warp.maps[1].x[row, column], warp.maps[1].y[row, column]], axis=-1)
    # a mesh has kinks, which the cubic between a grid's nodes rounds off
    most = 0.5 if name in LINE_FIELDS else 0.02
    assert inside.mean() > 0.8 and np.abs(mapped - sent)[inside].max() < most


@every_rival
def test_fitted_again_to_its_own_matches_it_is_the_same(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    matches = Matches(x, y, weight=np.random.default_rng(1).uniform(0.5, 2, 300))
    field = fit_field(name, "plane", SIDE, matches, SIZE, SIZE)
    again = field.refitted(matches.subset(field.fit.inliers_used))
    assert again.name == name and again.fit.inliers_used.all()
    assert np.abs(again.predict(x) - field.predict(x)).max() < 1e-6


@every_rival
def test_fitted_again_it_knows_only_what_it_is_given(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    field = fit_field(name, "plane", SIDE, Matches(x, y), SIZE, SIZE)
    hill = np.linalg.norm(x - (700, 450), axis=1) < 200
    kept = np.flatnonzero(~hill)
    without = field.refitted(Matches(x[kept], y[kept]))
    used = without.fit.inliers_used
    assert len(used) == len(kept) and used.all(), "all are kept, outliers are not sought"
    if name != "homography":  # the hill has no say in that anyway
        assert np.median(np.linalg.norm(without.predict(x[hill]) - field.predict(x[hill]), axis=1)) > 2
    with pytest.raises(DegenerateGeometry):
        field.refitted(Matches(x[:5], y[:5]))
    with pytest.raises(DegenerateGeometry):
        field.refitted(Matches(np.linspace((400, 100), (900, 600), 40), np.linspace((300, 100), (700, 600), 40)))


@every_rival
@pytest.mark.parametrize("two_view", [STILL, SIDE], ids=["rotation", "plane"])
def test_on_matches_of_one_homography_every_rival_is_that_homography(name: str, two_view) -> None:
    x, y, _ = some_matches(two_view, planar, 200)
    field = fit_field(name, "plane", two_view, Matches(x, y), SIZE, SIZE)
    canvas = Canvas(900, 650, (100, 50))
    warp = build_map(field, views_of(field.two_view, CAMERAS), canvas)
    points = np.stack(np.meshgrid(np.arange(900.0), np.arange(650.0)), axis=-1) - canvas.offset
    expected = target_points(two_view, points, planar(points) if two_view is SIDE else np.zeros(points.shape[:2]))
    mapped = np.stack([warp.maps[1].x, warp.maps[1].y], axis=-1)
    # exact in the overlap; beyond it to what rounding leaves of homographies of few matches
    off = np.abs(mapped - expected)
    if name in LINE_FIELDS:  # these divide the target evenly there, and a little of it reaches in
        off = np.where(overlap(field, points)[..., None], off, 0) / 100
    assert np.nanmax(off) < 0.01


@every_rival
def test_gross_errors_do_not_move_it(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 300, 0.3)
    wrong = y.copy()
    spoiled = np.random.default_rng(3).permutation(300)[:30]
    wrong[spoiled] += np.array([60.0, 5.0])  # along the lines, more or less: what passes an epipolar test
    clean, robust = (fit_field(name, "plane", SIDE, Matches(x, target), SIZE, SIZE) for target in (y, wrong))
    off = np.linalg.norm(robust.predict(x) - clean.predict(x), axis=1)
    assert np.median(off) < 0.5 and not robust.fit.inliers_used[spoiled].any()


@every_rival
def test_given_matches_are_all_kept(name: str) -> None:
    x, y, _ = some_matches(SIDE, curved, 100, 0.3)
    y[7] += 15
    field = fit_field(name, "plane", SIDE, Matches(x, y, given=True), SIZE, SIZE)
    assert field.fit.inliers_used.all()


@every_rival
def test_a_stitch_with_it_says_what_it_lacks(name: str, small_pair: Pair, known: StitchOptions) -> None:
    result = stitch((small_pair.reference, small_pair.target), replace(known, field=name))
    report = json.loads(json.dumps(result.report))
    assert report["field"]["kind"] == name and report["two_view"]["F"] == [[None] * 3] * 3
    assert report["measured"]["projectivity_own_px"] is None
    assert report["measured"]["overlap_psnr_db"] > 15 and report["measured"]["held_out_rms_px"] > 0
    with np.load(io.BytesIO(warp_bytes(result))) as warp:
        assert np.isfinite(warp["map_x_01"]).any() and np.isfinite(warp["H_inf"]).all()
        for lacking in ("R", "t", "e_prime"):
            assert np.isfinite(warp[lacking][0]).all() and np.isnan(warp[lacking][1]).all(), lacking
        assert np.isnan(warp["F"]).all() and np.isnan(warp["inverse_depth"]).all()
