"""stitch() of more than two pictures, against the cameras that took them."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core import pipeline
from edf_stitch.core.cameras.lens import distort
from edf_stitch.core.cameras.projective import distance_to_line, project, rotation_angle, rotation_from_vector
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.frames import preview
from edf_stitch.core.frames.options import PREVIEW
from edf_stitch.core.measure.metrics import psnr
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.output.camera_file import camera_table
from edf_stitch.core.output.depth.range_image import range_image
from edf_stitch.core.output.match_table import match_file
from edf_stitch.core.output.outputs import OutputRequest, check, write
from edf_stitch.core.output.warp_file import warp_bytes
from edf_stitch.core.panorama.layers import layer_of
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.pose import features
from edf_stitch.core.raster.colour import encode
from edf_stitch.core.system.errors import BadRequest, Cancelled, NoOverlap
from edf_stitch.core.system.json_values import plain
from edf_stitch.core.system.output_files import OutputFiles

from ..conftest import camera_of
from ..sets import FOCAL, PictureSet, make_set

KNOWN = StitchOptions(camera=CameraRequest(focal_px=(FOCAL,)), blend="feather", dense=False)


@pytest.fixture(scope="session")
def four() -> PictureSet:
    return make_set()


@pytest.fixture(scope="session")
def kept(tmp_path_factory: pytest.TempPathFactory) -> StitchOptions:
    """KNOWN where what one stitch has found is kept for the next: for tests of what becomes of it."""
    return replace(KNOWN, cache=tmp_path_factory.mktemp("kept"))


@pytest.fixture(scope="session")
def set_result(four: PictureSet, kept: StitchOptions) -> StitchResult:
    return stitch(four.pictures, kept)


def numbers_of(result: StitchResult) -> list[int]:
    """The pictures of a result by their numbers in the set."""
    return [int(picture.name.removesuffix(".png")) - 1 for picture in result.pictures]


def pose_errors(four: PictureSet, result: StitchResult) -> tuple[float, float]:
    """The largest error of a rotation, in degrees, and of a place, as a share of the longest baseline."""
    cameras = [four.cameras[number] for number in numbers_of(result)]
    first, rig = cameras[0], result.rig
    assert rig is not None
    true = np.array([first.R @ (camera.place - first.place) for camera in cameras])
    turns = [rotation_angle(view.R, camera.R @ first.R.T) for view, camera in zip(result.views, cameras, strict=True)]
    scale = (rig.centres * true).sum() / (rig.centres**2).sum()
    off = np.linalg.norm(scale * rig.centres - true, axis=1).max()
    return float(np.max(turns)), float(off / np.linalg.norm(true, axis=1).max())


@pytest.fixture(scope="module")
def larger() -> tuple[PictureSet, StitchResult]:
    """Pictures large enough for errors of features to say little."""
    pictures = make_set(size=(400, 300))
    return pictures, stitch(pictures.pictures, KNOWN)


def test_cameras_are_found_as_they_stood(larger: tuple[PictureSet, StitchResult]) -> None:
    turned, moved = pose_errors(*larger)
    assert turned < 0.2 and moved < 0.02


def test_one_panorama_shows_all_and_misses_no_match(set_result: StitchResult) -> None:
    assert {len(part) for part in (set_result.pictures, set_result.views, set_result.layers, set_result.decided)} == {4}
    assert set(np.unique(set_result.labels)) >= {0, 1, 2, 3}
    measured = set_result.report["measured"]
    assert measured["alignment_median_px"] < 0.5 and measured["folds"] < 0.01
    assert set_result.report["verdict"]["is"] == "good" and not set_result.warnings


@pytest.fixture(scope="module")
def dense_result(four: PictureSet, kept: StitchOptions) -> StitchResult:
    return stitch(four.pictures, replace(kept, dense=True))


def test_dense_refinement_makes_the_pictures_agree(dense_result: StitchResult, set_result: StitchResult) -> None:
    """Every pixel is searched for: the layers show the same, and where they do not is told."""
    apart = []
    for result in (set_result, dense_result):
        first, second = (np.asarray(layer.pixels) for layer in result.layers[:2])
        both = (np.asarray(result.layers[0].alpha) > 0.99) & (np.asarray(result.layers[1].alpha) > 0.99)
        apart.append(float(np.abs(first - second).mean(axis=-1)[both].mean()))
    assert apart[1] < 0.97 * apart[0]  # of two planes the smooth field is nearly right
    entry = dense_result.report["field"]["dense"]
    assert entry["used"] and 0.5 < entry["found"] <= 1
    assert (dense_result.confidence > 0.5).mean() > 0.2 and not set_result.confidence.any()
    assert set_result.report["field"]["dense"] == {"used": False, "why": "not asked for"}


def test_another_order_makes_the_same_dense_panorama(
    four: PictureSet, kept: StitchOptions, dense_result: StitchResult
) -> None:
    order = [0, 3, 2, 1]
    other = stitch([four.pictures[number] for number in order], replace(kept, dense=True))
    assert numbers_of(other) == order
    one, same = (encode(result.pixels, 8) for result in (dense_result, other))
    assert one.shape == same.shape and psnr(one, same, np.ones(one.shape[:2], bool)) > 45


def test_a_dense_panorama_slides_as_well(four: PictureSet, kept: StitchOptions, dense_result: StitchResult) -> None:
    slid = stitch(four.pictures, replace(kept, dense=True, slide=1.0))
    assert slid.warp.viewpoint is not None and np.isfinite(slid.warp.inverse_depth).all()
    measured = slid.report["measured"]
    assert measured["alignment_median_px"] < 0.5 and measured["folds"] < 0.02
    assert measured["alignment_median_px"] < 1.5 * dense_result.report["measured"]["alignment_median_px"] + 0.05


def test_every_edge_has_the_rigs_geometry_and_the_matches_that_agree(set_result: StitchResult) -> None:
    assert len(set_result.edges) >= 3
    for edge in set_result.edges:
        inliers = edge.inliers
        assert len(inliers) > 30
        assert np.median(distance_to_line(edge.two_view.F, inliers.x, inliers.y)) < 0.5
        assert set_result.used_of(edge).sum() == len(inliers)


def test_the_order_changes_names_only(four: PictureSet, set_result: StitchResult) -> None:
    order = [2, 0, 3, 1]
    other = stitch([four.pictures[number] for number in order], replace(KNOWN, viewpoint="1.png"))
    assert numbers_of(other) == [0, 2, 3, 1], "the viewpoint first, the others as given"
    assert pose_errors(four, other) == pytest.approx(pose_errors(four, set_result), abs=1e-6)
    back = [numbers_of(other).index(number) for number in range(4)]
    np.testing.assert_allclose(np.stack([view.R for view in other.views])[back], set_result.rig.R, atol=1e-9)
    np.testing.assert_allclose(other.rig.t[back], set_result.rig.t, atol=1e-9)
    assert len(other.rig.rays) == len(set_result.rig.rays)


def test_it_is_seen_from_the_picture_that_is_asked_for(four: PictureSet, kept: StitchOptions) -> None:
    third = stitch(four.pictures, replace(kept, viewpoint=3))
    assert numbers_of(third) == [2, 0, 1, 3]
    assert not third.rig.t[0].any()
    turned, moved = pose_errors(four, third)
    assert turned < 0.2 and moved < 0.02
    assert third.report["options"]["viewpoint"] == 3 and third.report["options"]["fade"] == kept.fade


@pytest.mark.slow
def test_a_distance_between_two_pictures_makes_metres_of_baselines(four: PictureSet, set_result: StitchResult) -> None:
    places = [camera.place for camera in four.cameras]
    apart = float(np.linalg.norm(places[3] - places[1]))
    result = stitch(four.pictures, replace(KNOWN, scale_metres=("2.png", 4, apart)))
    longest = max(np.linalg.norm(place - places[0]) for place in places)
    assert result.scale.metres == pytest.approx(longest, rel=0.03)
    told = result.report["depth"]
    assert told["unit"] == "metres" and told["metres_per_baseline"] == result.scale.metres
    assert result.report["options"]["scale_metres"] == ["2.png", 4, apart]
    assert set_result.report["depth"] == {"unit": "baselines", "metres_per_baseline": None,
                                          "source": "pictures alone do not tell it"}
    again = stitch(four.pictures, StitchOptions(
        camera=CameraRequest(cameras=plain(camera_table(result))), blend="feather", dense=False
    ))
    assert again.scale.metres == pytest.approx(result.scale.metres, rel=1e-3), "the file of cameras is in metres too"
    with pytest.raises(BadRequest, match="only 4 are given"):
        stitch(four.pictures, replace(KNOWN, scale_metres=(1, 5, 2.0)))


def test_depth_and_mesh_of_a_set_are_written(set_result: StitchResult, tmp_path: Path) -> None:
    asked = OutputRequest(tmp_path / "out.png", depth=tmp_path / "d.exr", mesh=tmp_path / "m.glb")
    with OutputFiles() as files:
        check(asked, files, [picture.name for picture in set_result.pictures])
        write(set_result, asked, files)
    assert {path.name for path in tmp_path.iterdir()} == {"out.png", "d.exr", "m.glb"}
    image = range_image(set_result)
    assert image.range.shape == set_result.alpha.shape and image.deviation is not None
    shown = set_result.alpha > 0
    assert np.isfinite(image.range[shown]).mean() > 0.9 and np.isnan(image.range[~shown]).all()


@pytest.mark.parametrize("count", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_a_preview_is_small_and_the_full_panorama_has_its_geometry(
    larger: tuple[PictureSet, StitchResult], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    """Nothing is found twice, and the full one is that of a call without a preview before it."""
    pictures = larger[0].pictures[:count]
    options = replace(KNOWN, projection="cylindrical", cache=tmp_path)
    for number in (preview, pipeline):
        monkeypatch.setattr(number, "PREVIEW", replace(PREVIEW, pixels=30_000, least_pixels=20_000, most_pixels=45_000))
    small = stitch(pictures, replace(options, preview=True))
    height, width = small.alpha.shape
    assert 20_000 < width * height < 45_000 and small.report["options"]["preview"]
    found: list[str] = []
    real = features.detect
    monkeypatch.setattr(features, "detect", lambda *asked: found.append("features") or real(*asked))
    full = stitch(pictures, options)
    assert not found, "its features are kept"
    assert np.array_equal(full.panorama.pixels, stitch(pictures, replace(options, cache=None)).pixels)
    assert full.alpha.size > 2 * small.alpha.size
    for one, other in zip(small.views, full.views, strict=True):
        np.testing.assert_array_equal(one.R, other.R)
        np.testing.assert_array_equal(one.t, other.t)
    shown = [
        cv2.resize(one.alpha * one.pixels[..., 1], (80, 30), interpolation=cv2.INTER_AREA) for one in (small, full)
    ]
    assert np.abs(shown[0] - shown[1]).mean() < 0.03 * shown[1].mean() + 0.02, "it shows the same"


def test_a_preview_whose_size_was_guessed_wrong_is_made_once(
    four: PictureSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = replace(PREVIEW, pixels=30_000, least_pixels=20_000, most_pixels=45_000)
    for number in (preview, pipeline):
        monkeypatch.setattr(number, "PREVIEW", sizes)
    guessed, told = pipeline.first_share, list[float]()
    monkeypatch.setattr(pipeline, "first_share", lambda *known: 1.5 * guessed(*known))
    options = replace(KNOWN, projection="cylindrical", preview=True)
    small = stitch(four.pictures[:2], options, lambda _, share: told.append(share))
    assert 20_000 < small.alpha.size < 45_000
    assert told == sorted(told), "nothing is told twice"


@pytest.mark.slow
def test_a_picture_that_does_not_belong_is_left_out_and_named(four: PictureSet) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (60, 80, 3)).astype(np.uint8)
    stranger = picture_from_array(cv2.resize(noise, (320, 240), interpolation=cv2.INTER_CUBIC), "stranger.png")
    given = [stranger, *four.pictures[:3], four.pictures[1]]
    result = stitch(given, KNOWN)
    assert numbers_of(result) == [0, 1, 2]
    assert [entry["name"] for entry in result.report["left_out"]] == ["stranger.png"]
    assert any("stranger.png is left out" in warning for warning in result.warnings)
    assert any("2.png is given twice" in warning for warning in result.warnings)
    assert result.report["verdict"]["is"] == "look" and "stranger.png" in result.report["verdict"]["because"]
    with pytest.raises(NoOverlap, match="stranger.png: connects to no other picture"):
        stitch(given, replace(KNOWN, require_all=True))
    with pytest.raises(NoOverlap, match="stranger.png cannot be the viewpoint"):
        stitch(given, replace(KNOWN, viewpoint=1))
    only_two = stitch([stranger, *four.pictures[:2]], KNOWN)
    assert only_two.rig is None and numbers_of(only_two) == [0, 1], "two that connect are a pair"
    assert only_two.report["left_out"][0]["name"] == "stranger.png" and "two_view" in only_two.report
    with pytest.raises(NoOverlap):
        stitch([stranger, picture_from_array(stranger.view[::-1].copy(), "s.png"), four.pictures[0]], KNOWN)


def test_cameras_that_were_written_are_held(
    four: PictureSet, kept: StitchOptions, set_result: StitchResult
) -> None:
    table = plain(camera_table(set_result))
    again = stitch(four.pictures, replace(kept, camera=CameraRequest(cameras=table)))
    for view, before in zip(again.views, set_result.views, strict=True):
        np.testing.assert_allclose(view.K, before.K, rtol=1e-12)
        np.testing.assert_allclose(view.R, before.R, atol=1e-9)
        np.testing.assert_allclose(view.t, before.t, atol=1e-9)
    assert all(one["camera"]["source"] == "camera file" for one in again.report["pictures"])


def test_poses_of_some_pictures_are_held_in_whatever_frame(
    four: PictureSet, kept: StitchOptions, set_result: StitchResult
) -> None:
    table = plain(camera_table(set_result))["cameras"]
    turn, half = rotation_from_vector(np.array([0.1, 0.4, 0.2])), {}
    for name in ("1.png", "3.png"):
        R, t = np.array(table[name]["R"]) @ turn.T, np.array(table[name]["t"])
        half[name] = {**table[name], "R": R, "t": 3 * (t - R @ [1, 2, 3])}
    again = stitch(four.pictures, replace(kept, camera=CameraRequest(cameras={"cameras": half})))
    for number, (view, before) in enumerate(zip(again.views, set_result.views, strict=True)):
        given = number in (0, 2)
        np.testing.assert_allclose(view.R, before.R, atol=1e-9 if given else 5e-3)
        np.testing.assert_allclose(view.t, before.t, atol=5e-3)
        assert (view.camera.source == "camera file") == given


def test_sizes_depths_and_colours_may_differ_in_one_set(four: PictureSet) -> None:
    second, third, fourth = (picture.view for picture in four.pictures[1:])
    mixed = [
        four.pictures[0],
        picture_from_array(cv2.resize(second, (480, 360), interpolation=cv2.INTER_CUBIC), "2.png"),
        picture_from_array(third.astype(np.uint16) * 257, "3.png"),
        picture_from_array(cv2.cvtColor(fourth, cv2.COLOR_RGB2GRAY), "4.png"),
    ]
    K = {"2.png": np.array([[1.5 * FOCAL, 0, 239.5], [0, 1.5 * FOCAL, 179.5], [0, 0, 1]]), "1.png": four.cameras[0].K}
    known = {name: {"K": one.tolist()} for name, one in K.items()}
    result = stitch(mixed, replace(KNOWN, camera=CameraRequest(cameras={"cameras": known}), blend="linear"))
    turned, moved = pose_errors(four, result)
    assert turned < 0.4 and moved < 0.03
    assert result.bits == 16 and result.pixels.shape[2] == 3 and result.labels is None
    assert result.report["measured"]["alignment_median_px"] < 0.5


def test_matches_that_were_written_make_the_same_rig(
    larger: tuple[PictureSet, StitchResult], tmp_path: Path
) -> None:
    pictures, first = larger
    (tmp_path / "m.csv").write_bytes(match_file(first))
    again = stitch(pictures.pictures, replace(KNOWN, matches=tmp_path / "m.csv"))
    np.testing.assert_allclose(again.rig.R, first.rig.R, atol=1e-3)
    np.testing.assert_allclose(again.rig.t, first.rig.t, atol=1e-2)
    assert len(again.edges) == len(first.edges)


def test_given_matches_that_contradict_each_other_are_told_and_not_good(
    four: PictureSet, set_result: StitchResult, tmp_path: Path
) -> None:
    random, lines = np.random.default_rng(0), ["picture,picture2,x,y,x2,y2"]
    wrong = 0
    for edge in set_result.edges:
        one, other = (set_result.pictures[number].name for number in (edge.i, edge.j))
        used = edge.matches.subset(edge.two_view.inliers).thinned(120)
        width, height = set_result.cameras[edge.j].size
        for x, y in zip(used.x, used.y, strict=True):
            if random.random() < 0.3:
                y, wrong = random.uniform((0, 0), (width - 1, height - 1)), wrong + 1
            lines.append(f"{one},{other},{x[0]},{x[1]},{y[0]},{y[1]}")
    (tmp_path / "m.csv").write_text("\n".join(lines))
    result = stitch(four.pictures, replace(KNOWN, matches=tmp_path / "m.csv"))
    verdict, matches = result.report["verdict"], result.report["matches"]
    assert 0.8 * wrong <= matches["contradicting"] <= 1.5 * wrong
    assert verdict["is"] == "look" and "given matches contradict the rest" in verdict["because"]
    assert any("given matches contradict the rest and are left out" in warning for warning in result.warnings)
    assert set_result.report["matches"]["contradicting"] == 0


def test_warp_and_layers_hold_every_picture(set_result: StitchResult, tmp_path: Path) -> None:
    with np.load(io.BytesIO(warp_bytes(set_result))) as warp:
        assert warp["R"].shape == (4, 3, 3) and warp["t"].shape == (4, 3) and warp["dist"].shape == (4, 5)
        assert warp["F"].shape == (len(set_result.edges), 3, 3)
        assert warp["edges"].tolist() == [[edge.i, edge.j] for edge in set_result.edges]
        for number in range(4):
            x, y, width, height = warp[f"box_{number:02d}"]
            assert warp[f"map_x_{number:02d}"].shape == (height, width)
            whole = set_result.warp.maps[number].arrays().x[y : y + height, x : x + width]
            np.testing.assert_array_equal(warp[f"map_x_{number:02d}"], whole)
    request = OutputRequest(tmp_path / "o.png", tmp_path / "r.json", tmp_path / "layers")
    with OutputFiles() as files:
        check(request, files, [picture.name for picture in set_result.pictures])
        write(set_result, request, files)
    named = {path.name for path in (tmp_path / "layers").iterdir()}
    assert {"00_1.png", "03_4.png", "labels.png", "occluded_03.png", "canvas.json"} <= named
    assert "seam.png" not in named, "it says reference or target"
    labels = cv2.imread(str(tmp_path / "layers" / "labels.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(labels, set_result.labels + 1)
    page = (tmp_path / "r.html").read_text("utf-8")
    assert page.count("<image ") == 4 and page.count("<line ") == len(set_result.edges)


def test_pictures_are_fetched_by_the_root_of_light(four: PictureSet, kept: StitchOptions) -> None:
    result = stitch(four.pictures, replace(kept, crop="full"))
    for picture, one, layer in zip(result.pictures, result.warp.maps, result.layers, strict=True):
        np.testing.assert_array_equal(layer.pixels, layer_of(picture, one, by_root=True).pixels)


@pytest.mark.parametrize("slide", [0.0, 1.0])
def test_the_maps_can_be_made_again_from_the_warps_file(
    four: PictureSet, kept: StitchOptions, slide: float
) -> None:
    """By the equation that docs/formats.md gives, wherever the viewpoint is."""
    options = replace(kept, field="strict", slide=slide, projection="cylindrical")
    with np.load(io.BytesIO(warp_bytes(stitch(four.pictures[:3], options)))) as file:
        warp = dict(file)
    width, height = warp["canvas"]
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (x - warp["centre"][0]) / warp["focal"], (y - warp["centre"][1]) / warp["focal"]
    rays = np.stack([np.sin(x), y, np.cos(x)], axis=-1)
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ warp["rotation"].T
    moved = rays
    assert ("places" in warp) == bool(slide)
    if slide:
        assert warp["s1"] == slide and "slide" not in warp
        own = rays @ warp["upright"]
        at = (np.arctan2(own[..., 0], own[..., 2]) + np.pi) * len(warp["places"]) / (2 * np.pi)
        before = np.floor(at).astype(int)
        share, places = (at - before)[..., None], warp["places"]
        near, far = places[before % len(places)], places[(before + 1) % len(places)]
        moved = rays + warp["inverse_depth"][..., None] * (near + share * (far - near))
    for number in range(3):
        left, top, w, h = warp[f"box_{number:02d}"]
        part = np.s_[top : top + h, left : left + w]
        q = moved[part] @ warp["R"][number].T + warp["inverse_depth"][part][..., None] * warp["t"][number]
        camera = replace(camera_of((320, 240), 1.0, tuple(warp["dist"][number])), K=warp["K"][number])
        made = distort(project(q @ camera.K.T), camera)
        values = np.stack([warp[f"map_{axis}_{number:02d}"] for axis in "xy"], axis=-1)
        known = np.isfinite(values).all(axis=-1) & (q[..., 2] > 0.1)
        assert known.mean() > 0.5
        np.testing.assert_allclose(made[known], values[known], atol=0.02)


def test_it_stops_soon_after_it_is_asked_to(four: PictureSet, tmp_path: Path) -> None:
    """At each stage; what stages before it found is kept, what is interrupted is not."""
    options = replace(KNOWN, cache=tmp_path)
    for wanted in ("features", "matches", "geometry", "field", "warp", "seam"):
        stage = ""

        def tell(name: str, _: float) -> None:
            nonlocal stage
            stage = name

        with pytest.raises(Cancelled):
            stitch(four.pictures[:3], options, tell, lambda wanted=wanted: stage == wanted)  # type: ignore[misc]  # noqa: B023


def test_whether_to_go_on_is_asked_at_every_picture_of_field_and_maps(four: PictureSet) -> None:
    """Between steps a cancel waits: no step may be as long as all pictures together."""
    asked: list[str] = []
    stage = ""

    def tell(name: str, share: float) -> None:
        nonlocal stage
        stage = name

    def cancelled() -> bool:
        asked.append(stage)
        return False

    stitch(four.pictures, KNOWN, tell, cancelled)
    # field: two splines, their anchors, and every picture's slack; maps: edges and depth of every picture, each slide
    assert asked.count("field") > 5 + 4 and asked.count("warp") > 4 + 4 + 5
