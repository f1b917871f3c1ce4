"""Cylindrical and equirectangular panoramas from pictures to files: against the truth, and as they say they are."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.compose.crop import largest_rectangle
from edf_stitch.core.measure.metrics import look_up
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.inspection import depth_grid, displacement_px, full_geometry, heat_map, match_rows
from edf_stitch.core.output.outputs import OutputRequest, write
from edf_stitch.core.output.sphere_part import sphere_part_of
from edf_stitch.core.output.warp_file import warp_bytes
from edf_stitch.core.panorama.levelling import angles_of, gravity, turned, upright
from edf_stitch.core.pictures.gpano import SpherePart
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.core.system.output_files import OutputFiles
from edf_stitch.synthetic_scenes.two_planes import FLOOR_Y, WALL_Z, Pair, Textures

from ..pairs import ON_REFERENCE

ROUND = ("cylindrical", "equirectangular")


@pytest.fixture(scope="module")
def results(small_pair: Pair, known: StitchOptions) -> dict[str, StitchResult]:
    return {
        kind: stitch((small_pair.reference, small_pair.target), replace(known, projection=kind)) for kind in ROUND
    }  # fmt: skip


def rays_of(result: StitchResult) -> np.ndarray:
    """Unit rays (H, W, 3) of the warp's pixels in the reference camera's frame."""
    canvas = result.warp.canvas
    assert canvas.projection is not None
    return canvas.projection.rays(np.stack(np.meshgrid(canvas.xs, canvas.ys), axis=-1))


def ranges(pair: Pair, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far away (H, W) what rays from the reference camera meet is, and where (H, W, 3) in the world."""
    first = pair.reference_camera
    ways = rays @ first.R
    with np.errstate(divide="ignore"):
        to_wall, to_floor = WALL_Z / ways[..., 2], FLOOR_Y / ways[..., 1]
    far = np.minimum(*(np.where(s > 0, s, np.inf) for s in (to_wall, to_floor)))
    return far, first.place + far[..., None] * ways


@pytest.mark.parametrize("kind", ROUND)
def test_the_map_is_the_true_one(results: dict[str, StitchResult], small_pair: Pair, kind: str) -> None:
    """As well as in a flat panorama (a third of a pixel), and the depth is range, in baselines."""
    result, second = results[kind], small_pair.target_camera
    far, world = ranges(small_pair, rays_of(result))
    seen = (homogeneous(world.reshape(-1, 3)) @ np.column_stack([second.R, second.t]).T) @ second.K.T
    true = (seen[:, :2] / seen[:, 2:]).reshape(*far.shape, 2)
    both = (result.layers[1].alpha > 0) & (result.layers[0].alpha > 0)
    off = np.hypot(result.warp.maps[1].x - true[..., 0], result.warp.maps[1].y - true[..., 1])[both]
    assert both.sum() > 10_000 and np.median(off) < 0.4
    baseline = np.linalg.norm(second.place - small_pair.reference_camera.place)
    d = result.warp.inverse_depth[both] * far[both] / baseline
    assert abs(np.median(d) - 1) < 0.05


@pytest.mark.parametrize("kind", ROUND)
def test_the_picture_is_what_a_camera_of_that_kind_sees(
    results: dict[str, StitchResult], small_pair: Pair, kind: str
) -> None:
    """Rays cast into the scene from the reference's place, one a pixel: its own grain is most of what differs."""
    result = results[kind]
    _, world = ranges(small_pair, rays_of(result))
    true = Textures(0).light(world)
    shown = result.layers[0].alpha > 0
    ours = result.layers[0].pixels
    error = np.abs(ours - true)[shown].mean()
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        assert error < 0.75 * np.abs(np.roll(ours, step, axis=axis) - true)[shown].mean(), "a pixel aside is worse"


def test_alignment_is_the_flat_panoramas(results: dict[str, StitchResult], small_result: StitchResult) -> None:
    flat = small_result.report["measured"]
    for result in results.values():
        ours = result.report["measured"]
        assert abs(ours["alignment_median_px"] - flat["alignment_median_px"]) < 0.02
        assert abs(ours["overlap_psnr_db"] - flat["overlap_psnr_db"]) < 0.1, "measured in the reference's own frame"
        assert abs(ours["overlap_px"] - flat["overlap_px"]) <= 1 and ours["folds"] < 0.002
        assert ours["projectivity_own_px"] < 0.3 and ours["off_line_mean_px"] < 0.3


@pytest.mark.parametrize("kind", ROUND)
def test_the_report_says_which_ray_a_pixel_shows(results: dict[str, StitchResult], kind: str) -> None:
    result = results[kind]
    entry = result.report["canvas"]
    projection = entry["projection"]
    assert entry["offset"] is None and projection["kind"] == kind
    assert (entry["height"], entry["width"]) == result.pixels.shape[:2]
    assert np.allclose(turned(*projection["level"]), projection["rotation"], atol=1e-9)
    # a pixel of the reference, by the report's words alone
    K = np.array(result.report["two_view"]["K"])
    ray = np.array(projection["rotation"]).T @ np.linalg.inv(K) @ (100.0, 70.0, 1.0)
    heading = np.arctan2(ray[0], ray[2])
    rise = ray[1] / np.hypot(ray[0], ray[2])
    rise = rise if kind == "cylindrical" else np.arctan(rise)
    at = np.array(projection["centre"]) + projection["focal_px"] * np.array([heading, rise])
    column, row = np.rint(at).astype(int)
    expected = result.pictures[0].pixels[68:73, 98:103].reshape(-1, 3)
    found = result.pixels[row, column]
    assert (found > expected.min(axis=0) - 0.05).all() and (found < expected.max(axis=0) + 0.05).all()
    options = result.report["options"]
    assert (options["projection"], options["level"]) == (kind, "auto")


def test_a_flat_panorama_reports_its_plane(small_result: StitchResult) -> None:
    entry = small_result.report["canvas"]
    assert entry["projection"]["kind"] == "perspective" and entry["offset"] == list(small_result.warp.canvas.offset)
    centre = small_result.edges[0].two_view.K[:2, 2] + small_result.warp.canvas.offset
    assert np.allclose(entry["projection"]["centre"], centre) and entry["projection"]["level"] == [0, 0, 0]


def test_the_sphere_is_whole_and_the_rest_of_it_empty(results: dict[str, StitchResult]) -> None:
    result = results["equirectangular"]
    height, width = result.alpha.shape
    focal = result.report["canvas"]["projection"]["focal_px"]
    assert width == 2 * height and abs(width - 2 * np.pi * focal) < 1
    assert 0.8 < focal / result.edges[0].two_view.K[0, 0] < 1.2, "the pictures keep their pixels"
    left, top, whole_width, whole_height = result.spread
    assert (whole_width, whole_height) == (width, height) and left < 0 and top < 0
    part = np.s_[-top : -top + result.warp.canvas.height, -left : -left + result.warp.canvas.width]
    assert (result.alpha > 0).sum() == (result.alpha[part] > 0).sum() > 10_000
    assert result.layers[1].alpha.shape == result.warp.maps[1].x.shape == result.alpha[part].shape
    assert result.alpha[part].size < 0.2 * result.alpha.size, "the empty part costs nothing before the end"


def test_by_hand_the_reference_looks_where_it_is_told_to(small_pair: Pair, known: StitchOptions) -> None:
    options = replace(known, projection="equirectangular", level=(90.0, 30.0, 0.0), measure=False)
    result = stitch((small_pair.reference, small_pair.target), options)
    height, width = result.alpha.shape
    rows, columns = np.nonzero(np.pad(result.layers[0].alpha, ((-result.spread[1], 0), (-result.spread[0], 0))))
    assert abs(columns.mean() / width - 0.75) < 0.01 and abs(rows.mean() / height - (0.5 - 30 / 180)) < 0.02
    assert result.report["options"]["level"] == [90.0, 30.0, 0.0]
    assert np.allclose(result.report["canvas"]["projection"]["level"], (90, 30, 0))


def test_the_horizon_is_that_of_upright_edges_and_of_the_poses_found(results: dict[str, StitchResult]) -> None:
    for result in results.values():
        projection = result.warp.canvas.projection
        assert projection is not None
        yaw, pitch, roll = angles_of(projection.rotation)
        assert 0 < abs(pitch) < 0.5 and abs(roll) < 0.5, "the scene's edges are upright"
        columns = np.flatnonzero((result.alpha > 0).any(axis=0))
        middle = result.report["canvas"]["projection"]["centre"][0]
        assert abs(yaw) > 3 and abs(columns.mean() - middle) < 3, "the frame is centred"
        level = upright(gravity([view.R for view in result.views]))
        assert abs(angles_of(level)[1]) > 3, "which the poses alone do not tell"


@pytest.mark.parametrize("kind", ROUND)
def test_crops(small_pair: Pair, known: StitchOptions, results: dict[str, StitchResult], kind: str) -> None:
    full = results[kind]
    height, width = full.alpha.shape
    shown = full.alpha > 0
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    middle = (int(columns.mean()) - 30, int(rows.mean()) - 20, 70, 50)
    beyond = (int(columns[0]) - 5, int(rows[0]) - 3, 40, 30) if kind == "equirectangular" else (0, 0, 25, 20)
    left, top, *_ = full.spread
    own = np.pad(full.layers[0].alpha > 0, ((-top, height), (-left, width)))[:height, :width]
    own_rows, own_columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
    frame = (own_columns[0], own_rows[0], np.ptp(own_columns) + 1, np.ptp(own_rows) + 1)
    for crop, box in (
        ("inscribed", largest_rectangle(shown)), ("reference", frame), (middle, middle), (beyond, beyond),
    ):  # fmt: skip
        options = replace(known, projection=kind, crop=crop, measure=False)
        part = stitch((small_pair.reference, small_pair.target), options)
        x, y, w, h = box
        assert np.array_equal(part.pixels, full.pixels[y : y + h, x : x + w]), crop
        assert np.array_equal(part.alpha, full.alpha[y : y + h, x : x + w])
        assert part.report["canvas"]["width"] == w
        shape = part.warp.maps[1].shape
        assert shape <= (h, w) and shape[0] * shape[1] <= h * w, "no more is kept than is shown"
        assert np.array_equal(part.spread_out().layers[0].alpha > 0, own[y : y + h, x : x + w])
        assert np.allclose(
            np.array(part.report["canvas"]["projection"]["centre"]) + (x, y),
            full.report["canvas"]["projection"]["centre"],
        )


def test_a_crop_beside_both_pictures_is_refused(small_pair: Pair, known: StitchOptions) -> None:
    options = replace(known, projection="equirectangular", crop=(0, 0, 50, 50), measure=False)
    with pytest.raises(BadRequest, match="the crop 0,0,50,50 .* lies beside both pictures"):
        stitch((small_pair.reference, small_pair.target), options)


def test_files_of_a_sphere_all_have_its_size(results: dict[str, StitchResult], tmp_path: Path) -> None:
    result = results["equirectangular"]
    request = OutputRequest(tmp_path / "all.png", layers=tmp_path / "layers")
    with OutputFiles(overwrite=False) as files:
        write(result, request, files)
    pictures = (request.panorama, *(tmp_path / "layers").glob("*.png"))
    sizes = {load_picture(path).pixels.shape[:2] for path in pictures}
    assert sizes == {result.alpha.shape}
    with np.load(io.BytesIO(warp_bytes(result))) as warp:
        assert warp["map_x_01"].shape == warp["inverse_depth"].shape == result.alpha.shape
        assert np.isnan(warp["offset"]).all() and str(warp["projection"]) == "equirectangular"
        # as a reader computes it, from what the file holds alone
        height, width = warp["map_x_01"].shape
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        theta, phi = (x - warp["centre"][0]) / warp["focal"], (y - warp["centre"][1]) / warp["focal"]
        own = np.stack([np.cos(phi) * np.sin(theta), np.sin(phi), np.cos(phi) * np.cos(theta)], axis=-1)
        p = own @ warp["rotation"].T @ warp["K"][0].T
        at = p @ warp["H_inf"][1].T + warp["inverse_depth"][..., None] * warp["e_prime"][1]
        seen = np.isfinite(warp["map_x_01"]) & (np.pad(result.layers[1].alpha, _margins(result)) > 0)
        off = np.hypot(at[..., 0] / at[..., 2] - warp["map_x_01"], at[..., 1] / at[..., 2] - warp["map_y_01"])[seen]
        assert off.max() < 2.0 and np.median(off) < 0.5, "slack apart"


def test_only_spheres_say_which_part_of_a_sphere_they_are(results: dict[str, StitchResult]) -> None:
    sphere = results["equirectangular"]
    height, width = sphere.alpha.shape
    assert sphere_part_of(sphere) == SpherePart((width, height), (0, 0, width, height))
    part = sphere_part_of(replace(sphere, canvas=sphere.canvas.within((30, 20, 60, 40))))
    assert part == SpherePart((width, height), (30, 20, 60, 40))
    assert all(sphere_part_of(one) is None for kind, one in results.items() if kind != "equirectangular")
    # the reference looks 100° from north, and lies 12° right of the middle
    first = replace(sphere.pictures[0], exif=Exif(heading=100.0))
    level = {"projection": {"level": (12.0, 0.0, 0.0)}}
    looking = replace(sphere, pictures=(first, sphere.pictures[1]), report={**sphere.report, "canvas": level})
    found = sphere_part_of(looking)
    assert found is not None and found.heading == 88.0


def test_what_a_window_shows_of_a_round_panorama(results: dict[str, StitchResult]) -> None:
    for result in results.values():
        whole = result.spread_out()
        shape = result.alpha.shape
        assert whole.labels is not None and result.labels is not None
        for part in (whole.warp.maps[1].x, whole.occluded[1], whole.layers[1].alpha, whole.labels, whole.confidence):
            assert part.shape == shape
        assert (whole.labels == 1).sum() == (result.labels == 1).sum() > 0
        assert (whole.layers[1].alpha > 0).sum() == (result.layers[1].alpha > 0).sum()
        geometry = full_geometry(whole)
        assert np.isnan(geometry["S"]).all() and geometry["canvas"] == shape[::-1]
        assert np.nanmedian(match_rows(whole)["errors"]) < 0.5
        assert np.nanmedian(displacement_px(whole)[whole.layers[1].alpha > 0]) > 1
        picture, (low, high) = heat_map(whole)
        assert (picture[..., 3] > 0).any() and low < high
        grid = depth_grid(whole)
        assert len(grid["inverse_depth"]) == grid["columns"] * grid["rows"] and np.any(grid["shows"])


def _margins(result: StitchResult) -> list[tuple[int, int]]:
    left, top, width, height = result.spread
    inner = result.warp.canvas
    return [(-top, height - inner.height + top), (-left, width - inner.width + left)]


@pytest.mark.parametrize(("options", "word"), [
    ({"projection": "fisheye"}, "projection 'fisheye' is not offered"),
    ({"projection": "cylindrical", "field": "paper"}, "'paper' knows the reference's plane only"),
    ({"projection": "equirectangular", "level": "straight"}, "level 'straight' is not known"),
    ({"projection": "cylindrical", "level": (1.0, 2.0)}, "yaw, pitch, roll"),
    ({"projection": "cylindrical", "level": (1.0, 2.0, float("nan"))}, "yaw, pitch, roll"),
    ({"level": (1.0, 2.0, 3.0)}, "the projection reference keeps the reference's own plane"),
])  # fmt: skip
def test_what_makes_no_sense_is_refused_in_words(options: dict, word: str) -> None:
    with pytest.raises(BadRequest, match=word) as caught:
        replace(ON_REFERENCE, **options)
    assert caught.value.exit_code == 2


def test_pictures_whose_pose_nobody_knows_are_shown_by_their_homography(small_pair: Pair, known: StitchOptions) -> None:
    """A plane whose cameras do not follow: K alone makes rays, H brings the target."""
    height, width = small_pair.reference.shape[:2]
    random = np.random.default_rng(5)
    x = random.uniform((0, 0), (width - 1, height - 1), (200, 2))
    H = np.array([[1.02, 0.03, -30], [-0.02, 0.98, 4], [1e-4, 2e-5, 1]])
    y = homogeneous(x) @ H.T
    rows = np.column_stack([x, y[:, :2] / y[:, 2:]])
    rows = rows[((rows[:, 2:] > 1) & (rows[:, 2:] < (width - 2, height - 2))).all(axis=1)]
    options = replace(ON_REFERENCE, projection="cylindrical", matches=rows, measure=False)
    result = stitch((small_pair.reference, small_pair.target), options)
    assert result.edges[0].two_view.model == "plane"
    assert np.nanmax(np.linalg.norm(look_up(result.warp, rows[:, :2]) - rows[:, 2:], axis=1)) < 0.5
