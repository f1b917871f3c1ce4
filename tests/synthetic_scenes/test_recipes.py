"""The scenes by name: cameras as their numbers say, and what each recipe is there for."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry
from edf_stitch.synthetic_scenes.recipes import (
    FULL,
    QUICK,
    RECIPES,
    Difficulty,
    View,
    overlap_at_infinity,
    parse_scene,
)
from edf_stitch.synthetic_scenes.sets.recipes import SETS
from edf_stitch.synthetic_scenes.suites import SIZES, SUITES

ASKED_FOR = {
    "two_planes", "layered_cards", "corner_room", "street", "foliage", "relief", "tabletop", "portrait_pair",
    "zoom_pair", "forward", "sideways", "toe_in", "pure_rotation", "single_plane", "exposure_step", "hdr_interior",
    "low_texture", "wide", "occluder", "thin_things",
}  # fmt: skip
SIZE = (640, 480)


def geometry(name: str, difficulty: Difficulty | None = None) -> TrueGeometry:
    recipe = RECIPES[name]
    return TrueGeometry.of(*recipe.cameras(recipe.size(*SIZE), difficulty or Difficulty()))


def test_all_that_was_asked_for_is_there() -> None:
    assert set(FULL) >= ASKED_FOR and len(QUICK) == 4 and set(QUICK) <= set(FULL)
    assert SIZES == {"quick": (640, 480), "full": (1280, 960), "sets": (640, 480)} and set(SUITES) == set(SIZES)
    assert set(SUITES["quick"]) > set(QUICK) and SUITES["full"] == FULL and set(SUITES["sets"]) == set(SETS)
    assert not set(SETS) & set(RECIPES), "a name is that of one scene"


def test_a_view_by_hand() -> None:
    level = View().camera(SIZE)
    assert np.allclose(level.R @ [0, 1, 0], [0, 0, 1]) and np.allclose(level.R @ [0, 0, 1], [0, -1, 0])
    assert level.K[0, 0] == pytest.approx(30 / 36 * 640) and np.allclose(level.K[:2, 2], [319.5, 239.5])
    assert np.allclose(View((1, 2, 3)).camera(SIZE).place, [1, 2, 3])
    right, down = View(yaw=30).camera(SIZE), View(pitch=30).camera(SIZE)
    ahead = np.array([0, 1, 0])
    assert (right.R @ ahead)[0] == pytest.approx(-0.5), "turned to the right, what was ahead lies to the left"
    assert (down.R @ ahead)[1] == pytest.approx(-0.5), "turned down, what was ahead lies above"
    rolled = View(roll=30).camera(SIZE)
    assert (rolled.R @ [0, 0, 1])[0] == pytest.approx(-0.5), "rolled clockwise, up leans to the left"


def test_portrait_is_upright_and_has_the_same_focal_length() -> None:
    recipe = RECIPES["portrait_pair"]
    assert recipe.size(*SIZE) == (480, 640) and RECIPES["street"].size(*SIZE) == SIZE
    assert recipe.cameras((480, 640), Difficulty())[0].K[0, 0] == pytest.approx(30 / 36 * 640)


@pytest.mark.parametrize("name", FULL)
def test_difficulty_scales_baseline_and_turn(name: str) -> None:
    one, two = geometry(name), geometry(name, Difficulty(baseline=2))
    assert two.baseline == pytest.approx(2 * one.baseline) and np.allclose(two.R, one.R)
    still = geometry(name, Difficulty(turn=0))
    assert rotation_angle(still.R, np.eye(3)) < 1e-6 and still.baseline == pytest.approx(one.baseline)
    assert (one.baseline == 0) == (name == "pure_rotation")


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("name", ["two_planes", "tabletop", "portrait_pair", "wide"])
def test_an_overlap_is_reached(name: str, share: float) -> None:
    recipe = RECIPES[name]
    cameras = recipe.cameras(recipe.size(*SIZE), Difficulty(overlap=share))
    assert overlap_at_infinity(*cameras) == pytest.approx(share, abs=0.011)


def test_an_overlap_that_no_turn_gives_is_refused() -> None:
    with pytest.raises(BadRequest, match="overlap"):
        RECIPES["sideways"].cameras(SIZE, Difficulty(overlap=0.4))


def test_the_special_ones_are_what_they_are_named_after() -> None:
    forward = geometry("forward")
    epipole = forward.e_prime[:2] / forward.e_prime[2]
    assert (epipole > 0).all() and (epipole < SIZE).all() and rotation_angle(forward.R, np.eye(3)) < 1e-6
    sideways = geometry("sideways")
    assert abs(sideways.t[2]) < 0.1 and rotation_angle(sideways.R, np.eye(3)) < 1e-6
    zoom = geometry("zoom_pair")
    assert zoom.K[0, 0] / zoom.K_prime[0, 0] > 1.2
    assert rotation_angle(geometry("portrait_pair").R, np.eye(3)) > 9
    first, second = RECIPES["toe_in"].cameras(SIZE, Difficulty())
    # where both axes meet, seen from either
    a, b = first.R[2], second.R[2]
    along = np.linalg.lstsq(np.column_stack([a, -b]), second.place - first.place, rcond=None)[0]
    assert np.allclose(first.place + along[0] * a, second.place + along[1] * b)
    assert along[0] == pytest.approx(along[1]) and along[0] > 0
    wide = RECIPES["wide"].cameras(SIZE, Difficulty())
    assert 0.2 < overlap_at_infinity(*wide) < 0.3 and rotation_angle(wide[0].R, wide[1].R) == pytest.approx(60, abs=2)


def test_a_scene_by_name_and_made_harder() -> None:
    assert parse_scene("street") == (RECIPES["street"], Difficulty())
    assert parse_scene("street:baseline=2,noise=3")[1] == Difficulty(baseline=2, noise=3)


@pytest.mark.parametrize("text", ["avenue", "", "street:fog=1", "street:noise", "street:noise=x", "street:noise=-1",
                                  "street:noise=nan", "street:noise=inf"])  # fmt: skip
def test_a_scene_that_is_none_is_refused_with_what_there_is(text: str) -> None:
    with pytest.raises(BadRequest, match="there are: (two_planes|baseline)"):
        parse_scene(text)
