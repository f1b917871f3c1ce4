"""Errors of a stitch of a set are measured in the units they are named by, and the truth has none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.synthetic_scenes.sets.set_measures import (
    Found,
    SetTruth,
    colour_figures,
    common_rotation,
    map_figures,
    on_the_sphere,
    onto,
    pose_figures,
    range_figures,
)
from edf_stitch.synthetic_scenes.sets.set_sliding import beside_figures
from edf_stitch.synthetic_scenes.sets.top_view import top_view

from .perfect_stitch import TURN, analytic_truth, perfect


@pytest.fixture(scope="module")
def truth() -> SetTruth:
    return analytic_truth()


def moved(result: Any, number: int, by: float) -> None:
    one = result.warp.maps[number]
    result.warp.maps[number] = replace(one, x=one.x + np.float32(by))


def test_the_truth_has_no_error(truth: SetTruth) -> None:
    found = Found.of(perfect(truth), truth)
    assert np.allclose(found.gauge, TURN)
    poses = pose_figures(found)
    assert poses["places"] == 3 and all(abs(poses[name]) < 1e-4 for name in poses if name != "places"), poses
    maps, pictures = map_figures(found)
    assert max(maps["overlap_px"], maps["alone_px"]) < 0.02 and maps["overlap_p90_px"] < 0.1 and maps["mapped"] > 0.99
    assert [line["picture"] for line in pictures] == [0, 1, 2]
    assert range_figures(found)["range_log"] < 1e-3 and range_figures(found)["range_log_p90"] < 0.01
    light, shown = on_the_sphere(found)
    where = shown & (truth.views_at(found.numbers) > 0)
    assert where.sum() > 0.97 * (truth.views_at(found.numbers) > 0).sum()
    figures, _ = colour_figures(light * np.float32(0.8), where, truth)
    assert figures["psnr_db"] > 30 and figures["ssim"] > 0.95, "one gain is allowed for"
    assert colour_figures(np.roll(light, 3, axis=1), where, truth)[0]["psnr_db"] < figures["psnr_db"] - 5


def test_poses_are_judged_after_the_common_turn_and_similarity(truth: SetTruth) -> None:
    result = perfect(truth)
    result.rig.R[1] = rotation_from_vector(np.radians([0, 0.3, 0])) @ result.rig.R[1]
    poses = pose_figures(Found.of(result, truth))
    assert poses["rotation_max_deg"] == pytest.approx(0.2, abs=1e-3), "two thirds: the others take their share"
    assert poses["rotation_deg"] == pytest.approx(0.1, abs=1e-3)
    result = perfect(truth)
    result.rig.centres[2] += [0, 0.02, 0]  # 1 cm
    worst = pose_figures(Found.of(result, truth))["position_max_mm"]
    assert 1 < worst < 10
    result = perfect(truth)
    result.rig.cameras = tuple(replace(camera, K=camera.scaled(1.02)) for camera in result.rig.cameras)
    assert pose_figures(Found.of(result, truth))["focal_percent"] == pytest.approx(2.0)
    bent = [replace(camera, k1=-0.08) for camera in truth.rendered.cameras]
    known = Found.of(result, replace(truth, rendered=replace(truth.rendered, cameras=tuple(bent))))
    assert pose_figures(known)["k1_error"] == pytest.approx(0.08), "it was not found"
    result.rig.t = np.zeros((3, 3))
    assert pose_figures(Found.of(result, truth))["places"] == 1
    result.rig.edges = tuple(SimpleNamespace(baseline=known) for known in ("measured", "continuity", "none"))
    assert pose_figures(Found.of(result, truth))["guessed_lengths"] == 1


def test_maps_are_judged_where_several_one_or_no_camera_sees(truth: SetTruth) -> None:
    result = perfect(truth)
    for number in range(3):
        moved(result, number, 0.75)
    maps, pictures = map_figures(Found.of(result, truth))
    for kind in ("overlap", "alone", "hidden"):
        assert maps[f"{kind}_px"] == pytest.approx(0.75, abs=0.02), kind
    moved(result, 2, 1.0)
    _, pictures = map_figures(Found.of(result, truth))
    assert [line["overlap_px"] for line in pictures] == pytest.approx([0.75, 0.75, 1.75], abs=0.02)
    views = truth.views_at((0, 1, 2))
    alone = views == 1
    assert alone.any() and (views >= 2).any()
    only = perfect(truth, numbers=(0,))
    assert np.isnan(map_figures(Found.of(only, truth))[0]["overlap_px"]), "one picture has no overlap"


def test_ranges_are_judged_in_metres_by_the_scale_of_the_places(truth: SetTruth) -> None:
    result = perfect(truth, unit=2.0)
    result.warp.inverse_depth = result.warp.inverse_depth * 1.1
    figures = range_figures(Found.of(result, truth))
    assert figures["range_log"] == pytest.approx(np.log(1.1), abs=1e-3)
    result.warp.inverse_depth = result.warp.inverse_depth * np.where(result.warp.deviation < 0.015, 1 / 1.1, 1.0)
    result.warp.confidence = np.where(result.warp.deviation < 0.015, 0.6, 0.4).astype(np.float32)
    figures = range_figures(Found.of(result, truth))
    assert figures["range_log_confident"] < 1e-3 and 0.1 < figures["confident"] < 0.9, "the half that it is sure of"
    result.warp.inverse_depth = np.where(result.warp.deviation < 0.015, result.warp.inverse_depth, -1.0)
    figures = range_figures(Found.of(result, truth))
    assert figures["range_log_p90"] == np.inf, "behind the viewpoint nothing is in the right place"
    result.rig.centres = np.zeros((3, 3))
    assert np.isnan(range_figures(Found.of(result, truth))["range_log"])


def test_the_similarity_and_the_common_rotation_are_found_again() -> None:
    random = np.random.default_rng(3)
    points = random.normal(size=(6, 3))
    true = 2.5 * points @ TURN.T + [1, 2, 3]
    placed, scale = onto(points, true)
    assert np.allclose(placed, true) and scale == pytest.approx(2.5)
    mirrored, _ = onto(points * [1, 1, -1], true)
    assert not np.allclose(mirrored, true, atol=0.1), "a mirror image is another place"
    one, none = onto(np.zeros((6, 3)), true)
    assert none == 0 and np.allclose(one, true.mean(axis=0))
    rotations = np.array([rotation_from_vector(vector) for vector in random.normal(size=(5, 3))])
    assert np.allclose(common_rotation(rotations @ TURN.T, rotations), TURN)


def test_the_view_from_above_shows_true_and_found_places(truth: SetTruth) -> None:
    drawn = top_view(Found.of(perfect(truth), truth))
    result = perfect(truth)
    result.rig.centres[2] += [0.2, 0, 0]
    other = top_view(Found.of(result, truth))
    assert drawn.shape == (720, 720, 3) and (drawn != 255).any() and (drawn != other).any()


@pytest.mark.parametrize("aside", [(0.0, 0.0, 0.0), (0.2, -0.1, 0.05)])
def test_what_pictures_show_lies_on_the_rays_of_wherever_the_viewpoint_is(
    aside: tuple[float, float, float], truth: SetTruth
) -> None:
    right = beside_figures(Found.of(perfect(truth, aside=aside), truth))
    assert right["beside_px"] < 0.02
    # nothing is said to be hidden by the ball
    assert right["beside_p95_px"] < 20
    one = perfect(truth, aside=aside)
    moved(one, 1, 40.0)
    assert beside_figures(Found.of(one, truth))["beside_p95_px"] > 35
    off = perfect(truth, aside=aside)
    for number in range(3):
        moved(off, number, 2.0)
    assert beside_figures(Found.of(off, truth))["beside_px"] == pytest.approx(2.0, abs=0.1)
    elsewhere = perfect(truth, aside=aside)
    place = elsewhere.warp.viewpoint.places + TURN @ np.array([0.4, 0.0, 0.0])
    elsewhere.warp.viewpoint = replace(elsewhere.warp.viewpoint, places=place)
    assert beside_figures(Found.of(elsewhere, truth))["beside_px"] > 1


def test_what_one_camera_alone_sees_is_not_asked_for(truth: SetTruth) -> None:
    assert np.isnan(beside_figures(Found.of(perfect(truth, numbers=(1,)), truth))["beside_px"])
