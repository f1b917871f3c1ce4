"""What a window shows of a stitch, against the stitch itself."""

import json
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.projective import homogeneous, project
from edf_stitch.core.field.sphere_field import fit_sphere_field
from edf_stitch.core.output import inspection
from edf_stitch.core.output.json_file import json_bytes
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.rig_viewpoint import rig_viewpoint
from edf_stitch.core.panorama.rig_warp import RigSurface, build_rig_warp
from edf_stitch.core.panorama.viewpoint import Viewpoint
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import ON_REFERENCE, with_map, with_two_view
from ..field.sphere_scenes import rig_of


@pytest.fixture(scope="module")
def half(pair: Pair) -> StitchResult:
    """The 400 × 300 pair at half its size, cropped to the reference's frame."""
    from edf_stitch.core.cameras.sources import CameraRequest

    K = pair.reference_camera.K
    camera = CameraRequest(focal_px=(float(K[0, 0]),), principal=(float(K[0, 2]), float(K[1, 2])))
    options = replace(ON_REFERENCE, camera=camera, scale=0.5, crop="reference", measure=False)
    return stitch((pair.reference, pair.target), options)


def test_geometry_is_that_of_the_full_pictures(half: StitchResult, pair: Pair):
    found = inspection.full_geometry(half)
    assert found["full_sizes"] == ((400, 300), (400, 300))
    assert np.allclose(found["K"], pair.reference_camera.K, atol=1e-6)
    # the canvas is the reference's frame: the corners of its first pixels coincide
    assert np.allclose(project(np.array([[-0.5, -0.5, 1.0]]) @ found["S"].T), [[-0.5, -0.5]])
    assert found["canvas"] == (200, 150)
    x = half.used_matches.x
    y = half.used_matches.y
    lines = homogeneous(x) @ found["F"].T
    distance = np.abs((lines * homogeneous(y)).sum(axis=1)) / np.linalg.norm(lines[:, :2], axis=1)
    assert np.median(distance) < 0.5


def test_a_sliding_viewpoint_is_kept_as_it_is(half: StitchResult):
    """From it, whoever reads result.json knows from where each direction is seen."""
    assert inspection.full_geometry(half)["viewpoint"] is None, "all is seen from the reference's place"
    viewpoint = Viewpoint(0.5, np.array([0.6, 0, 0.8]), np.eye(3), np.array([1.0, 0]), (-0.1, 0.2))
    slid = replace(half, warp=replace(half.warp, viewpoint=viewpoint))
    told = json.loads(json_bytes(inspection.full_geometry(slid)))["viewpoint"]
    back = Viewpoint(told["s1"], *(np.array(told[name]) for name in ("c", "rotation", "along")), tuple(told["ends"]))
    ray = np.array([0.05, -0.1, 1.0])
    assert 0 < viewpoint.slide_at(ray) < 0.5 and np.array_equal(back.place(ray), viewpoint.place(ray))


def test_every_match_has_its_place_its_fate_and_its_error(half: StitchResult):
    found = inspection.match_rows(half)
    rows, errors = np.array(found["rows"]), np.array(found["errors"])
    assert rows[:, :2].max() > 210, "px of the full pictures"
    used = np.array(found["states"]) == inspection.USED
    ours = half.used_matches
    assert np.allclose(rows[used], np.column_stack([ours.x, ours.y]), atol=1e-3)
    assert 0 < used.sum() < len(rows)
    assert np.nanmedian(errors[used]) < 1.5 < np.nanmedian(errors[~used])


def test_an_error_is_measured_in_full_pixels(half: StitchResult):
    row = np.column_stack([half.used_matches.x, half.used_matches.y])[:1]
    moved = row + np.array([0, 0, 30.0, 40.0])
    assert abs(inspection.match_errors(half, moved)[0] - 50) < 4
    outside = np.array([[-500.0, -500.0, 10, 10]])
    assert np.isnan(inspection.match_errors(half, outside)).all()


def test_the_slide_is_what_depth_does(half: StitchResult):
    """d·|∂x'/∂d|, doubled to full px; nothing where all is infinitely far."""
    far = inspection.displacement_px(half)
    H, e = half.edges[0].two_view.H_inf, half.edges[0].two_view.e_prime
    x, y = 120, 60
    offset = half.warp.canvas.offset
    point = np.array([x - offset[0], y - offset[1], 1.0])
    ideal = project((H @ point + half.warp.inverse_depth[y, x] * e)[None]) - project((H @ point)[None])
    slack = 0.6  # px at half size: what `slack` adds besides
    assert abs(far[y, x] - 2 * np.linalg.norm(ideal)) < 2 * slack
    flat = with_two_view(half, replace(half.edges[0].two_view, e_prime=np.zeros(3)))
    assert not inspection.displacement_px(flat).any()


def test_the_slide_is_measured_through_the_lenses(half: StitchResult):
    """A point at infinity is seen where both lenses bend it to: a map of such points slides nowhere."""
    cameras = tuple(replace(camera, distortion=np.array([k1, 0, 0, 0, 0])) for camera, k1 in
                    zip(half.cameras, (-0.12, 0.08), strict=True))  # fmt: skip
    canvas = half.warp.canvas
    raw = np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1)
    q = homogeneous(undistort(raw, cameras[0])) @ half.edges[0].two_view.H_inf.T
    far = distort(q[..., :2] / q[..., 2:], cameras[1])
    seen = replace(half, cameras=cameras, warp=with_map(half.warp, *np.moveaxis(far.astype(np.float32), -1, 0)))
    assert inspection.displacement_px(with_two_view(seen, half.edges[0].two_view)).max() < 1e-3


def test_the_heat_map_ends_where_the_target_does(half: StitchResult):
    heat, (low, high) = inspection.heat_map(half)
    shows = half.layers[1].alpha > 0
    assert heat.shape == (150, 200, 4) and np.array_equal(heat[..., 3] > 0, shows)
    assert 0 < low < high
    far = inspection.displacement_px(half)
    near, away = far > np.percentile(far[shows], 95), shows & (far < np.percentile(far[shows], 5))
    assert heat[near & shows][:, 0].mean() > heat[near & shows][:, 2].mean(), "red is near"
    assert heat[away][:, 2].mean() > heat[away][:, 0].mean(), "blue is far"


def test_the_difference_is_black_where_the_pictures_agree(half: StitchResult):
    same = replace(half, layers=(half.layers[0], half.layers[0]))
    shown = inspection.difference(same)
    assert not shown[..., :3].any() and (shown[..., 3] == 255).all()
    other = replace(half.layers[0], light=1 - half.layers[0].pixels)
    assert inspection.difference(replace(half, layers=(half.layers[0], other)))[..., :3].mean() > 40
    nothing = replace(half.layers[1], alpha=np.zeros_like(half.layers[1].alpha))
    assert not inspection.difference(replace(half, layers=(half.layers[0], nothing)))[..., 3].any()


def test_the_depth_grid_reaches_from_corner_to_corner(half: StitchResult):
    grid = inspection.depth_grid(half)
    columns, rows = grid["columns"], grid["rows"]
    assert max(columns, rows) == inspection.INSPECTION.longest_grid and abs(columns / rows - 200 / 150) < 0.02
    depth = np.array(grid["inverse_depth"]).reshape(rows, columns)
    for y, x in ((0, 0), (-1, -1), (0, -1)):
        assert depth[y, x] == pytest.approx(half.warp.inverse_depth[y, x], rel=1e-4)
    assert len(grid["shows"]) == columns * rows and set(grid["shows"]) <= {0, 1}


def test_what_is_infinitely_far_is_seen_from_where_a_viewpoint_slides_to_among_many() -> None:
    rig = rig_of((0, 20, -20), 1, points=1200)
    field = fit_sphere_field(rig, with_slack=False)
    viewpoint = rig_viewpoint(rig.views, RigSurface.of(field, rig.views).outlines, np.eye(3)).sliding(0.7)
    projection = round_projection("cylindrical", rig.views[0].K, np.eye(3), 60.0)
    warp = build_rig_warp(RigSurface.of(field, rig.views).seen_from(viewpoint), projection)
    canvas, view = warp.canvas, rig.views[1]
    infinite = canvas.project_rows(view.H_inf, canvas.xs, canvas.ys)
    inspection._slide_along(infinite, warp, viewpoint, view.H_inf @ rig.views[0].K, rig.views[0])
    rays = projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))
    from_there = rays + warp.inverse_depth[..., None] * viewpoint.place(rays)
    assert np.stack(infinite, axis=-1) == pytest.approx(from_there @ view.R.T @ view.K.T, abs=1e-6)
