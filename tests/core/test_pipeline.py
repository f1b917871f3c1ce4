"""stitch() against the truth of rendered pairs, for every kind of input; how it is stopped, and how it refuses."""

from __future__ import annotations

import itertools
import json
import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras import matches
from edf_stitch.core.cameras.projective import (
    distance_to_line,
    fundamental_from_pose,
    rotation_angle,
    rotation_from_vector,
    sampson_residuals,
)
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.cameras.view import views_of
from edf_stitch.core.compose.multiband import bands_for
from edf_stitch.core.field import folding, visibility
from edf_stitch.core.output.outputs import OutputRequest, write
from edf_stitch.core.panorama.warp import build_map
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.pose import features
from edf_stitch.core.raster import arrays
from edf_stitch.core.raster.colour import decode
from edf_stitch.core.system.errors import (
    BadRequest,
    Cancelled,
    DegenerateGeometry,
    NoOverlap,
    StitchError,
    TooFewMatches,
    UnreadableImage,
)
from edf_stitch.core.system.output_files import OutputFiles
from edf_stitch.core.system.progress import STAGES
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry, pose_errors
from edf_stitch.synthetic_scenes.rendered import expose
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at, make_pair

from ..pairs import ON_REFERENCE

# --- against the truth ---------------------------------------------------------------------------------------------


def truth_of(pair: Pair) -> TrueGeometry:
    return TrueGeometry.of(pair.reference_camera, pair.target_camera)


def true_pixels(pair: Pair, points: np.ndarray) -> np.ndarray:
    return truth_of(pair).target_pixels(points, depth_at(pair.reference_camera, points))


def shown(result: StitchResult, in_reference: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Reference points of the canvas pixels that show the target, and the target pixels the map fetches there."""
    target_size, size = (p.view.shape[1::-1] for p in (result.pictures[1], result.pictures[0]))
    rows, columns = np.nonzero(result.warp.maps[1].inside())
    points = np.column_stack([columns, rows]).astype(float) - result.warp.canvas.offset
    mapped = np.column_stack([result.warp.maps[1].x[rows, columns], result.warp.maps[1].y[rows, columns]]).astype(float)
    keep = ((points >= 0) & (points <= np.array(size) - 1)).all(axis=1) | (not in_reference)
    return points[keep], mapped[keep]


def true_errors(pair: Pair, result: StitchResult) -> tuple[np.ndarray, np.ndarray]:
    """Distances in px from the truth: of the inliers, and of the map in the overlap."""
    x, y = (one[result.edges[0].two_view.inliers] for one in (result.edges[0].matches.x, result.edges[0].matches.y))
    points, mapped = shown(result, in_reference=True)
    return (np.linalg.norm(y - true_pixels(pair, x), axis=1),
            np.linalg.norm(mapped - true_pixels(pair, points), axis=1))  # fmt: skip


def pose_deviation(pair: Pair, result: StitchResult) -> tuple[float, float]:
    """What the inliers allow at best (Cramér-Rao): standard deviations in degrees of rotation and baseline direction.

    Their noise is measured against the truth; gross errors (4 σ) carry no information.
    """
    truth = truth_of(pair)
    x, y = (one[result.edges[0].two_view.inliers] for one in (result.edges[0].matches.x, result.edges[0].matches.y))
    residual = np.abs(sampson_residuals(truth.F, x, y))
    sigma = float(np.median(residual)) / 0.6745
    x, y = x[residual < 4 * sigma], y[residual < 4 * sigma]
    across = np.linalg.svd(truth.t[None])[2][1:].T

    def moved(step: np.ndarray) -> np.ndarray:
        t = truth.t + across @ step[3:]
        F = fundamental_from_pose(
            truth.K, truth.K_prime, rotation_from_vector(step[:3]) @ truth.R, t / np.linalg.norm(t))
        return sampson_residuals(F, x, y)

    J = np.column_stack([(moved(h) - moved(-h)) / 2e-6 for h in 1e-6 * np.eye(5)])
    covariance = sigma**2 * np.linalg.inv(J.T @ J)
    rotation, baseline = covariance[:3, :3], covariance[3:, 3:]
    return float(np.degrees(np.sqrt(np.trace(rotation)))), float(np.degrees(np.sqrt(np.trace(baseline))))


def test_the_map_is_nearer_to_the_truth_than_a_single_match(pair: Pair, result: StitchResult) -> None:
    """A spline through 500 matches averages their noise: less must be left than one match has."""
    matches, field = true_errors(pair, result)
    assert np.median(field) < np.median(matches) < 0.4
    assert np.isfinite(field).all() and np.percentile(field, 95) < 1.5


def test_the_map_lies_on_the_true_epipolar_lines(pair: Pair, result: StitchResult) -> None:
    """All over the target, on average within the noise of a single match across its line."""
    x, y = (one[result.edges[0].two_view.inliers] for one in (result.edges[0].matches.x, result.edges[0].matches.y))
    noise = np.median(distance_to_line(truth_of(pair).F, x, y)) / 0.6745
    assert distance_to_line(truth_of(pair).F, *shown(result)).mean() < noise < 0.3


def test_with_the_focal_length_known_the_pose_is_as_good_as_the_matches_allow(
    pair: Pair, result: StitchResult
) -> None:
    errors = pose_errors(result.edges[0].two_view, truth_of(pair), (400, 300))
    rotation, baseline = pose_deviation(pair, result)
    assert 0.01 < rotation < 0.1 and 0.1 < baseline < 1, "the pair is what it was"
    assert errors["rotation_deg"] < 4 * rotation
    assert errors["baseline_deg"] < 4 * baseline


def test_with_the_focal_length_known_infinity_is_where_it_is(pair: Pair, result: StitchResult) -> None:
    """0.79 px is what a calibrated solver reaches on real pairs of twice the size (FIELD)."""
    errors = pose_errors(result.edges[0].two_view, truth_of(pair), (400, 300))
    assert errors["focal_percent"] == 0 and errors["h_inf_px"] < 0.79


def test_given_cameras_are_taken_as_they_are(pair: Pair) -> None:
    def entry(camera: SceneCamera) -> dict:
        return {"K": camera.K.tolist(), "R": camera.R.tolist(), "t": camera.t.tolist()}

    cameras = {"cameras": {"reference": entry(pair.reference_camera), "target": entry(pair.target_camera)}}
    options = replace(ON_REFERENCE, field="strict", camera=CameraRequest(cameras=cameras), measure=False)
    given = stitch((pair.reference, pair.target), options)
    truth, view = truth_of(pair), given.edges[0].two_view
    assert rotation_angle(view.R, truth.R) < 1e-6 and np.allclose(view.t, truth.t) and np.allclose(view.F, truth.F)
    assert distance_to_line(truth.F, *shown(given)).max() < 1e-3
    matches, field = true_errors(pair, given)
    assert np.median(field) < np.median(matches)
    # inverse depth is in baselines: metres come out where the true camera says so
    points, _ = shown(given, in_reference=True)
    at = (points + given.warp.canvas.offset).astype(int)
    depth = truth.baseline / given.warp.inverse_depth[at[:, 1], at[:, 0]]
    assert np.median(np.abs(depth / depth_at(pair.reference_camera, points) - 1)) < 0.02
    assert "cameras given" in given.report["two_view"]["why"]


def test_the_panorama_is_made_of_its_pictures(pair: Pair, result: StitchResult) -> None:
    height, width = result.alpha.shape
    assert result.pixels.shape == (height, width, 3) and result.pixels.dtype == result.alpha.dtype == np.float32
    assert (width, height) == (result.warp.canvas.width, result.warp.canvas.height)
    x, y = result.warp.canvas.offset
    only = np.zeros((height, width), bool)
    only[y : y + 300, x : x + 400] = True
    assert np.array_equal(result.layers[0].alpha > 0, only)
    assert np.array_equal(result.alpha > 0, only | (result.layers[1].alpha > 0))
    only &= (result.layers[1].alpha == 0) & far_from_seam(result)
    pasted = np.zeros_like(result.pixels)
    pasted[y : y + 300, x : x + 400] = decode(pair.reference)
    assert only.sum() > 10_000 and np.array_equal(result.pixels[only], pasted[only])
    assert result.bits == 8 and set(result.seconds) <= set(STAGES)


def far_from_seam(result: StitchResult) -> np.ndarray:
    """Where no band of the blend reaches."""
    assert result.labels is not None
    reach = 2 * (4 << bands_for(result.alpha)) + 1
    near = [cv2.dilate(((result.alpha > 0) & side).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0
            for side in (result.labels == 1, result.labels != 1)]  # fmt: skip
    return ~(near[0] & near[1])


# --- every kind of input -------------------------------------------------------------------------------------------


def same(a: StitchResult, b: StitchResult) -> bool:
    arrays = [
        (r.pixels, r.alpha, r.warp.maps[1].x, r.warp.maps[1].y, r.warp.inverse_depth, r.edges[0].two_view.F)
        for r in (a, b)
    ]
    return all(np.array_equal(one, other, equal_nan=True) for one, other in zip(*arrays, strict=True))


def good(pair: Pair, result: StitchResult) -> bool:
    """As good as the plain 8-bit pair has to be."""
    matches, field = true_errors(pair, result)
    return bool(np.median(field) < np.median(matches) < 0.4 and len(field) > 15_000)


def test_files_and_arrays_give_the_same(folder: Path, small_result: StitchResult, known: StitchOptions) -> None:
    by_path = stitch((folder / "reference.png", folder / "target.png"), known)
    by_name = stitch((str(folder / "reference.png"), str(folder / "target.png")), known)
    assert same(by_path, small_result) and same(by_name, small_result)
    assert by_path.report == by_name.report
    assert [entry["name"] for entry in by_path.report["pictures"]] == ["reference.png", "target.png"]
    nameless = [json.loads(json.dumps(one.report)) for one in (by_path, small_result)]
    for report in nameless:
        for entry in report["pictures"]:
            del entry["name"]
    assert nameless[0] == nameless[1]


def test_16_bits_give_the_same_map_and_keep_their_depth(
    small_pair: Pair, small_result: StitchResult, known: StitchOptions
) -> None:
    deep = [one.astype(np.uint16) * 257 for one in (small_pair.reference, small_pair.target)]
    result = stitch(deep, known)
    assert same(result, small_result) and result.bits == 16
    assert stitch((deep[0], small_pair.target), replace(known, measure=False)).bits == 16, "the deeper one's"


def test_float_keeps_its_light(small_pair: Pair, known: StitchOptions) -> None:
    light = [40 * decode(one) ** 2 for one in (small_pair.reference, small_pair.target)]
    result = stitch(light, known)
    assert good(small_pair, result) and result.bits == 32
    x, y = result.warp.canvas.offset
    box = (slice(y, y + 180), slice(x, x + 240))
    only = ((result.layers[1].alpha == 0) & far_from_seam(result))[box]
    assert only.sum() > 1000 and np.array_equal(result.pixels[box][only], light[0][only]), "never clipped"
    assert result.pixels.max() > 2 and result.pixels.min() >= 0 and np.isfinite(result.pixels).all()
    assert same(result, stitch([one.astype(np.float64) for one in light], known))


def test_gray(small_pair: Pair, known: StitchOptions) -> None:
    gray = [cv2.cvtColor(one, cv2.COLOR_RGB2GRAY) for one in (small_pair.reference, small_pair.target)]
    result = stitch(gray, known)
    assert good(small_pair, result) and result.pixels.shape[2] == 1
    mixed = stitch((gray[0], small_pair.target), known)
    assert good(small_pair, mixed) and mixed.pixels.shape[2] == 3
    assert np.array_equal(mixed.layers[0].pixels[..., 0], mixed.layers[0].pixels[..., 2])


def test_transparent_parts_are_neither_matched_nor_shown(small_pair: Pair, known: StitchOptions) -> None:
    hole = np.full((180, 240), 255, np.uint8)
    hole[40:100, 150:210] = 0  # in the overlap
    result = stitch((np.dstack([small_pair.reference, hole]), small_pair.target), known)
    assert good(small_pair, result) and result.report["pictures"][0]["alpha"] is True
    inside = (result.edges[0].matches.x > (150, 40)).all(axis=1) & (result.edges[0].matches.x < (209, 99)).all(axis=1)
    assert not inside.any()
    x, y = result.warp.canvas.offset
    box = (slice(y + 45, y + 95), slice(x + 155, x + 205))
    gained = result.layers[1].pixels[box] * result.decided[1].exposure.gain
    assert np.allclose(result.pixels[box], gained, atol=0.02), "the other picture shows through"
    assert not result.layers[0].alpha[box].any() and (result.alpha[box] == 1).all()
    seen_through = stitch((small_pair.reference, np.dstack([small_pair.target, np.roll(hole, -40, axis=1)])), known)
    x, y = seen_through.warp.canvas.offset
    assert good(small_pair, seen_through) and (seen_through.alpha[y : y + 180, x : x + 240] == 1).all()


@pytest.mark.parametrize("factor", [1.5, 0.75])
def test_pictures_of_two_sizes(pair: Pair, factor: float) -> None:
    """The target enlarged about its pixels' corners: its camera's focal length and principal point go along."""
    size = (round(400 * factor), round(300 * factor))
    target = cv2.resize(pair.target, size, interpolation=cv2.INTER_CUBIC if factor > 1 else cv2.INTER_AREA)
    focal = pair.reference_camera.K[0, 0]
    request = CameraRequest(focal_px=(focal, factor * focal))
    result = stitch((pair.reference, target), replace(ON_REFERENCE, camera=request, measure=False))
    camera = pair.target_camera
    scaled = replace(camera, K=np.diag([factor, factor, 1]) @ camera.K, size=size)
    scaled.K[:2, 2] += (factor - 1) / 2
    matches, field = true_errors(replace(pair, target_camera=scaled), result)
    assert np.median(field) < np.median(matches) < 0.4 * max(1, factor)


def turned_jpeg(upright: np.ndarray, orientation: int) -> bytes:
    """A JPEG file of pixels that lie on their side, and the EXIF entry that says so."""
    stored = np.ascontiguousarray({6: np.rot90(upright, 1), 8: np.rot90(upright, -1)}[orientation])
    data = cv2.imencode(".jpg", stored[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    exif = b"Exif\0\0II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    return data[:2] + b"\xff\xe1" + struct.pack(">H", 2 + len(exif)) + exif + data[2:]


@pytest.mark.parametrize("orientation", [6, 8])
def test_portraits_that_lie_on_their_side_equal_upright_ones(
    small_pair: Pair, known: StitchOptions, tmp_path: Path, orientation: int
) -> None:
    upright = []
    for name, array in (("reference", small_pair.reference), ("target", small_pair.target)):
        data = turned_jpeg(np.ascontiguousarray(np.rot90(array)), orientation)
        (tmp_path / f"{name}.jpg").write_bytes(data)
        flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        stored = cv2.imdecode(np.frombuffer(data, np.uint8), flags)[..., ::-1]
        upright.append(np.ascontiguousarray(np.rot90(stored, -1 if orientation == 6 else 1)))
    assert upright[0].shape == (240, 180, 3)
    from_files = stitch((tmp_path / "reference.jpg", tmp_path / "target.jpg"), known)
    assert same(from_files, stitch(upright, known))
    canvas = from_files.warp.canvas
    assert canvas.height > 1.3 * 240 and canvas.width < 1.3 * 180, "the second place lies above the first"


def test_pictures_of_two_kinds_from_files(folder: Path, small_pair: Pair, known: StitchOptions, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    data, _ = encode_picture(decode(small_pair.target), None, 32, ".exr")
    (tmp_path / "target.exr").write_bytes(data)
    result = stitch((folder / "reference.png", tmp_path / "target.exr"), known)
    assert good(small_pair, result) and result.bits == 32


def test_brackets_are_stitched_as_one_picture_each(small_pair: Pair, known: StitchOptions, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    random = np.random.default_rng(8)
    # lights that no single exposure holds
    lights = [2 * decode(one) for one in (small_pair.reference, small_pair.target)]
    taken = [expose(light, (2.0**stops,) * 3, 0.5, False, random) for light in lights for stops in (0, -2, 2)]
    result = stitch(taken, known)
    assert good(small_pair, result) and result.bits == 32 and len(result.pictures) == 2
    about = result.report["brackets"]
    assert [len(one["names"]) for one in about] == [3, 3] and np.allclose(about[0]["stops"], (-2, 0, 2), atol=0.05)
    assert about[0]["clipped"] == 0 and result.report["options"]["brackets"] == "auto"
    assert any("6 pictures are 2 brackets of 3 exposures" in warning for warning in result.warnings)
    with OutputFiles() as files:
        write(result, OutputRequest(tmp_path / "out.exr"), files)
        write(result, OutputRequest(tmp_path / "out.hdr"), files)
    seen = [load_picture(tmp_path / f"out.{kind}").pixels for kind in ("exr", "hdr")]
    assert seen[0].max() > 1.5 and np.median(np.abs(seen[1] / np.maximum(seen[0], 1e-3) - 1)) < 0.01
    height, width = small_pair.reference.shape[:2]
    x, y = result.canvas.offset
    shown = seen[0][y : y + height, x : x + width]
    assert np.median(np.abs(shown / lights[0] - 1)) < 0.05


def test_half_a_picture_of_nothing_is_transparent_and_said(small_pair: Pair, known: StitchOptions) -> None:
    light = decode(small_pair.target)
    light[:, 200:] = np.nan
    result = stitch((decode(small_pair.reference), light), known)
    assert np.isfinite(result.pixels).all() and good(small_pair, result)
    assert any("not finite" in warning for warning in result.warnings)


# --- the same bytes ------------------------------------------------------------------------------------------------


def test_the_same_input_gives_the_same_result_whatever_opencvs_threads(
    small_pair: Pair, small_result: StitchResult, known: StitchOptions
) -> None:
    before = cv2.getNumThreads()
    try:
        for threads in (1, 2):
            cv2.setNumThreads(threads)
            again = stitch((small_pair.reference, small_pair.target), known)
            assert same(again, small_result) and again.report == small_result.report
    finally:
        cv2.setNumThreads(before)


def test_the_same_pixels_whichever_strip_is_done_first(
    small_pair: Pair, known: StitchOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Small pictures are one strip; here they are dozens, with dense refinement and all."""
    monkeypatch.setattr(arrays, "PARTS", replace(arrays.PARTS, strip_pixels=5_000))
    monkeypatch.setattr(visibility, "VISIBILITY", replace(visibility.VISIBILITY, strip_pixels=5_000))
    monkeypatch.setattr(folding, "FOLDING", replace(folding.FOLDING, strip_pixels=5_000))
    before, results = cv2.getNumThreads(), []
    try:
        for threads in (1, 3):
            cv2.setNumThreads(threads)
            results.append(stitch((small_pair.reference, small_pair.target), known))
    finally:
        cv2.setNumThreads(before)
    assert same(*results) and results[0].report == results[1].report


def test_the_same_field_gives_the_same_map_wherever_memory_lies(small_result: StitchResult) -> None:
    """OpenCV treats the ends of unaligned rows in another way: last bits may depend on where an array lies."""
    random, occupied = np.random.default_rng(0), []
    done = small_result
    first = build_map(done.field, views_of(done.edges[0].two_view, done.cameras), done.warp.canvas)
    for _ in range(16):
        occupied.append(np.empty(random.integers(1, 200_000), np.uint8))
        again = build_map(done.field, views_of(done.edges[0].two_view, done.cameras), done.warp.canvas)
        for name in ("x", "y"):
            assert np.array_equal(getattr(again.maps[1], name), getattr(first.maps[1], name), equal_nan=True), name
        assert np.array_equal(again.inverse_depth, first.inverse_depth, equal_nan=True)


def test_pictures_come_as_a_list_of_two_to_sixty(small_pair: Pair) -> None:
    for alone in ("left.jpg", Path("left.jpg"), small_pair.reference):
        with pytest.raises(BadRequest, match=r"as a list: stitch\(\[left, right\], options\)"):
            stitch(alone)  # type: ignore[arg-type]
    for count, words in ((1, "one picture alone"), (61, "61 pictures given, at most 60")):
        with pytest.raises(BadRequest, match=words):
            stitch([small_pair.reference] * count)


def test_chance_comes_from_the_seed_alone(small_pair: Pair, known: StitchOptions) -> None:
    """Whatever state other people's generators are in, the result is the same; and another seed is as good."""
    quick = replace(known, seed=7, measure=False)
    results = []
    for state in (1, 2):
        np.random.seed(state)
        cv2.setRNGSeed(state)
        results.append(stitch((small_pair.reference, small_pair.target), quick))
    assert same(*results) and good(small_pair, results[0])


# --- progress and cancel -------------------------------------------------------------------------------------------


def test_progress_climbs_through_all_stages(small_pair: Pair, known: StitchOptions) -> None:
    said: list[tuple[str, float]] = []
    stitch((small_pair.reference, small_pair.target), known, progress=lambda *step: said.append(step))
    assert [stage for stage, _ in itertools.groupby(said, key=lambda step: step[0])] == list(STAGES)
    totals = [total for _, total in said]
    assert totals[0] == 0 and totals == sorted(totals) and totals[-1] <= 1 and totals[-1] >= 0.8


def test_it_can_be_cancelled_at_every_stage(small_pair: Pair, known: StitchOptions) -> None:
    stopped_at = []
    for step in itertools.count():
        said: list[str] = []
        try:
            stitch((small_pair.reference, small_pair.target), known, lambda stage, _, said=said: said.append(stage),
                   lambda step=step, said=said: len(said) == step)  # fmt: skip
        except Cancelled as stop:
            assert stop.exit_code == 130 and len(said) == step, "no more work after the question"
            stopped_at.append(said[-1] if said else "")
        else:
            break
    assert set(stopped_at) >= {"", *list(STAGES)[:-1]}


def test_what_the_callers_own_function_raises_comes_through(small_pair: Pair) -> None:
    class Mine(Exception):
        pass

    def progress(stage: str, _: float) -> None:
        if stage == "geometry":
            raise Mine

    with pytest.raises(Mine):
        stitch((small_pair.reference, small_pair.target), progress=progress)


# --- refusals ------------------------------------------------------------------------------------------------------


def noise(seed: int, height: int, width: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def clouds(seed: int) -> np.ndarray:
    rough = cv2.GaussianBlur(np.random.default_rng(seed).random((300, 400, 3)), (0, 0), 2)
    return np.clip(255 * (rough - rough.min()) / np.ptp(rough), 0, 255).astype(np.uint8)


REFUSED = {
    "the same picture twice": ((clouds(1), clouds(1)), NoOverlap, "same picture.*choose two"),
    "a blank one": (
        (np.full((180, 240, 3), 99, np.uint8), clouds(1)), TooFewMatches,
        r"only 0 .*at least 16.*the reference \(240×180 pixels\) shows only 0 points .*choose.*--matches"),
    "a blank second": (
        (clouds(1), np.full((180, 240, 3), 99, np.uint8)), TooFewMatches, "the target .*shows only 0 points .*choose"),
    "two blank ones": ((np.zeros((60, 80)), np.ones((60, 80))), StitchError, "at least 16 needed|same picture"),
    "one pixel": ((noise(1, 1, 1), noise(2, 1, 1)), TooFewMatches, "only 0 .*choose a larger"),
    "a line": ((noise(1, 10, 20_000), noise(2, 10, 20_000)), TooFewMatches, "at least 16 needed.*try"),
    "a thread": ((noise(1, 33_000, 12), noise(2, 33_000, 12)), TooFewMatches, "at least 16 needed.*choose a larger"),
    "unrelated noise": ((noise(1, 180, 240), noise(2, 180, 240)), TooFewMatches, "at least 16 needed.*choose"),
    "unrelated clouds": ((clouds(1), clouds(2)), (TooFewMatches, NoOverlap), "needed"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_stitched_is_refused_with_advice(case: str) -> None:
    pictures, kind, words = REFUSED[case]
    with pytest.raises(kind, match=words) as refused:
        stitch(pictures)
    assert refused.value.exit_code == 3


def test_a_transparent_picture_is_refused_before_anything_is_sought() -> None:
    with pytest.raises(UnreadableImage, match="entirely transparent: export it"):
        stitch((np.dstack([clouds(1), np.zeros((300, 400), np.uint8)]), clouds(2)))


def test_chance_look_alikes_are_refused(small_pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(9)
    chance = matches.Matches(random.uniform(0, 170, (50, 2)), random.uniform(0, 170, (50, 2)))
    monkeypatch.setattr(features, "match", lambda *_: chance)
    with pytest.raises((NoOverlap, DegenerateGeometry), match="of 50 matches|50 points look alike") as refused:
        stitch((small_pair.reference, small_pair.target))
    assert refused.value.exit_code == 3


def test_pictures_that_cannot_be_read(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(UnreadableImage, match="missing.png") as refused:
        stitch((tmp_path / "missing.png", folder / "target.png"))
    assert refused.value.exit_code == 4
    (tmp_path / "cut.png").write_bytes((folder / "target.png").read_bytes()[:2000])
    with pytest.raises(UnreadableImage, match="cut.png.*damaged"):
        stitch((folder / "reference.png", tmp_path / "cut.png"))


@pytest.mark.parametrize("options", [
    {"field": "REW"}, {"field": ""}, {"fade": "slowly"}, {"scale": 1.5}, {"crop": "tight"}, {"blend": "average"},
    {"blend": "Feather"}, {"seam": "straight"}, {"seed": -1}, {"seed": 2**31},
])  # fmt: skip
def test_options_that_are_not_offered(options: dict) -> None:
    with pytest.raises(BadRequest) as refused:
        StitchOptions(**options)
    assert refused.value.exit_code == 2


@pytest.mark.parametrize("array", [
    np.zeros((4, 4, 5), np.uint8), np.zeros((0, 4, 3), np.uint8), np.zeros((4, 4, 3), np.int32), np.zeros(4, np.uint8),
    np.zeros((4, 4, 3), bool), np.full((4, 4, 3), np.nan, np.float32),
])  # fmt: skip
def test_arrays_that_are_no_pictures(array: np.ndarray, small_pair: Pair) -> None:
    with pytest.raises(BadRequest):
        stitch((array, small_pair.target))


def test_the_blend_is_the_one_asked_for(small_pair: Pair, small_result: StitchResult, known: StitchOptions) -> None:
    linear = stitch((small_pair.reference, small_pair.target), replace(known, blend="linear", exposure="none"))
    assert np.array_equal(linear.warp.maps[1].x, small_result.warp.maps[1].x)
    assert linear.report["options"]["blend"] == "linear"
    both = (linear.layers[0].alpha > 0) & (linear.layers[1].alpha > 0)
    average = (linear.layers[0].pixels + linear.layers[1].pixels)[both] / 2
    assert np.allclose(linear.pixels[both], average, atol=1e-6)
    assert not np.allclose(small_result.pixels[both], average, atol=1e-2)


# --- photographs ---------------------------------------------------------------------------------------------------


# One homography's overlap PSNR in dB on the same pairs (FIELD): what parallax costs whoever ignores it.
@pytest.mark.parametrize(("name", "homography"), [("DHW-temple", 20.97), ("DFW_desk", 25.51)])
def test_photographs_align_better_than_by_a_homography(data: Path, name: str, homography: float) -> None:
    result = stitch(sorted((data / "pairs" / name).iterdir()))
    measured = result.report["measured"]
    assert measured["overlap_psnr_db"] > homography + 2
    assert measured["alignment_median_px"] < 1 and measured["folds"] < 0.005
    assert result.report["two_view"]["focal_source"].startswith("EXIF")


def test_a_pair_that_somebody_else_calibrated(data: Path) -> None:
    """Fountain (Strecha et al. 2008) at half size: the pose from its matches against the published one."""
    table = json.loads((data / "calibrated" / "fountain-P11" / "cameras.json").read_text("utf-8"))["cameras"]
    names = ("0005.jpg", "0006.jpg")
    images = [cv2.imread(str(data / "calibrated" / "fountain-P11" / name))[..., ::-1] for name in names]
    halves = [cv2.resize(np.ascontiguousarray(image), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
              for image in images]  # fmt: skip
    cameras = []
    for name in names:
        K, R, t = (np.array(table[name][key]) for key in "KRt")
        K[:2] /= 2
        K[:2, 2] -= 0.25  # pixel centres are integers before and after
        cameras.append(SceneCamera(K, R, t, halves[0].shape[1::-1]))
    given = {"cameras": {role: {"K": c.K.tolist()} for role, c in zip(("reference", "target"), cameras, strict=True)}}
    result = stitch(halves, replace(ON_REFERENCE, camera=CameraRequest(cameras=given), measure=False))
    errors = pose_errors(result.edges[0].two_view, TrueGeometry.of(*cameras), cameras[1].size)
    assert errors["h_inf_px"] < 0.79, "PoseLib's median over 14 such pairs (FIELD)"
    assert errors["rotation_deg"] < 0.1 and errors["baseline_deg"] < 1 and errors["f_px"] < 1


@pytest.mark.slow
def test_a_pair_wider_than_opencv_can_hold() -> None:
    def strip(seed: int) -> np.ndarray:
        rough = np.random.default_rng(seed).integers(0, 256, (30, 8300), dtype=np.uint8)
        return cv2.resize(rough, (33_200, 120), interpolation=cv2.INTER_CUBIC)

    far, near = strip(1), strip(2)
    first = np.vstack([far[:60, 100:33_100], near[60:, 100:33_100]])
    second = np.vstack([far[:60, 110:33_110], near[60:, 130:33_130]])
    result = stitch((first, second), replace(ON_REFERENCE, camera=CameraRequest(focal_px=(20_000.0,))))
    assert result.warp.canvas.width > 33_000 and result.report["measured"]["overlap_px"] > 3_000_000


def test_make_pair_is_the_fixture(pair: Pair) -> None:
    """Guards the bounds above: they were worked out for this pair."""
    assert np.array_equal(make_pair(40, 30).reference_camera.K[:2, :2] * 10, pair.reference_camera.K[:2, :2])
