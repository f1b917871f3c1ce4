"""Lines that are bent, things that are cut and borders that show are found in panoramas, and only those."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.synthetic_scenes.sets.set_lines import (
    WorldLines,
    is_there,
    line_figures,
    pixels_of,
    points_along,
    shown_at,
    straightness,
)
from edf_stitch.synthetic_scenes.sets.set_measures import Found, SetTruth
from edf_stitch.synthetic_scenes.sets.set_names import SET_MEASURES
from edf_stitch.synthetic_scenes.sets.set_seams import seam_figures, seam_steps
from edf_stitch.synthetic_scenes.sets.set_sliding import sliding_figures
from edf_stitch.synthetic_scenes.sets.set_things import half, shown_things, thing_figures

from .analytic_room import BALL
from .perfect_stitch import TURN, analytic_truth, perfect


@pytest.fixture(scope="module")
def truth() -> SetTruth:
    return analytic_truth()


def figures_of(result: Any, truth: SetTruth) -> dict[str, float]:
    return line_figures(Found.of(result, truth))


def bend(result: Any, number: int, by: float, over: float = 20.0) -> None:
    """Waves of so many px of a picture, along its lines and columns, in what its map fetches."""
    one = result.warp.maps[number]
    x, y = (np.float32(by) * np.sin(along / np.float32(over)) for along in (one.y, one.x))
    result.warp.maps[number] = replace(one, x=one.x + x, y=one.y + y)


def test_the_edges_of_the_world_are_straight_and_upright_where_nothing_is_wrong(truth: SetTruth) -> None:
    figures = figures_of(perfect(truth), truth)
    assert figures["lines"] >= 5 and figures["uprights"] >= 2
    assert figures["line_p90_px"] < 0.1 and figures["picture_line_p90_px"] < 0.1 and figures["upright_p90_deg"] < 0.1


def test_a_picture_whose_map_waves_bends_what_it_shows(truth: SetTruth) -> None:
    result = perfect(truth)
    for number in range(3):
        bend(result, number, 1.5)
    figures = figures_of(result, truth)
    # pictures have about as many px a radian as the panorama
    assert 0.7 < figures["picture_line_p90_px"] < 3 and 0.7 < figures["line_p90_px"] < 3


def test_a_border_across_an_edge_breaks_it_in_the_panorama_and_in_no_picture(truth: SetTruth) -> None:
    result = perfect(truth)
    first, second = result.warp.maps[:2]
    with np.errstate(invalid="ignore"):
        inside = (second.x >= 0) & (second.x <= 119) & (second.y >= 0) & (second.y <= 89)
    middle = np.flatnonzero((result.labels == 0).any(axis=0)).mean()
    result.labels = np.where(inside & (np.arange(inside.shape[1]) > middle), 1, result.labels).astype(np.int16)
    before = figures_of(result, truth)
    result.warp.maps[0] = replace(first, y=first.y + np.float32(3.0))
    after = figures_of(result, truth)
    assert before["line_p90_px"] < 0.1 and after["line_p90_px"] > 0.7
    assert after["picture_line_p90_px"] < 0.1, "all of a picture is lower"


def test_uprights_lean_as_far_as_the_panorama_is_turned(truth: SetTruth) -> None:
    found = Found.of(perfect(truth), truth)
    leaning = replace(found, gauge=TURN @ rotation_from_vector(np.radians([0.0, 2.0, 0.0])))
    figures = line_figures(leaning)
    assert 0.5 < figures["upright_p90_deg"] < 2.1 and figures["line_p90_px"] < 0.1, "leaning, but straight"


def test_edges_are_followed_where_the_viewpoint_slides_too(truth: SetTruth) -> None:
    still, slid = perfect(truth), perfect(truth, aside=(0.2, -0.1, 0.05))
    figures = sliding_figures(Found.of(still, truth), Found.of(slid, truth))
    assert figures["s1"] == 0.5 and figures["slid_line_p90_px"] < 0.1 and figures["slid_upright_p90_deg"] < 0.1
    for number in range(3):
        bend(slid, number, 1.5)
    bent = sliding_figures(Found.of(still, truth), Found.of(slid, truth))
    assert 0.7 < bent["slid_line_p90_px"] < 3 and bent["slid_beside_px"] > 0.3
    assert bent["still_beside_px"] == figures["still_beside_px"] < 0.02
    assert set(bent) <= set(SET_MEASURES), "each has its name on the page"


def test_points_of_an_edge_are_evenly_spread_and_hidden_ones_left_out(truth: SetTruth) -> None:
    points = points_along(np.array([1.0, -50.0, 1.0]), np.array([1.0, 50.0, 1.0]))
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    steps = np.degrees(np.arccos((directions[1:] * directions[:-1]).sum(axis=1)))
    assert np.ptp(steps) < 1e-6 and 0.2 < steps[0] <= 0.25 + 1e-9
    assert np.allclose(points[[0, -1]], [[1, -50, 1], [1, 50, 1]]) and np.allclose(points[:, [0, 2]], 1)
    place = truth.rendered.sphere.place
    behind = place + 1.5 * (BALL - place)
    lines = np.array([[behind - [0, 0, 0.2], behind + [0, 0, 0.2]], [[-3.0, 4.0, 0.5], [-3.0, 4.0, 2.5]]])
    world = WorldLines.of(replace(truth, rendered=replace(truth.rendered, lines=lines)))
    assert set(world.line) == {1} and world.upright.all()


def test_a_camera_sees_points_ahead_of_it_that_nothing_hides(truth: SetTruth) -> None:
    camera, depth = truth.rendered.cameras[0], truth.rendered.depths[0]
    wall = np.array([0.5, 4.0, 1.2])
    behind = camera.place + 1.5 * (BALL - camera.place)
    points = np.array([wall, behind, 2 * camera.place - wall, [-3.0, 0.0, 1.5]])
    found = pixels_of(points, camera, depth)
    u, v, w = camera.K @ (camera.R @ wall + camera.t)
    assert np.allclose(found[0], [u / w, v / w]) and np.isnan(found[1:]).all(), "hidden, behind it, beside it"


def test_what_lies_beside_an_edge_of_depth_is_found_there() -> None:
    distance = np.full((5, 8), 4.0)
    distance[:, 3:] = 2.0
    x, y = np.array([2.0, 1.0, 7.0, 0.0]), np.full(4, 2.0)
    assert is_there(distance, x, y, np.full(4, 2.0)).tolist() == [True, False, True, False]
    assert is_there(distance, x, y, np.full(4, 2.0), wraps=True).tolist() == [True, False, True, True]


def test_a_map_is_inverted_to_a_hundredth_of_a_pixel(truth: SetTruth) -> None:
    one = perfect(truth).warp.maps[0]
    pixels = np.array([[30.0, 40.0], [60.5, 22.25], [100.0, 80.0], [np.nan, np.nan], [4000.0, 1.0]])
    row, column = np.unravel_index(np.nanargmin((one.x - 60) ** 2 + (one.y - 45) ** 2), one.x.shape)
    at = shown_at(one, np.tile([float(column), float(row)], (5, 1)), pixels)
    assert np.abs(one.between(at[:3]) - pixels[:3]).max() < 0.05 and np.isnan(at[3:]).all()


def test_lines_too_short_to_tell_are_not_judged() -> None:
    turn = np.radians(np.linspace(0, 40, 41))
    long = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    off = long + np.where(np.arange(41) == 20, 0.01, 0.0)[:, None] * [0, 0, 1]
    line = np.repeat([0, 1, 2], 41)
    found = straightness(np.concatenate([long, off, long / 10 + [0.9, 0, 0]]), line)
    assert [number for _, _, number in found][:2] == [0, 1]
    assert found[0][0] < 1e-9 and found[1][0] == pytest.approx(0.0095, abs=5e-4)
    assert straightness(long[:4], np.zeros(4, int)) == [] and straightness(long[:12] * np.nan, np.zeros(12, int)) == []


def test_a_thing_is_whole_where_nothing_is_wrong_and_its_place_does_not_count(truth: SetTruth) -> None:
    result = perfect(truth)
    assert thing_figures(Found.of(result, truth)) == {
        "things": 1.0, "things_cut": 0.0, "things_half": pytest.approx(0.0, abs=0.05),
    }  # fmt: skip
    for number in range(3):
        one = result.warp.maps[number]
        result.warp.maps[number] = replace(one, x=one.x + np.float32(3.0))
    found = Found.of(result, truth)
    assert thing_figures(found)["things_cut"] == 0
    there = np.flatnonzero((truth.rendered.things[-1] == 1).any(axis=0)).mean()
    assert there - 4.5 < np.flatnonzero((shown_things(found) == 1).any(axis=0)).mean() < there - 1.5


def test_a_thing_of_which_half_comes_from_where_it_is_not_is_cut(truth: SetTruth) -> None:
    result = perfect(truth)
    at = Found.of(result, truth).on_maps()[truth.rendered.things[-1] == 1]
    middle = round(float(np.median(at[:, 0])))
    for number in range(3):
        one = result.warp.maps[number]
        x = one.x.copy()
        x[:, middle:] += 30  # its right half is fetched from the wall beside it
        result.warp.maps[number] = replace(one, x=x)
    figures = thing_figures(Found.of(result, truth))
    assert figures["things_cut"] == 1 and 0.35 < figures["things_half"] < 0.65


def test_halves_copies_and_surplus_count_whole_and_gone_do_not() -> None:
    true = np.zeros((60, 200), bool)
    true[20:40, 40:60] = True
    none = np.zeros_like(true)
    left, copy, beside, wide = true.copy(), true.copy(), none.copy(), true.copy()
    left[:, 50:] = False
    copy[20:40, 140:150] = True
    beside[20:40, 46:66] = True
    wide[20:40, 60:65] = True
    found = [half(shown, true) for shown in (true, none, beside, left, copy, wide)]
    assert found == pytest.approx([0, 0, 0, 0.5, 0.5, 0.25])


def test_steps_of_tone_along_borders_are_those_that_the_truth_does_not_have() -> None:
    random = np.random.default_rng(0)
    true = random.integers(60, 120, (80, 160, 3)).astype(np.uint8)
    true[:, 80:] += 60  # a step of the world's own, where the border is
    labels = np.zeros((80, 160), np.int16)
    labels[:, 80:] = 1
    assert seam_steps(labels, true, true) == {"seam_levels": 0.0, "seam_p90_levels": 0.0}
    other = true.copy()
    other[:, 80:, 1] += 7
    assert seam_steps(labels, other, true) == pytest.approx({"seam_levels": 7, "seam_p90_levels": 7})
    half_way = true.copy()
    half_way[:20, 80:] += 7
    assert seam_steps(labels, half_way, true)["seam_levels"] == 0
    assert seam_steps(labels, half_way, true)["seam_p90_levels"] == pytest.approx(7)
    assert seam_steps(labels.T.copy(), other.transpose(1, 0, 2), true.transpose(1, 0, 2))["seam_levels"] == 7
    assert seam_steps(labels + np.int16(1), true + np.uint8(9), true)["seam_levels"] == 0, "brighter all over"
    labels[:, 80:] = -1
    assert np.isnan(seam_steps(labels, other, true)["seam_levels"]), "no border is judged"


def test_a_panorama_darker_on_one_side_of_a_border_shows_it(truth: SetTruth) -> None:
    found = Found.of(perfect(truth), truth)
    where = truth.views_at(found.numbers) > 0
    even = seam_figures(found, truth.picture, where)
    darker = np.where((found.labels_on_sphere == 0)[..., None], truth.picture // 2, truth.picture)
    assert even["seam_levels"] == 0 and seam_figures(found, darker, where)["seam_levels"] > 10
